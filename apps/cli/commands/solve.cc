#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/summary_parts.h"
#include "apps/cli/terminal/describe.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/map/refinement.h"
#include "output/export/known_rotation_file.h"
#include "output/files/atomic_file.h"
#include "output/graph/rotation_list_file.h"
#include "output/map/ply.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/averaging/global_averaging.h"
#include "rotodom/types/stopwatch.h"
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
  }
  GlobalAveragingOptions options;
  options.seed = flags.common.seed;
  GlobalAveragingProblem problem;
  problem.edges = list.edges;
  problem.use_start = false;
  const GlobalAveragingResult averaged =
      AverageGlobally(problem, options, flags.common.NumThreads());

  std::vector<RotationMap> pieces(averaged.component_sizes.size());
  for (const auto& [view, cam_from_world] : averaged.cam_from_world) {
    const std::string& id = list.ids[view.value];
    FrameId frame;
    const auto [stop, code] = std::from_chars(id.data(), id.data() + id.size(), frame.value);
    if (code != std::errc() || stop != id.data() + id.size()) continue;
    if (!input.cam_from_world.contains(frame)) continue;
    pieces[averaged.component.at(view)][frame] = cam_from_world;
  }
  const auto largest = std::max_element(
      pieces.begin(), pieces.end(), [](const RotationMap& a, const RotationMap& b) {
        return a.size() < b.size();
      });
  if (largest == pieces.end() || largest->size() < 2) {
    throw std::runtime_error(flags.relative_rotations + ": ties no two views of " + flags.input +
                             " together; its numbers must be those of the views there");
  }
  input.cam_from_world = std::move(*largest);
  input.sigma_rad.clear();
  std::set<FrameId> views;
  for (const auto& [view, rotation] : input.cam_from_world) views.insert(view);
  input.tracks = RestrictTracks(input.tracks, views, 2);
  return views.size();
}

Trajectory PosesOf(const Reconstruction& map, const KnownRotationInput& input) {
  Trajectory trajectory;
  for (const auto& [view, center] : map.center_in_world) {
    const auto timestamp = input.timestamp_s.find(view);
    trajectory.push_back({timestamp == input.timestamp_s.end() ? view.value : timestamp->second,
                          map.cam_from_world.at(view).Inverse(),
                          center});
  }
  return trajectory;
}

// Every observation that the map does not hold, and why: krot's reason, or that bundle adjustment
// found it too far from its point.
void WriteRemoved(const std::filesystem::path& path,
                  const KnownRotationInput& input,
                  const KrotSolution& krot,
                  const std::vector<BundleResult>& bundles) {
  std::set<std::pair<TrackId, FrameId>> kept;
  for (const BundleResult& bundle : bundles) {
    if (!bundle.Usable()) continue;
    for (const Track& track : bundle.reconstruction.tracks) {
      for (const Observation& observation : track.observations) {
        kept.insert({track.id, observation.frame});
      }
    }
  }
  std::map<std::pair<TrackId, FrameId>, RemovalReason> reasons;
  for (const RemovedObservation& removed : krot.removed) {
    reasons.insert({{removed.track, removed.frame}, removed.reason});
  }
  std::string text = "track,view,reason\n";
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      if (kept.contains({track.id, observation.frame})) continue;
      const auto reason = reasons.find({track.id, observation.frame});
      text += std::to_string(track.id.value) + "," + std::to_string(observation.frame.value) + "," +
              (reason == reasons.end() ? "bundle" : ToString(reason->second)) + "\n";
    }
  }
  ReplaceFile(path, text);
}

// The components, largest first.
std::vector<std::size_t> BySize(const RefinedComponents& refined) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < refined.bundles.size(); ++k) {
    if (refined.bundles[k].Usable()) order.push_back(k);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return refined.bundles[a].summary.num_observations >
           refined.bundles[b].summary.num_observations;
  });
  return order;
}

// The first component's files lie in `directory`, those of the others in folders of their own: what
// scale and place they have to one another, no track tells.
void WriteComponents(const std::filesystem::path& directory,
                     const KnownRotationInput& input,
                     const RefinedComponents& refined,
                     const std::vector<std::size_t>& order) {
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const std::filesystem::path folder =
        rank == 0 ? directory : directory / ("component_" + std::to_string(rank));
    std::filesystem::create_directories(folder);
    const Reconstruction& map = refined.bundles[order[rank]].reconstruction;
    WriteTumTrajectory(folder / "keyframes_tum.txt", PosesOf(map, input));
    WritePly(folder / "cloud.ply", MakeCloud(map, refined.camera));
  }
}

RunSummary Summarise(const SolveFlags& flags,
                     const RunOptions& options,
                     const KnownRotationInput& input,
                     const KrotSolution& krot,
                     const RefinedComponents& refined) {
  RunSummary summary;
  summary.command = "solve";
  summary.options = DescribeOptions(options);
  summary.camera = input.camera;
  summary.sequence = {{"input", flags.input}, {"format", input.format}};
  if (!flags.relative_rotations.empty()) {
    summary.sequence.emplace_back("relative_rotations", flags.relative_rotations);
  }
  std::int64_t observations = 0;
  for (const Track& track : input.tracks) {
    observations += static_cast<std::int64_t>(track.observations.size());
  }
  const auto count = [](std::size_t value) { return static_cast<std::int64_t>(value); };
  summary.counts = {{"views", count(input.cam_from_world.size())},
                    {"tracks", count(input.tracks.size())},
                    {"observations", observations},
                    {"placed_views", count(krot.center_in_world.size())},
                    {"components", count(refined.components.size())}};
  AddKnownRotation(krot, input.camera, summary);
  std::vector<BundleSummary> bundles;
  for (const BundleResult& bundle : refined.bundles) {
    if (bundle.Usable()) bundles.push_back(bundle.summary);
  }
  AddBundles(bundles, refined.camera, summary);
  return summary;
}

int Solve(const SolveFlags& flags) {
  const Clock::time_point start = Clock::now();
  Progress progress(flags.common);
  RunOptions options = ReadRunOptions(flags.common);
  flags.krot.Override(options.krot);
  options.krot.num_threads = options.ba.num_threads = options.num_threads;

  progress.StartStage("reading", -1);
  KnownRotationInput input = ReadKnownRotation(flags.input);
  progress.EndStage(input.format + ", " + std::to_string(input.cam_from_world.size()) + " views, " +
                    std::to_string(input.tracks.size()) + " tracks");
  if (!flags.relative_rotations.empty()) {
    progress.StartStage("averaging", -1);
    const std::size_t num_views = TakeRelativeRotations(flags, input);
    progress.EndStage(std::to_string(num_views) + " views have an orientation");
  }
  const std::filesystem::path directory = PrepareRunDirectory(flags.out);

  progress.StartStage("known rotation", -1);
  const KrotSolution krot = SolveKnownRotation(
      input.cam_from_world, input.tracks, input.camera, options.krot, input.sigma_rad);
  progress.EndStage(krot.message);
  if (!krot.Usable()) throw std::runtime_error(flags.input + ": " + krot.message);

  progress.StartStage("bundle adjustment", -1);
  const RefinedComponents refined =
      RefineComponents({input.cam_from_world, krot.center_in_world, input.tracks},
                       krot.component,
                       input.camera,
                       options.ba);
  const std::vector<std::size_t> order = BySize(refined);
  if (order.empty()) {
    throw std::runtime_error(flags.input + ": bundle adjustment found no usable map");
  }
  const BundleSummary& largest = refined.bundles[order.front()].summary;
  progress.EndStage(std::to_string(largest.num_frames) + " views, " +
                    std::to_string(largest.num_points) + " points, " +
                    DescribeMeanError({largest}));

  WriteComponents(directory, input, refined, order);
  WriteRemoved(directory / "removed.csv", input, krot, refined.bundles);
  RunSummary summary = Summarise(flags, options, input, krot, refined);
  summary.seconds.push_back({"total", SecondsSince(start)});
  WriteSummary(directory / "summary.json", summary);
  if (order.size() > 1) {
    progress.Warn(std::to_string(order.size()) +
                  " components share no tracks with depth; each has its own scale, the smaller "
                  "ones are in folders of their own");
  }
  progress.Say("wrote " + directory.string() +
               ": keyframes_tum.txt, cloud.ply, removed.csv, summary.json");
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
  AddKrotFlags(*command, flags->krot);
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam solve colmap/sparse/0 --out runs/solved");
  command->callback([flags, &action] { action = [flags] { return Solve(*flags); }; });
}

}  // namespace rotslam
