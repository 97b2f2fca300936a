#include "apps/slam/orientation_collector.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/build_map.h"
#include "apps/slam/connected_frames.h"
#include "apps/slam/zoom/follow_zooms.h"
#include "apps/slam/zoom/without_zoom.h"

namespace rotslam {
namespace {

// The places of loops that were rejected, and some places before and after them.
std::map<FrameId, Features> PlacesOfRejectedLoops(std::map<FrameId, Features> places,
                                                  const std::vector<LoopCheck>& loops) {
  constexpr int kAround = 3;
  std::set<FrameId> doubtful;
  const auto add_around = [&](FrameId frame) {
    const auto place = places.find(frame);
    if (place == places.end()) return;
    auto from = place;
    for (int k = 0; k < kAround && from != places.begin(); ++k) --from;
    auto to = place;
    for (int k = 0; k <= kAround && to != places.end(); ++k) ++to;
    for (; from != to; ++from) doubtful.insert(from->first);
  };
  for (const LoopCheck& loop : loops) {
    if (loop.accepted) continue;
    add_around(loop.frame);
    add_around(loop.match);
  }
  std::erase_if(places, [&](const auto& place) { return !doubtful.contains(place.first); });
  return places;
}

// Replaces what was tracked on moving things by a camera at rest: every frame is tied to the one
// before by a rotation that is none.
void LetStand(Orientations& orientations) {
  // Static content is found only where it moves by less than a tenth of a reduced pixel.
  constexpr double kSigmaPx = 0.1;
  constexpr int kNumInliers = 100;
  const double sigma_rad = kSigmaPx / orientations.camera.MeanFocal();
  const Eigen::Matrix3d covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  orientations.graph = ViewGraph();
  orientations.edge_matches.clear();
  orientations.loops.clear();
  orientations.places.clear();
  orientations.num_weak = 0;
  orientations.reports.assign(orientations.timestamps_s.size(), FrameReport());
  for (auto& [frame, rotation] : orientations.cam_from_world) {
    rotation = Rotation();
    orientations.covariance[frame] = covariance;
    if (frame.value == 0) continue;
    RelativeRotation edge;
    edge.i = FrameId{frame.value - 1};
    edge.j = frame;
    edge.covariance = covariance;
    edge.num_inliers = kNumInliers;
    edge.rotation_only = true;
    orientations.graph.AddEdge(edge);
  }
}

void TakeResults(LoopedOdometry& odometry, bool keep_features, Orientations& orientations) {
  const std::vector<LoopCheck> last_loops = odometry.Finish();
  orientations.loops.insert(orientations.loops.end(), last_loops.begin(), last_loops.end());
  orientations.num_places = odometry.num_places();
  if (keep_features)
    orientations.places = PlacesOfRejectedLoops(odometry.TakePlaces(), orientations.loops);
  orientations.exposure_s = odometry.exposure_s();
  orientations.seconds = odometry.odometry_seconds();
  orientations.loop_seconds = odometry.loop_seconds();
  orientations.global_averaging_seconds = odometry.averaging_seconds();
  static_cast<OdometryResult&>(orientations) = odometry.TakeResult();
}

// Puts given orientations together with those of the images.
void UseGiven(const OrientationsFromElsewhere& elsewhere, Orientations& orientations) {
  orientations.given = MatchGivenRotations(elsewhere, orientations.timestamps_s, orientations);
  const SensorFusion& fusion = orientations.given->fusion;
  orientations.covariance.clear();
  for (auto& [frame, rotation] : orientations.cam_from_world) {
    rotation = fusion.cam_from_world[frame.value];
    const double variance = fusion.variance[frame.value];
    if (std::isfinite(variance)) {
      orientations.covariance[frame] = variance * Eigen::Matrix3d::Identity();
    }
  }
}

// Sets what follows from all edges together: frames without edges, interpolated frames, breaks.
void ClassifyFrames(const OrientationInputs& inputs,
                    const AveragingOptions& options,
                    Orientations& orientations) {
  for (const auto& [frame, rotation] : orientations.cam_from_world) {
    if (orientations.graph.EdgesOf(frame).empty()) orientations.unconnected.insert(frame);
  }
  if (inputs.given) UseGiven(*inputs.given, orientations);
  InterpolateUnknown(orientations, orientations.unconnected, orientations.cam_from_world);
  orientations.inlier_edges =
      CountInlierEdges(orientations.graph, orientations.cam_from_world, options);
  orientations.breaks = FindBreaks(orientations.graph, orientations.cam_from_world);
  // Given orientations connect what the images do not.
  std::erase_if(orientations.breaks, [&](FrameId frame) {
    return orientations.given && IsBridged(*orientations.given, frame);
  });
}

// Asks the images whether the calibration is theirs; only where features are kept.
void CheckLens(const RelativeRotationOptions& options, Orientations& orientations) {
  const Camera& camera = orientations.camera;
  const std::map<FrameId, Features>& features = orientations.features;
  orientations.fisheye = CheckForFisheye(camera, features, orientations.graph, options);
  orientations.zooms = FindZooms(camera, features, orientations.graph, options);
}

// The map of a part of the frames, for MapOfPart.
std::optional<FramesBeforeZoom> MapBeforeZoom(const OdometryResult& part,
                                              const Camera& camera,
                                              const Orientations& orientations,
                                              const SlamOptions& options) {
  Orientations of_part;
  static_cast<OdometryResult&>(of_part) = part;
  of_part.camera = camera;
  of_part.timestamps_s = orientations.timestamps_s;
  of_part.image_names = orientations.image_names;
  of_part.exposure_s = orientations.exposure_s;
  SlamObserver nobody;
  const MapResult map = BuildMap(of_part, options, nullptr, nobody);
  FramesBeforeZoom before;
  before.camera = map.camera;
  before.moves = !map.rotates_throughout;
  if (!map.failure.empty()) return std::nullopt;
  const int component = map.frame_poses.rbegin()->second.component;
  for (const auto& [frame, pose] : map.frame_poses) {
    const bool is_measured = pose.state == PoseState::kMeasured && pose.component == component;
    if (is_measured || !before.moves) {
      before.poses[frame] = {map.cam_from_world.at(frame), map.center_in_world.at(frame)};
    }
  }
  return before;
}

// Follows the zooms that were found, where the images allow it.
void Follow(const SlamOptions& options, Orientations& orientations) {
  if (orientations.zooms.empty() || orientations.given) return;
  auto followed = FollowZooms(orientations,
                              orientations.camera,
                              orientations.zooms,
                              [&](const OdometryResult& part, const Camera& camera) {
                                return MapBeforeZoom(part, camera, orientations, options);
                              },
                              {options.rotodom, options.seed, options.num_threads});
  if (!followed) return;
  static_cast<OdometryResult&>(orientations) = std::move(followed->odometry);
  orientations.camera = followed->camera;
  orientations.zooms = std::move(followed->zooms);
  orientations.focal_scales = std::move(followed->scales);
  TakeZoomOut(orientations.camera, orientations.focal_scales, orientations.places);
  orientations.inlier_edges =
      CountInlierEdges(orientations.graph, orientations.cam_from_world, options.rotodom.averaging);
  orientations.breaks = FindBreaks(orientations.graph, orientations.cam_from_world);
}

Orientations StartWith(const FoundInImages& known,
                       const Camera& camera,
                       const OrientationInputs& inputs) {
  Orientations orientations;
  orientations.readout = known.readout;
  orientations.camera = known.readout ? WithReadout(camera, *known.readout) : camera;
  orientations.static_content = known.static_content;
  orientations.masks = inputs.masks;
  orientations.masks.AddToAll(known.static_content.mask);
  return orientations;
}

}  // namespace

OrientationCollector::OrientationCollector(const FoundInImages& known,
                                           const Camera& camera,
                                           const SlamOptions& options,
                                           const OrientationInputs& inputs)
    : options_(options),
      inputs_(inputs),
      known_(known),
      orientations_(StartWith(known, camera, inputs)),
      odometry_(orientations_.camera,
                {options.rotodom,
                 options.loop,
                 inputs.vocabulary,
                 inputs.keep_features,
                 options.seed,
                 options.num_threads}),
      readout_(orientations_.camera, options),
      static_content_(inputs_.find_static_content, known_.static_content, inputs_.masks.common()) {}

TrackedFrame OrientationCollector::Track(Frame frame) {
  return TrackFrame(std::move(frame), masks(), tools(), nullptr);
}

std::optional<FoundInImages> OrientationCollector::Take(TrackedFrame&& tracked,
                                                        SlamObserver& observer) {
  auto& [frame, thumbnail, estimate] = tracked;
  orientations_.num_unreadable += frame.problem.empty() ? 0 : 1;
  orientations_.timestamps_s.push_back(frame.timestamp_s);
  orientations_.image_names.push_back(frame.name);
  orientations_.thumbnails.push_back(std::move(thumbnail));
  orientations_.num_weak += estimate.report.weak;
  orientations_.reports.push_back(estimate.report);
  orientations_.loops.insert(
      orientations_.loops.end(), estimate.loops.begin(), estimate.loops.end());
  observer.OnFrame({frame, estimate, odometry_.result()});
  // What is static on the picture spoils the estimate of the readout.
  StaticContent content = static_content_.Decide(odometry_.result().cam_from_world);
  if (!content.mask.IsEmpty()) return FoundInImages{std::nullopt, std::move(content)};
  readout_.Add(frame.id, std::move(estimate.points), odometry_.result());
  if (readout_.found()) return FoundInImages{readout_.found(), {}};
  orientations_.interrupted = observer.ShouldStop();
  return std::nullopt;
}

std::optional<FoundInImages> OrientationCollector::EndFrames() {
  StaticContent content = static_content_.Finish(odometry_.result().cam_from_world);
  if (content.kind == StaticContentKind::kStanding) {
    orientations_.static_content = std::move(content);
    return std::nullopt;
  }
  if (!content.mask.IsEmpty()) return FoundInImages{std::nullopt, std::move(content)};
  readout_.Finish(odometry_.result());
  if (readout_.found()) return FoundInImages{readout_.found(), {}};
  return std::nullopt;
}

Orientations OrientationCollector::Finish(SlamObserver& observer,
                                          const std::function<void()>& commit) {
  TakeResults(odometry_, inputs_.keep_features, orientations_);
  if (orientations_.CameraStands()) {
    observer.OnStaticContent(orientations_.static_content);
    LetStand(orientations_);
  }
  if (orientations_.interrupted && !orientations_.IsUsable()) return std::move(orientations_);
  RequireFramesAndEdges(orientations_);
  if (commit) commit();
  ClassifyFrames(inputs_, options_.rotodom.averaging, orientations_);
  if (inputs_.check_lens) CheckLens(options_.rotodom.relative_rotation, orientations_);
  if (inputs_.follow_zooms) Follow(options_, orientations_);
  observer.OnEnd(SlamStage::kOrientations, orientations_);
  return std::move(orientations_);
}

namespace {

void TellOfRestart(const FoundInImages& found, SlamObserver& observer, FrameLog* log) {
  if (found.readout) observer.OnReadoutFound(*found.readout);
  if (!found.static_content.mask.IsEmpty()) observer.OnStaticContent(found.static_content);
  if (log == nullptr) return;
  FoundInImages all = log->found();
  if (found.readout) all.readout = found.readout;
  if (!found.static_content.mask.IsEmpty()) all = found;
  log->StartOver(all);
}

// FindOrientations with the properties of camera and picture that are known by now: given, found in
// the images, or found by the interrupted run. Six parameters: its own, and these.
Orientations FindWith(const FoundInImages& known,
                      FrameSource& frames,
                      const Camera& camera,
                      const SlamOptions& options,
                      const OrientationInputs& inputs,
                      SlamObserver& observer) {
  OrientationCollector collector(known, camera, options, inputs);
  observer.OnBegin(SlamStage::kOrientations, frames.NumFrames());
  FrameStream stream(frames, collector.masks(), collector.tools(), inputs.log);
  std::optional<FoundInImages> found;
  bool has_ended = false;
  while (!found && !has_ended && !collector.is_interrupted()) {
    std::optional<TrackedFrame> frame = stream.Next(collector.NeedsPoints());
    has_ended = !frame;
    found = has_ended ? collector.EndFrames() : collector.Take(*std::move(frame), observer);
  }
  if (found) {
    TellOfRestart(*found, observer, inputs.log);
    frames.Rewind();
    FoundInImages all = *std::move(found);
    if (all.static_content.mask.IsEmpty()) all.static_content = known.static_content;
    return FindWith(all, frames, camera, options, inputs, observer);
  }
  return collector.Finish(observer, [&] { stream.Commit(); });
}

}  // namespace

Orientations FindOrientations(FrameSource& frames,
                              const Camera& camera,
                              const SlamOptions& options,
                              const OrientationInputs& inputs,
                              SlamObserver& observer) {
  FoundInImages known{std::nullopt, inputs.static_content};
  if (inputs.log != nullptr) {
    known.readout = inputs.log->found().readout;
    if (known.static_content.mask.IsEmpty()) {
      known.static_content = inputs.log->found().static_content;
    }
  }
  return FindWith(known, frames, camera, options, inputs, observer);
}

}  // namespace rotslam
