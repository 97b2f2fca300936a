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

#include <Eigen/Geometry>

#include "apps/cli/command.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/orientation_files.h"
#include "apps/cli/run_directory/position_files.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/summary_parts.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/terminal/describe.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/map/refinement.h"
#include "apps/slam/working_size/original_size.h"
#include "apps/slam/working_size/working_size.h"
#include "krot/rotation_convention.h"
#include "output/export/colmap_model.h"
#include "output/export/known_rotation_file.h"
#include "output/files/atomic_file.h"
#include "output/graph/rotation_list_file.h"
#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"
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

// Why an observation is not in the map, by track and view; "kept" where it is.
using Verdicts = std::map<std::pair<TrackId, FrameId>, std::string>;

Verdicts VerdictsOf(const KnownRotationInput& input,
                    const KrotSolution& krot,
                    const std::vector<Reconstruction>& maps,
                    bool is_adjusted) {
  Verdicts verdicts;
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      verdicts[{track.id, observation.frame}] = is_adjusted ? "bundle" : "no_point";
    }
  }
  for (const RemovedObservation& removed : krot.removed) {
    verdicts[{removed.track, removed.frame}] = ToString(removed.reason);
  }
  for (const Reconstruction& map : maps) {
    for (const Track& track : map.tracks) {
      for (const Observation& observation : track.observations) {
        verdicts[{track.id, observation.frame}] = "kept";
      }
    }
  }
  return verdicts;
}

// Every observation that the map does not hold, and why: krot's reason, or that bundle adjustment
// found it too far from its point.
void WriteRemoved(const std::filesystem::path& path,
                  const KnownRotationInput& input,
                  const Verdicts& verdicts) {
  std::string text = "track,view,reason\n";
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      const std::string& verdict = verdicts.at({track.id, observation.frame});
      if (verdict == "kept") continue;
      text +=
          NameOf(input, track.id) + "," + NameOf(input, observation.frame) + "," + verdict + "\n";
    }
  }
  ReplaceFile(path, text);
}

// How far each observation is from its point, pixels per axis of a pinhole of the camera's mean
// focal length, which is what the bracket bounds; empty where the point is not there or behind.
void WriteResiduals(const std::filesystem::path& path,
                    const KnownRotationInput& input,
                    const std::vector<Reconstruction>& maps,
                    const Camera& camera,
                    const Verdicts& verdicts) {
  std::string text = "track,view,dx_px,dy_px,state\n";
  const auto residual = [&](const Track& track, const Observation& observation) {
    for (const Reconstruction& map : maps) {
      const auto point = map.point_in_world.find(track.id);
      const auto center = map.center_in_world.find(observation.frame);
      if (point == map.point_in_world.end() || center == map.center_in_world.end()) continue;
      const Eigen::Vector3d seen =
          map.cam_from_world.at(observation.frame) * (point->second - center->second);
      const auto bearing = camera.Unproject(observation.keypoint_px);
      if (!bearing || !(seen.z() > 0.0) || !(bearing->z() > 0.0)) continue;
      const Eigen::Vector2d miss_px =
          camera.MeanFocal() * (seen.hnormalized() - bearing->hnormalized());
      return FormatNumber("%.9g", miss_px.x()) + "," + FormatNumber("%.9g", miss_px.y());
    }
    return std::string(",");
  };
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      text += NameOf(input, track.id) + "," + NameOf(input, observation.frame) + "," +
              residual(track, observation) + "," + verdicts.at({track.id, observation.frame}) +
              "\n";
    }
  }
  ReplaceFile(path, text);
}

// The solution of a problem in pixels of its images.
struct Solution {
  KrotSolution krot;
  RefinedComponents refined;  // without bundle adjustment: no bundles
  // The maps, largest first, and the component of `refined` that each was made of.
  std::vector<Reconstruction> maps;
  std::vector<std::size_t> component;
};

// The parts of the known-rotation solution, without the observations that it has taken out.
std::vector<Reconstruction> MapsOf(const KnownRotationInput& input,
                                   const KrotSolution& krot,
                                   const std::vector<MapComponent>& components) {
  std::set<std::pair<TrackId, FrameId>> removed;
  for (const RemovedObservation& one : krot.removed) removed.insert({one.track, one.frame});
  std::vector<Reconstruction> maps;
  for (const MapComponent& component : components) {
    Reconstruction& map = maps.emplace_back();
    for (const FrameId view : component.keyframes) {
      map.cam_from_world[view] = input.cam_from_world.at(view);
      map.center_in_world[view] = krot.center_in_world.at(view);
    }
    for (const Track& track : input.tracks) {
      const auto point = krot.point_in_world.find(track.id);
      if (point == krot.point_in_world.end()) continue;
      Track kept{track.id, {}, track.rgb};
      for (const Observation& observation : track.observations) {
        if (!component.keyframes.contains(observation.frame)) continue;
        if (!removed.contains({track.id, observation.frame}))
          kept.observations.push_back(observation);
      }
      if (kept.observations.size() < 2) continue;
      std::sort(kept.observations.begin(),
                kept.observations.end(),
                [](const Observation& a, const Observation& b) { return a.frame < b.frame; });
      map.point_in_world[track.id] = point->second;
      map.tracks.push_back(std::move(kept));
    }
  }
  return maps;
}

std::vector<MapComponent> ComponentsOf(const KrotSolution& krot) {
  std::map<int, MapComponent> by_number;
  for (const auto& [view, number] : krot.component) {
    if (krot.center_in_world.contains(view)) by_number[number].keyframes.insert(view);
  }
  std::vector<MapComponent> components;
  for (auto& [number, component] : by_number) {
    if (component.keyframes.size() >= 2) components.push_back(std::move(component));
  }
  return components;
}

// Bundle adjustment of every component, the one with the most views first, which refines the lens.
RefinedComponents Adjust(const KnownRotationInput& input,
                         const std::map<FrameId, double>& priors,
                         const std::vector<Track>& tracks,
                         const KrotSolution& krot,
                         const Camera& camera,
                         BundleOptions options) {
  // Two views only, or chains of such: nothing confirms a match, and nothing else is there.
  const auto num_confirmed = std::count_if(tracks.begin(), tracks.end(), [](const Track& track) {
    return static_cast<int>(track.observations.size()) >= kMinTrackObservations;
  });
  if (num_confirmed < kMinFrameObservations) options.min_track_observations = 2;
  RefinedComponents refined;
  refined.camera = camera;
  refined.components = ComponentsOf(krot);
  std::vector<Track> seen = tracks;
  for (const MapComponent& component : refined.components) {
    BundleProblem problem;
    problem.camera = refined.camera;
    for (const FrameId view : component.keyframes) {
      problem.start.cam_from_world[view] = input.cam_from_world.at(view);
      problem.start.center_in_world[view] = krot.center_in_world.at(view);
      const auto sigma = priors.find(view);
      if (sigma != priors.end()) problem.rotation_sigma_rad[view] = sigma->second;
    }
    problem.start.tracks = RestrictTracks(seen, component.keyframes, 2);
    refined.bundles.push_back(RefineBundle(problem, options));
    if (refined.bundles.size() > 1) continue;
    refined.camera = refined.bundles.front().camera;
    options = WithFixedLens(options);
    seen = WithBearingsOf(refined.camera, std::move(seen));
  }
  return refined;
}

// Solves a problem at the size that images of its camera are worked with, since thresholds in
// pixels are meant for that.
Solution SolveAtWorkingSize(const KnownRotationInput& input,
                            const std::map<FrameId, double>& priors,
                            const RunOptions& options,
                            bool adjust,
                            Progress& progress) {
  const Camera& camera = input.camera;
  const WorkingSize working({camera.width, camera.height}, options.max_image_side_px);
  std::vector<Track> tracks = input.tracks;
  ToWorkingSize(working, tracks);
  const Camera reduced = working.Reduced(camera);
  progress.StartStage("known rotation", -1);
  Solution solution;
  solution.krot =
      SolveKnownRotation(input.cam_from_world, tracks, reduced, options.krot, input.sigma_rad);
  progress.EndStage(solution.krot.message);
  if (!solution.krot.Usable()) return solution;
  if (!adjust) {
    solution.refined.camera = camera;
    solution.refined.components = ComponentsOf(solution.krot);
    solution.maps = MapsOf(input, solution.krot, solution.refined.components);
    for (std::size_t k = 0; k < solution.maps.size(); ++k) solution.component.push_back(k);
    return solution;
  }
  progress.StartStage("bundle adjustment", -1);
  solution.refined = Adjust(input, priors, tracks, solution.krot, reduced, options.ba);
  solution.refined.camera = working.Original(solution.refined.camera, camera);
  for (BundleResult& bundle : solution.refined.bundles) {
    ToOriginalSize(working, bundle.reconstruction.tracks);
    ToOriginalSize(working, bundle.summary);
  }
  std::vector<BundleResult>& bundles = solution.refined.bundles;
  for (std::size_t k = 0; k < bundles.size(); ++k) {
    if (bundles[k].Usable()) solution.component.push_back(k);
  }
  std::stable_sort(
      solution.component.begin(), solution.component.end(), [&](std::size_t a, std::size_t b) {
        return bundles[a].summary.num_observations > bundles[b].summary.num_observations;
      });
  for (const std::size_t k : solution.component) {
    solution.maps.push_back(bundles[k].reconstruction);
  }
  return solution;
}

// The maps in one, each in its own scale. A track that several components see is there once for
// each, under further ids.
Reconstruction Joined(const std::vector<Reconstruction>& maps) {
  Reconstruction joined;
  int next = 0;
  for (const Reconstruction& map : maps) {
    for (const Track& track : map.tracks) next = std::max(next, track.id.value + 1);
  }
  for (const Reconstruction& map : maps) {
    joined.cam_from_world.insert(map.cam_from_world.begin(), map.cam_from_world.end());
    joined.center_in_world.insert(map.center_in_world.begin(), map.center_in_world.end());
    for (Track track : map.tracks) {
      const Eigen::Vector3d point = map.point_in_world.at(track.id);
      if (joined.point_in_world.contains(track.id)) track.id = TrackId{next++};
      joined.point_in_world[track.id] = point;
      joined.tracks.push_back(std::move(track));
    }
  }
  std::sort(joined.tracks.begin(), joined.tracks.end(), [](const Track& a, const Track& b) {
    return a.id < b.id;
  });
  return joined;
}

// The solution in the types that the writers of a run directory take.
struct RunResult {
  Orientations orientations;
  MapResult positions;
};

RunResult AsRun(const KnownRotationInput& input,
                const Solution& solution,
                const RunOptions& options) {
  RunResult result;
  Orientations& orientations = result.orientations;
  MapResult& positions = result.positions;
  const Reconstruction map = Joined(solution.maps);
  positions.map = positions.cloud = map;
  positions.camera = solution.refined.camera;
  positions.keyframe_tracks = input.tracks;
  positions.krot = solution.krot;
  if (!solution.refined.bundles.empty()) {
    positions.final_bracket = BracketComponents(solution.refined, options.krot);
  }
  for (std::size_t rank = 0; rank < solution.maps.size(); ++rank) {
    MapComponent component;
    for (const auto& [view, center] : solution.maps[rank].center_in_world) {
      component.keyframes.insert(view);
      FramePose& pose = positions.frame_poses[view];
      pose.state = PoseState::kMeasured;
      pose.component = static_cast<int>(rank);
    }
    component.placed_by_default = rank > 0;
    positions.keyframes.insert(component.keyframes.begin(), component.keyframes.end());
    positions.components.push_back(std::move(component));
    if (solution.refined.bundles.empty()) continue;
    const BundleResult& bundle = solution.refined.bundles[solution.component[rank]];
    positions.bundles.push_back(bundle.summary);
    positions.pose_covariance.insert(bundle.pose_covariance.begin(), bundle.pose_covariance.end());
  }
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (const auto& [view, given] : input.cam_from_world) {
    const auto center = map.center_in_world.find(view);
    const bool is_placed = center != map.center_in_world.end();
    if (is_placed) last = center->second;
    positions.cam_from_world[view] = is_placed ? map.cam_from_world.at(view) : given;
    positions.center_in_world[view] = last;
    positions.frame_poses.try_emplace(view);
    orientations.timestamps_s.push_back(input.timestamp_s.at(view));
    orientations.inlier_edges[view] = 0;
    const auto sigma = input.sigma_rad.find(view);
    if (sigma != input.sigma_rad.end()) {
      orientations.covariance[view] = sigma->second * sigma->second * Eigen::Matrix3d::Identity();
    }
  }
  orientations.cam_from_world = positions.cam_from_world;
  orientations.reports.resize(orientations.timestamps_s.size());
  orientations.given.emplace().fusion.source.assign(orientations.timestamps_s.size(),
                                                    OrientationSource::kSensor);
  return result;
}

// The name of a view's image: the COLMAP model's, else one made of its id.
std::string ImageOf(const KnownRotationInput& input,
                    const std::vector<FrameId>& given,
                    FrameId view) {
  return input.colmap == nullptr ? "view_" + NameOf(input, view)
                                 : input.colmap->image_name.at(given[view.value]);
}

// Writes the maps that `export`, `report` and `plot` read.
void WriteSolvedMaps(const std::filesystem::path& directory,
                     const KnownRotationInput& input,
                     const std::vector<FrameId>& given,
                     const MapResult& positions) {
  RunMap map;
  map.camera = positions.camera;
  for (const auto& [view, cam_from_world] : positions.cam_from_world) {
    map.frames.push_back({view,
                          input.timestamp_s.at(view),
                          ImageOf(input, given, view),
                          positions.keyframes.contains(view),
                          cam_from_world,
                          positions.center_in_world.at(view)});
  }
  std::vector<Track> tracks = input.tracks;
  for (Track& track : tracks) {
    std::sort(track.observations.begin(),
              track.observations.end(),
              [](const Observation& a, const Observation& b) { return a.frame < b.frame; });
  }
  map.tracks = JoinTracks(tracks, positions.map);
  WriteRunMap(directory / "map.bin", map);
  map.tracks = JoinTracks({}, positions.cloud);
  WriteRunMap(directory / "map_all_frames.bin", map);
  WriteViewGraphMatches(directory / "matches.bin", {});
}

// Writes the table of views: frame of the run, id in the input, image, camera, observations.
void WriteViews(const std::filesystem::path& path,
                const KnownRotationInput& input,
                const std::vector<FrameId>& given,
                const MapResult& positions) {
  std::map<FrameId, int> count;
  for (const Track& track : positions.map.tracks) {
    for (const Observation& observation : track.observations) ++count[observation.frame];
  }
  std::string text = "frame,id,timestamp,image,camera,observations,component\n";
  for (const auto& [view, rotation] : input.cam_from_world) {
    const std::string camera =
        input.colmap == nullptr ? std::string()
                                : std::to_string(input.colmap->images.at(given[view.value]).camera);
    text += std::to_string(view.value) + "," + NameOf(input, view) + "," +
            FormatNumber("%.9f", input.timestamp_s.at(view)) + "," + ImageOf(input, given, view) +
            "," + camera + "," + std::to_string(count[view]) + "," +
            std::to_string(positions.frame_poses.at(view).component) + "\n";
  }
  ReplaceFile(path, text);
}

std::string Describe(const ColmapFigures& figures) {
  const double length = figures.num_points == 0
                            ? 0.0
                            : static_cast<double>(figures.num_observations) / figures.num_points;
  return std::to_string(figures.num_images) + " images, " + std::to_string(figures.num_points) +
         " points of " + FormatNumber("%.2f", length) + " observations, " +
         (figures.num_seen > 0 ? "mean error " + FormatNumber("%.3f", figures.mean_error_px) + " px"
                               : std::string("seen by none"));
}

// The COLMAP model that came in, with what came out.
void WriteSolvedColmap(const std::filesystem::path& directory,
                       const std::string& from,
                       const KnownRotationInput& input,
                       const std::vector<FrameId>& given,
                       const Solution& solution,
                       Progress& progress) {
  progress.Say("model before: " + Describe(FiguresOf(*input.colmap, input.colmap->reconstruction)));
  ColmapModel model = *input.colmap;
  if (!model.HasSeveralCameras()) {
    for (auto& [id, camera] : model.cameras) camera = solution.refined.camera;
  }
  const bool is_binary = std::filesystem::exists(std::filesystem::path(from) / "images.bin");
  for (std::size_t rank = 0; rank < solution.maps.size(); ++rank) {
    Reconstruction map;
    for (const auto& [view, center] : solution.maps[rank].center_in_world) {
      map.center_in_world[given[view.value]] = center;
      map.cam_from_world[given[view.value]] = solution.maps[rank].cam_from_world.at(view);
    }
    map.point_in_world = solution.maps[rank].point_in_world;
    map.tracks = solution.maps[rank].tracks;
    for (Track& track : map.tracks) {
      for (Observation& observation : track.observations) {
        observation.frame = given[observation.frame.value];
      }
    }
    progress.Say("model after:  " + Describe(FiguresOf(model, map)));
    WriteColmapModel(directory / "sparse" / std::to_string(rank),
                     model,
                     map,
                     is_binary ? ColmapForm::kBinary : ColmapForm::kText);
  }
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

// How well the orientations are known beforehand, rad.
using RotationPriors = std::map<FrameId, double>;

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
  for (const std::string& note : input.notes) progress.Warn(flags.input + ": " + note);
  if (!flags.relative_rotations.empty()) {
    progress.StartStage("averaging", -1);
    const std::size_t num_views = TakeRelativeRotations(flags, input);
    progress.EndStage(std::to_string(num_views) + " views have an orientation");
  }
  RefuseOtherConventions(flags.relative_rotations.empty() ? flags.input : flags.relative_rotations,
                         input);
  if (!flags.adjust && flags.krot.start.empty() && options.krot.use_bracket) {
    options.krot.start = KrotStart::kBisection;
  }
  // Several cameras are solved as one pinhole, which has no lens to refine.
  if (input.colmap != nullptr && input.colmap->HasSeveralCameras()) {
    options.ba = WithFixedLens(options.ba);
  }
  std::vector<FrameId> given;
  for (const auto& [view, rotation] : input.cam_from_world) given.push_back(view);
  input = WithViewsInOrder(input);
  const RotationPriors priors = PriorsOf(flags, input, options);
  const std::filesystem::path directory = PrepareRunDirectory(flags.out);

  const Solution solution = SolveAtWorkingSize(input, priors, options, flags.adjust, progress);
  const KrotSolution& krot = solution.krot;
  if (!krot.Usable()) throw std::runtime_error(flags.input + ": " + krot.message);
  if (solution.maps.empty()) {
    throw std::runtime_error(
        flags.input + ": bundle adjustment found no usable map" +
        (krot.status == KrotStatus::kContradiction ? "; " + krot.message : std::string()));
  }
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
  const Verdicts verdicts = VerdictsOf(input, krot, solution.maps, flags.adjust);
  WriteRemoved(folder / "removed.csv", input, verdicts);
  WriteResiduals(folder / "residuals.csv", input, solution.maps, solution.refined.camera, verdicts);
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
  if (krot.status == KrotStatus::kContradiction) progress.Warn(krot.message);
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
