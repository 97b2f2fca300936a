#include "apps/slam/positions.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <iterator>
#include <set>
#include <utility>

#include "apps/slam/component_alignment.h"
#include "apps/slam/frame_registration.h"
#include "apps/slam/map_correction.h"
#include "apps/slam/map_views.h"
#include "apps/slam/pure_rotation.h"
#include "output/map/cloud_outliers.h"
#include "rotodom/averaging/anchors.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/track_completion/track_completion.h"

namespace rotslam {
namespace {

std::set<FrameId> AllFrames(const RotationMap& rotations) {
  std::set<FrameId> frames;
  for (const auto& [frame, rotation] : rotations) frames.insert(frame);
  return frames;
}

std::map<FrameId, PoseCovariance> Moved(std::map<FrameId, PoseCovariance> covariances,
                                        const Similarity& similarity) {
  PoseCovariance J = PoseCovariance::Identity();
  J.bottomRightCorner<3, 3>() = similarity.scale * similarity.turn.Matrix();
  for (auto& [frame, covariance] : covariances) covariance = J * covariance * J.transpose();
  return covariances;
}

void Append(Reconstruction& map, Reconstruction part) {
  map.cam_from_world.insert(part.cam_from_world.begin(), part.cam_from_world.end());
  map.center_in_world.insert(part.center_in_world.begin(), part.center_in_world.end());
  map.point_in_world.insert(part.point_in_world.begin(), part.point_in_world.end());
  std::move(part.tracks.begin(), part.tracks.end(), std::back_inserter(map.tracks));
}

// Points of all tracks, not only the keyframes', from the poses of all frames.
Reconstruction MakeCloudOf(const PositionResult& result,
                           const std::vector<Track>& all_tracks,
                           int num_threads,
                           BundleOptions options) {
  options.num_threads = num_threads;
  BundleProblem problem;
  problem.camera = result.camera;
  problem.start.cam_from_world = result.cam_from_world;
  problem.start.center_in_world = result.center_in_world;
  problem.start.point_in_world = result.map.point_in_world;
  problem.start.tracks = all_tracks;
  std::erase_if(problem.start.tracks, [&](const Track& track) {
    return static_cast<int>(track.observations.size()) < options.min_observations;
  });
  for (const PureRotationSegment& stretch : result.held) {
    for (const auto& [frame, rotation] : result.cam_from_world) {
      if (stretch.first < frame && frame <= stretch.last)
        problem.shared_center[frame] = stretch.first;
    }
  }
  return TriangulateTracks(problem, options);
}

void TellCloud(const PositionResult& result, double min_angle_deg, Progress& progress) {
  const int num_points = static_cast<int>(result.cloud.point_in_world.size());
  std::array<char, 160> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%d points; %d seen under less than %g deg and %d that stood alone left out",
                num_points,
                result.num_shallow_points,
                min_angle_deg,
                result.num_cloud_outliers);
  progress.EndStage(text.data());
  const int num_all = num_points + result.num_shallow_points + result.num_cloud_outliers;
  if (num_points > 0 && 2 * num_points >= num_all) return;
  progress.Warn("the cloud holds " + std::to_string(num_points) + " of " + std::to_string(num_all) +
                " points: the camera has moved too little for more");
}

void TellRelocalised(const std::set<FrameId>& frames, Progress& progress) {
  constexpr std::size_t kMaxNamed = 12;
  if (frames.empty()) return;
  std::string names;
  std::size_t count = 0;
  for (const FrameId frame : frames) {
    if (count++ < kMaxNamed) names += " " + std::to_string(frame.value);
  }
  if (count > kMaxNamed) names += " and " + std::to_string(count - kMaxNamed) + " more";
  progress.Say("keyframes found again in another place of the map:" + names);
}

// No map: every frame stands at the origin.
PositionResult WithoutMap(PositionResult result, std::string failure) {
  for (const auto& [frame, rotation] : result.cam_from_world) {
    result.center_in_world[frame] = Eigen::Vector3d::Zero();
  }
  result.failure = std::move(failure);
  return result;
}

// The whole sequence as one turn in place, nothing of a map left.
PositionResult PureRotationThroughout(const PositionResult& moving,
                                      const PureRotationResult& turning,
                                      const Orientations& orientations,
                                      const AveragingOptions& options) {
  PositionResult result;
  result.cam_from_world = FollowAnchors(
      orientations.graph, orientations.cam_from_world, turning.cam_from_world, options);
  InterpolateUnknown(orientations, orientations.unconnected, result.cam_from_world);
  result.camera = turning.camera;
  result.keyframes = moving.keyframes;
  result.keyframe_tracks = moving.keyframe_tracks;
  result.held.push_back(
      {result.cam_from_world.begin()->first,
       result.cam_from_world.rbegin()->first,
       static_cast<double>(turning.num_observations) / NumObservations(result.keyframe_tracks)});
  result.is_held_throughout = true;
  return WithoutMap(std::move(result), {});
}

RotationRates RatesOf(const Orientations& orientations) {
  return RatesOf(orientations.cam_from_world,
                 [&](FrameId frame) { return orientations.timestamps_s[frame.value]; });
}

std::vector<Track> TracksOf(const Orientations& orientations,
                            const Camera& camera,
                            double blur_s_per_px) {
  std::vector<Track> tracks = BuildTracks(
      orientations.edge_matches, orientations.features, AllFrames(orientations.cam_from_world), 2);
  SetMotionBlur(camera, RatesOf(orientations), blur_s_per_px, tracks);
  return tracks;
}

// Reads images of frames of the map again.
using ViewReader =
    std::function<MapViews(const Reconstruction& map, const std::set<FrameId>& frames)>;

ViewReader ReaderOf(const Input& input,
                    const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const PipelineOptions& options,
                    int num_threads,
                    Progress& progress) {
  return [&, num_threads](const Reconstruction& map, const std::set<FrameId>& frames) {
    MapViews views =
        ReadMapViews(input.path, options.sequence, frames, [&](const std::string& problem) {
          progress.Warn(problem +
                        "; points are not looked for in images that cannot be read again");
        });
    SetMotions(
        {orientations, all_tracks, input.camera, options.resection, num_threads}, map, views);
    return views;
  };
}

// Completes tracks with the images of the map's frames; null where that is not asked for.
// @param read  may be null.
TrackCompletion CompletionWith(const ViewReader& read,
                               const Orientations& orientations,
                               const PipelineOptions& options,
                               int num_threads) {
  if (!options.completion.enabled || !read) return nullptr;
  return [&, num_threads](const Reconstruction& map, const Camera& camera) {
    std::set<FrameId> frames;
    for (const auto& [frame, center] : map.center_in_world) frames.insert(frame);
    std::vector<Track> tracks =
        CompleteTracks(map, read(map, frames), camera, options.completion, num_threads);
    SetMotionBlur(camera, RatesOf(orientations), options.ba.blur_s_per_px, tracks);
    return tracks;
  };
}

// Describes frames by their images; null where these are not to be had.
FrameDescription DescriptionWith(const ViewReader& read,
                                 const Camera& camera,
                                 const FeatureOptions& options,
                                 int num_threads) {
  if (!read) return nullptr;
  return [&, num_threads](const Reconstruction& map, const std::set<FrameId>& frames) {
    return DescribeViews(read(map, frames), camera, options, num_threads);
  };
}

// Frames whose tracks show too few points of the maps to place them by; in a segment their places
// are known.
std::set<FrameId> FramesApart(const std::vector<Track>& all_tracks,
                              const RefinedComponents& refined,
                              const PositionResult& result,
                              int min_points) {
  std::set<TrackId> known;
  for (const BundleResult& bundle : refined.bundles) {
    for (const auto& [track, point] : bundle.reconstruction.point_in_world) known.insert(track);
  }
  std::map<FrameId, int> num_points;
  for (const Track& track : all_tracks) {
    if (!known.contains(track.id)) continue;
    for (const Observation& observation : track.observations) ++num_points[observation.frame];
  }
  std::set<FrameId> apart;
  for (const auto& [frame, rotation] : result.cam_from_world) {
    if (num_points[frame] < min_points && SegmentAt(result.held, frame) == nullptr) {
      apart.insert(frame);
    }
  }
  return apart;
}

// FindKeyframePositions from the tracks of all frames.
// @param read  may be null.
PositionResult MapKeyframes(const Orientations& orientations,
                            const std::vector<Track>& all_tracks,
                            const Camera& camera,
                            const ViewReader& read,
                            const PipelineOptions& options,
                            int num_threads,
                            Progress& progress) {
  PositionResult result;
  result.cam_from_world = orientations.cam_from_world;
  result.camera = camera;

  result.held = FindPureRotationSegments(
      orientations.graph, result.cam_from_world, options.pure_rotation_segments);
  BundleOptions bundle_options = options.ba;
  bundle_options.num_threads = num_threads;
  const PureRotationSegment* everything =
      SegmentAt(result.held, result.cam_from_world.begin()->first);
  const bool stays =
      everything != nullptr && everything->last == result.cam_from_world.rbegin()->first;
  const auto num_held = result.held.size();
  if (!stays) {
    result.held =
        WithoutOffAxisRotations(std::move(result.held),
                                {camera, orientations.graph, result.cam_from_world, all_tracks},
                                options.rotodom.relative_rotation,
                                bundle_options);
  }
  const bool is_off_axis = result.held.size() < num_held;
  // Of a camera that stays in its place a turn tells the focal length.
  const bool seeks_focal = stays && options.ba.lens.refine_focal;
  result.keyframes = SelectKeyframes(result.cam_from_world,
                                     all_tracks,
                                     seeks_focal ? std::vector<PureRotationSegment>() : result.held,
                                     options.keyframes);
  result.keyframe_tracks = RestrictTracks(all_tracks, result.keyframes, 3);
  const std::vector<Track>& tracks = result.keyframe_tracks;
  progress.EndStage(std::to_string(result.keyframes.size()) + " keyframes, " +
                    std::to_string(tracks.size()) + " tracks, " +
                    std::to_string(result.held.size()) + " pure-rotation stretch" +
                    (result.held.size() == 1 ? "" : "es"));
  RotationMap keyframe_rotations;
  for (const FrameId frame : result.keyframes)
    keyframe_rotations[frame] = result.cam_from_world.at(frame);
  const auto detect_pure_rotation = [&]() -> std::optional<PositionResult> {
    // Of a turn off the axis of rotation another lens explains most, too.
    if (!options.pure_rotation_segments.enabled || is_off_axis) return std::nullopt;
    progress.StartStage("turning in place", -1);
    const auto turning = DetectPureRotation(
        camera, keyframe_rotations, tracks, ExplanationBy(result.bundles), bundle_options);
    if (!turning || !PairsAllowPureRotation(orientations.graph,
                                            WithBearingsOf(turning->camera, all_tracks),
                                            turning->camera.MeanFocal(),
                                            options.rotodom.relative_rotation)) {
      return std::nullopt;
    }
    progress.EndStage("explains " + std::to_string(turning->num_observations) + " observations, " +
                      DescribeRounded(turning->camera));
    return PureRotationThroughout(result, *turning, orientations, options.rotodom.averaging);
  };
  if (stays) {
    if (seeks_focal) {
      if (auto turning = detect_pure_rotation()) return *std::move(turning);
    }
    result.is_held_throughout = true;
    return WithoutMap(std::move(result), {});
  }

  progress.StartStage("known rotation", -1);
  KrotOptions krot_options = options.krot;
  krot_options.num_threads = num_threads;
  result.krot = SolveKnownRotation(
      keyframe_rotations, tracks, camera, krot_options, OrientationSigmas(orientations));
  progress.EndStage(result.krot.message);
  if (!result.krot.Usable()) {
    if (auto turning = detect_pure_rotation()) return *std::move(turning);
    std::string failure = result.krot.message;
    if (tracks.empty()) {
      failure += "; the camera moves too little in these " +
                 std::to_string(result.cam_from_world.size()) + " frames, give more of them";
    }
    return WithoutMap(std::move(result), std::move(failure));
  }

  progress.StartStage("bundle adjustment", -1);
  const TrackCompletion complete = CompletionWith(read, orientations, options, num_threads);
  RefinedComponents refined = RefineComponents(
      keyframe_rotations, result.krot, tracks, result.held, camera, bundle_options, complete);
  if (options.relocalisation.enabled) {
    MapCorrectionSources sources;
    for (const LoopCheck& check : orientations.loops) {
      sources.lookalikes.push_back({check.frame, check.match});
    }
    sources.places = orientations.places;
    sources.apart = FramesApart(all_tracks, refined, result, options.resection.min_inliers);
    sources.describe = DescriptionWith(read, refined.camera, options.rotodom.features, num_threads);
    sources.complete = complete;
    sources.held = result.held;
    result.relocalised = CorrectMaps(std::move(sources),
                                     camera,
                                     tracks,
                                     options.relocalisation,
                                     options.krot.seed,
                                     bundle_options,
                                     refined);
    result.keyframes.insert(result.relocalised.begin(), result.relocalised.end());
  }
  result.camera = refined.camera;
  for (std::size_t k = 0; k < refined.components.size(); ++k) {
    MapComponent& component = refined.components[k];
    BundleResult& bundle = refined.bundles[k];
    if (!bundle.Usable() || bundle.reconstruction.center_in_world.size() < 2) continue;
    if (!result.components.empty()) {
      component.placed_by_default = true;
      const Similarity placed = AlignComponent(result.map,
                                               bundle.reconstruction,
                                               {result.cam_from_world,
                                                orientations.timestamps_s,
                                                result.held,
                                                all_tracks,
                                                result.camera,
                                                options.resection,
                                                num_threads});
      bundle.reconstruction = Moved(bundle.reconstruction, placed);
      bundle.pose_covariance = Moved(std::move(bundle.pose_covariance), placed);
    }
    result.pose_covariance.merge(bundle.pose_covariance);
    Append(result.map, std::move(bundle.reconstruction));
    result.bundles.push_back(std::move(bundle.summary));
    result.components.push_back(std::move(component));
    result.cam_from_world = FollowAnchors(orientations.graph,
                                          result.cam_from_world,
                                          result.map.cam_from_world,
                                          options.rotodom.averaging);
  }
  if (result.components.empty()) {
    if (auto turning = detect_pure_rotation()) return *std::move(turning);
    return WithoutMap(std::move(result), "bundle adjustment found no usable map");
  }
  progress.EndStage(std::to_string(result.map.point_in_world.size()) + " points, " +
                    DescribeMeanError(result.bundles) + ", " + DescribeRounded(result.camera));
  TellRelocalised(result.relocalised, progress);
  if (auto turning = detect_pure_rotation()) return *std::move(turning);

  return result;
}

}  // namespace

PositionResult FindKeyframePositions(const Orientations& orientations,
                                     const Camera& camera,
                                     const PipelineOptions& options,
                                     int num_threads,
                                     Progress& progress) {
  progress.StartStage("tracks", -1);
  return MapKeyframes(orientations,
                      TracksOf(orientations, camera, options.ba.blur_s_per_px),
                      camera,
                      nullptr,
                      options,
                      num_threads,
                      progress);
}

PositionResult FindPositions(const Input& input,
                             const Orientations& orientations,
                             const PipelineOptions& options,
                             int num_threads,
                             Progress& progress) {
  progress.StartStage("tracks", -1);
  std::vector<Track> all_tracks = TracksOf(orientations, input.camera, options.ba.blur_s_per_px);
  PositionResult result =
      MapKeyframes(orientations,
                   all_tracks,
                   input.camera,
                   ReaderOf(input, orientations, all_tracks, options, num_threads, progress),
                   options,
                   num_threads,
                   progress);
  if (result.components.empty()) return result;

  progress.StartStage("frames between keyframes", -1);
  all_tracks = WithBearingsOf(result.camera, std::move(all_tracks));
  RegisterFrames(orientations, all_tracks, options, num_threads, result);
  // Their neighbours have moved a little since.
  std::set<FrameId> unknown = orientations.unconnected;
  std::erase_if(unknown, [&](FrameId frame) { return result.map.cam_from_world.contains(frame); });
  InterpolateUnknown(orientations, unknown, result.cam_from_world);
  progress.EndStage(std::to_string(result.num_resected) + " resected, " +
                    std::to_string(result.num_interpolated) + " interpolated");

  progress.StartStage("cloud", -1);
  const Reconstruction all_points = MakeCloudOf(result, all_tracks, num_threads, options.ba);
  result.cloud = WithoutShallowPoints(all_points, options.cloud_min_angle_deg);
  result.num_shallow_points =
      static_cast<int>(all_points.point_in_world.size() - result.cloud.point_in_world.size());
  const PointMap rest = WithoutOutliers(result.cloud.point_in_world, options.cloud_outliers);
  result.num_cloud_outliers = static_cast<int>(result.cloud.point_in_world.size() - rest.size());
  result.cloud.point_in_world = rest;
  std::erase_if(result.cloud.tracks, [&](const Track& track) { return !rest.contains(track.id); });
  TellCloud(result, options.cloud_min_angle_deg, progress);
  return result;
}

Trajectory MakeTrajectory(const std::vector<double>& timestamps_s,
                          const RotationMap& cam_from_world,
                          const CenterMap& centers) {
  Trajectory trajectory;
  for (const auto& [frame, center] : centers) {
    trajectory.push_back({timestamps_s[frame.value], cam_from_world.at(frame).Inverse(), center});
  }
  return trajectory;
}

}  // namespace rotslam
