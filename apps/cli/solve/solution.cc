#include "apps/cli/solve/solution.h"

#include <algorithm>
#include <set>
#include <utility>

#include "apps/slam/working_size/original_size.h"
#include "apps/slam/working_size/working_size.h"
#include "rotodom/types/track.h"

namespace rotslam {
namespace {

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
// Six parameters: those of known rotation and its solution.
RefinedComponents Adjust(const KnownRotationInput& input,
                         const RotationPriors& priors,
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

}  // namespace

Solution SolveAtWorkingSize(const KnownRotationInput& input,
                            const RotationPriors& priors,
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

}  // namespace rotslam
