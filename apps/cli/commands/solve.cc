#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/orientation_files.h"
#include "apps/cli/run_directory/position_files.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/summary_parts.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/solve/solution.h"
#include "apps/cli/solve/solved_files.h"
#include "apps/cli/terminal/describe.h"
#include "apps/cli/terminal/progress.h"
#include "krot/rotation_convention.h"
#include "output/export/known_rotation_file.h"
#include "output/graph/rotation_list_file.h"
#include "rotodom/averaging/global_averaging.h"
#include "rotodom/types/stopwatch.h"
#include "rotodom/types/text_file.h"
#include "rotodom/types/track.h"

namespace rotslam {
namespace {

using Clock = std::chrono::steady_clock;

struct SolveFlags {
  CommonFlags common;
  KrotFlags krot;
  std::string input;
  std::string relative_rotations;
  std::string out;
  double rotation_sigma_deg = -1.0;  // negative: as the input says
  bool adjust = true;
};

// Orientations from relative ones, in place of the input's. What the graph does not tie to most of
// the views leaves the input: orientations of separate pieces have nothing to do with each other.
// @return  the number of views left.
std::size_t TakeRelativeRotations(const SolveFlags& flags, KnownRotationInput& input) {
  constexpr double kSigmaDeg = 1.0;  // of edges that say none, as `average` has it
  const RotationList list = ReadRotationList(flags.relative_rotations, kSigmaDeg * kRadFromDeg);
  if (!flags.common.quiet) {
    for (const std::string& note : list.notes) {
      std::printf("note: %s: %s\n", flags.relative_rotations.c_str(), note.c_str());
    }
    if (!list.unread.empty()) {
      std::printf(
          "note: %s: not read: %s\n", flags.relative_rotations.c_str(), list.unread.c_str());
    }
  }
  GlobalAveragingOptions options;
  options.seed = flags.common.seed;
  GlobalAveragingProblem problem;
  problem.edges = list.edges;
  problem.use_start = false;
  const GlobalAveragingResult averaged =
      AverageGlobally(problem, options, flags.common.NumThreads());

  std::map<std::string, FrameId> frames;
  for (const auto& [frame, rotation] : input.cam_from_world) frames[NameOf(input, frame)] = frame;
  if (input.colmap != nullptr) {
    for (const auto& [frame, name] : input.colmap->image_name) frames.try_emplace(name, frame);
  }
  std::vector<RotationMap> pieces(averaged.component_sizes.size());
  for (const auto& [view, cam_from_world] : averaged.cam_from_world) {
    const auto frame = frames.find(list.ids[view.value]);
    if (frame == frames.end()) continue;
    pieces[averaged.component.at(view)][frame->second] = cam_from_world;
  }
  const auto largest = std::max_element(
      pieces.begin(), pieces.end(), [](const RotationMap& a, const RotationMap& b) {
        return a.size() < b.size();
      });
  if (largest == pieces.end() || largest->size() < 2) {
    throw std::runtime_error(flags.relative_rotations + ": ties no two views of " + flags.input +
                             " together; its ids must be those of the views there");
  }
  input.cam_from_world = std::move(*largest);
  input.sigma_rad.clear();
  std::set<FrameId> views;
  for (const auto& [view, rotation] : input.cam_from_world) views.insert(view);
  input.tracks = RestrictTracks(input.tracks, views, 2);
  return views.size();
}

RunSummary Summarise(const SolveFlags& flags,
                     const RunOptions& options,
                     const KnownRotationInput& input,
                     const MapResult& positions) {
  RunSummary summary;
  summary.command = "solve";
  summary.options = DescribeOptions(options);
  summary.camera = input.camera;
  summary.sequence = {{"description", input.format + ", " + flags.input},
                      {"input", flags.input},
                      {"format", input.format},
                      {"adjusted", flags.adjust}};
  if (!flags.relative_rotations.empty()) {
    summary.sequence.emplace_back("relative_rotations", flags.relative_rotations);
  }
  const auto count = [](std::size_t value) { return static_cast<std::int64_t>(value); };
  summary.counts = {{"frames", count(input.cam_from_world.size())},
                    {"views", count(input.cam_from_world.size())},
                    {"tracks", count(input.tracks.size())},
                    {"observations", std::int64_t{NumObservations(input.tracks)}},
                    {"placed_views", count(positions.keyframes.size())}};
  AddPositions(positions, input.camera, summary);
  return summary;
}

// Names the views that have no position.
void WarnOfUnplaced(const KnownRotationInput& input,
                    const MapResult& positions,
                    Progress& progress) {
  constexpr std::size_t kMaxNamed = 8;
  std::map<FrameId, int> count;
  for (const Track& track : input.tracks) {
    if (track.observations.size() < 2) continue;
    for (const Observation& observation : track.observations) ++count[observation.frame];
  }
  std::string names;
  std::size_t num_unplaced = 0;
  for (const auto& [view, rotation] : input.cam_from_world) {
    if (positions.keyframes.contains(view)) continue;
    if (++num_unplaced > kMaxNamed) continue;
    names += (names.empty() ? "" : ", ") + NameOf(input, view) + " (" +
             std::to_string(count[view]) + " observations of tracks)";
  }
  if (num_unplaced == 0) return;
  if (num_unplaced > kMaxNamed) names += " ...";
  progress.Warn(std::to_string(num_unplaced) + (num_unplaced == 1 ? " view" : " views") +
                " could not be placed: " + names);
}

void RefuseOtherConventions(const std::string& file, const KnownRotationInput& input) {
  const ConventionCheck check = CheckConvention(input.cam_from_world, input.tracks);
  if (check.other.empty()) return;
  throw std::runtime_error(file + ": its rotations disagree with the tracks by " +
                           FormatNumber("%.2f", check.given_deg) + " deg (median), " + check.other +
                           " by " + FormatNumber("%.2f", check.other_deg) +
                           " deg: orientations must be those of cameras with x right, y down, z "
                           "forward, in the direction that the form of file has");
}

// The flag's, else the input's. Those of a run come from the very images that its tracks come from,
// and would count them twice: they are no prior.
RotationPriors PriorsOf(const SolveFlags& flags,
                        const KnownRotationInput& input,
                        RunOptions& options) {
  if (flags.rotation_sigma_deg < 0.0) {
    const bool is_run = std::filesystem::is_directory(flags.input);
    return is_run ? RotationPriors() : input.sigma_rad;
  }
  if (flags.rotation_sigma_deg == 0.0) {
    options.ba.refine_rotations = false;
    return {};
  }
  RotationPriors priors;
  for (const auto& [view, rotation] : input.cam_from_world) {
    priors[view] = flags.rotation_sigma_deg * kRadFromDeg;
  }
  return priors;
}

// Reads the problem, with other orientations where the flags name some. Throws std::runtime_error
// where these are in another convention.
KnownRotationInput ReadInput(const SolveFlags& flags, Progress& progress) {
  progress.StartStage("reading", -1);
  KnownRotationInput input = ReadKnownRotation(flags.input);
  progress.EndStage(input.format + ", " + std::to_string(input.cam_from_world.size()) + " views, " +
                    std::to_string(input.tracks.size()) + " tracks");
  for (const std::string& note : input.notes) progress.Warn(flags.input + ": " + note);
  if (!flags.relative_rotations.empty()) {
    progress.StartStage("averaging", -1);
    const std::size_t num_views = TakeRelativeRotations(flags, input);
    progress.EndStage(std::to_string(num_views) + " views have an orientation");
  }
  RefuseOtherConventions(flags.relative_rotations.empty() ? flags.input : flags.relative_rotations,
                         input);
  return input;
}

RunOptions OptionsOf(const SolveFlags& flags) {
  RunOptions options = ReadRunOptions(flags.common);
  flags.krot.Override(options.krot);
  options.krot.num_threads = options.ba.num_threads = options.num_threads;
  if (!flags.adjust && flags.krot.start.empty() && options.krot.use_bracket) {
    options.krot.start = KrotStart::kBisection;
  }
  return options;
}

// Throws std::runtime_error where there is no map.
void RequireMap(const SolveFlags& flags, const Solution& solution) {
  const KrotSolution& krot = solution.krot;
  if (!krot.Usable()) throw std::runtime_error(flags.input + ": " + krot.message);
  if (!solution.maps.empty()) return;
  throw std::runtime_error(
      flags.input + ": bundle adjustment found no usable map" +
      (krot.status == KrotStatus::kContradiction ? "; " + krot.message : std::string()));
}

int Solve(const SolveFlags& flags) {
  const Clock::time_point start = Clock::now();
  Progress progress(flags.common);
  RunOptions options = OptionsOf(flags);
  KnownRotationInput input = ReadInput(flags, progress);
  // Several cameras are solved as one without distortion, which has no lens to refine.
  if (input.colmap != nullptr && input.colmap->HasSeveralCameras()) {
    options.ba = WithFixedLens(options.ba);
  }
  std::vector<FrameId> given;
  for (const auto& [view, rotation] : input.cam_from_world) given.push_back(view);
  input = WithViewsInOrder(input);
  const RotationPriors priors = PriorsOf(flags, input, options);
  const std::filesystem::path directory = PrepareRunDirectory(flags.out);

  const Solution solution = SolveAtWorkingSize(input, priors, options, flags.adjust, progress);
  RequireMap(flags, solution);
  if (flags.adjust) {
    const BundleSummary& largest = solution.refined.bundles[solution.component.front()].summary;
    progress.EndStage(std::to_string(largest.num_frames) + " views, " +
                      std::to_string(largest.num_points) + " points, " +
                      DescribeMeanError({largest}));
  }

  const auto [orientations, positions] = AsRun(input, solution, options);
  UnfinishedOutputs outputs(directory);
  const std::filesystem::path& folder = outputs.folder();
  WriteOrientations(folder, orientations, AveragingOptions());
  WritePositions(folder, orientations, positions, PlyForm::kBinary);
  WriteKnownRotation(folder / "known_rotation.txt", input);
  WriteSolvedMaps(folder, input, given, positions);
  WriteViews(folder / "views.csv", input, given, positions);
  const Verdicts verdicts = VerdictsOf(input, solution, flags.adjust);
  WriteRemoved(folder / "removed.csv", input, verdicts);
  WriteResiduals(folder / "residuals.csv", input, solution, verdicts);
  if (input.colmap != nullptr)
    WriteSolvedColmap(directory, flags.input, input, given, solution, progress);
  RunSummary summary = Summarise(flags, options, input, positions);
  summary.seconds.push_back({"total", SecondsSince(start)});
  WriteSummary(folder / "summary.json", summary);
  outputs.Publish();
  if (solution.maps.size() > 1) {
    progress.Warn(std::to_string(solution.maps.size()) +
                  " components share no tracks with depth; each has its own scale, which "
                  "poses.csv and segments.csv tell apart");
  }
  WarnOfUnplaced(input, positions, progress);
  if (solution.krot.status == KrotStatus::kContradiction) progress.Warn(solution.krot.message);
  progress.Say("wrote " + directory.string() +
               ": keyframes_tum.txt, cloud.ply, views.csv, residuals.csv, removed.csv, map.bin, " +
               (input.colmap != nullptr ? "sparse, " : "") +
               "summary.json and what `rotslam run` leaves");
  return 0;
}

}  // namespace

void AddSolveCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<SolveFlags>();
  CLI::App* command = app.add_subcommand(
      "solve", "Positions and points from orientations and tracks, with a bracket of the optimum");
  command
      ->add_option("input",
                   flags->input,
                   "What `rotslam run` left, a COLMAP model (its positions and points are not "
                   "looked at), a BAL file, or our text form (see known_rotation.txt of a run)")
      ->required();
  command->add_option(
      "--relative-rotations",
      flags->relative_rotations,
      "Graph of relative rotations between the input's views, as `rotslam average` "
      "takes it: orientations are averaged from these, the input's are not looked at");
  command->add_option("--out", flags->out, "Folder for the results; made where missing")
      ->required();
  command
      ->add_option("--rotation-sigma-deg",
                   flags->rotation_sigma_deg,
                   "Standard deviation of the orientations, about each axis: bundle adjustment "
                   "moves them against it; 0 holds them (default: the input's, where it has one, "
                   "else they are free)")
      ->check(AtLeastZero());
  command->add_flag("--adjust,!--no-adjust",
                    flags->adjust,
                    "Bundle adjustment; without it the known-rotation solution is written, that of "
                    "the bisection unless --krot says otherwise (default: with it)");
  AddKrotFlags(*command, flags->krot);
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam solve colmap/sparse/0 --out runs/solved");
  command->callback([flags, &action] { action = [flags] { return Solve(*flags); }; });
}

}  // namespace rotslam
