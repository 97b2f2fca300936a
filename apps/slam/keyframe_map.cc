#include "apps/slam/keyframe_map.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include "apps/slam/map/calibration_check.h"
#include "apps/slam/map/component_alignment.h"
#include "apps/slam/map/pure_rotation_decision.h"
#include "apps/slam/map/stated_sigmas.h"
#include "apps/slam/map_correction/map_correction.h"
#include "apps/slam/map_views.h"
#include "ba/bundle_adjustment.h"
#include "rotodom/averaging/anchors.h"
#include "rotodom/motion_blur/keypoint_blur.h"

namespace rotslam {
namespace {

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

// The result without a map: every frame is at the origin.
MapResult WithoutMap(MapResult result, std::string failure) {
  for (const auto& [frame, rotation] : result.cam_from_world) {
    result.center_in_world[frame] = Eigen::Vector3d::Zero();
  }
  result.failure = std::move(failure);
  return result;
}

// The result of a pure rotation throughout: one segment, every frame at the origin, no points.
MapResult PureRotationThroughout(const MapResult& moving,
                                 const PureRotationResult& rotation,
                                 const Orientations& orientations,
                                 const SlamOptions& options) {
  MapResult result;
  if (auto seen = ThroughFoundLens(orientations, rotation.camera, options)) {
    result.through_lens = {std::move(seen->graph), std::move(seen->cam_from_world)};
  }
  result.cam_from_world = FollowAnchors(
      result.through_lens ? result.through_lens->graph : orientations.graph,
      result.through_lens ? result.through_lens->cam_from_world : orientations.cam_from_world,
      rotation.cam_from_world,
      options.rotodom.averaging);
  InterpolateUnknown(orientations, orientations.unconnected, result.cam_from_world);
  result.camera = rotation.camera;
  result.lens_sigmas = StatedSigmas(rotation.lens_sigmas, options.ba.lens, result.camera);
  if (rotation.lens_covariance) {
    result.lens_covariance = StatedCovariance(*rotation.lens_covariance, options.ba.lens);
  }
  result.keyframes = moving.keyframes;
  result.keyframe_tracks = moving.keyframe_tracks;
  result.num_rotation_observations = rotation.num_observations;
  result.segments.push_back(
      {result.cam_from_world.begin()->first,
       result.cam_from_world.rbegin()->first,
       static_cast<double>(rotation.num_observations) / NumObservations(result.keyframe_tracks)});
  result.rotates_throughout = true;
  return WithoutMap(std::move(result), {});
}

// Whether the camera is at rest but for the tremor of the hand that holds it: pairs of frames show
// little parallax, also those far apart, which tracks from the keyframes connect.
bool HardlyMoves(const ViewGraph& graph, double focal_px) {
  // A hand moves by some millimetres, 9 mm at a distance of 1 m.
  constexpr double kTremor = 0.5 * kRadFromDeg;
  // Of the edges; the others may be those on things that move.
  constexpr double kShare = 0.9;
  const auto num_still =
      std::count_if(graph.edges().begin(), graph.edges().end(), [&](const RelativeRotation& edge) {
        return edge.rotation_only || edge.parallax_px <= kTremor * focal_px;
      });
  return static_cast<double>(num_still) >= kShare * static_cast<double>(graph.edges().size());
}

// Frames whose tracks see too few points of the maps for resection. Frames of pure-rotation
// segments are left out, since their positions are known.
std::set<FrameId> UnregisteredFrames(const std::vector<Track>& all_tracks,
                                     const RefinedComponents& refined,
                                     const MapResult& result,
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
    if (num_points[frame] < min_points && SegmentAt(result.segments, frame) == nullptr) {
      apart.insert(frame);
    }
  }
  return apart;
}

// The steps from orientations to the map of the keyframes, in their order. Each step writes its
// result to `result_`.
class KeyframeMapBuilder {
 public:
  KeyframeMapBuilder(const Orientations& orientations,
                     const std::vector<Track>& all_tracks,
                     const SlamOptions& options,
                     ImageProvider* images,
                     SlamObserver& observer);

  MapResult Build();

 private:
  void FindPureRotationSegments();
  void SelectKeyframes();
  void SolveKnownRotation();
  void AdjustComponents();
  void CorrectMaps();
  void CheckCalibration();
  void AlignComponents();
  std::optional<MapResult> PureRotationExplainsMore() const;

  // Whether, by the relative rotations of pairs of views, the camera is at rest or only rotates
  // from the first frame to the last. Such a rotation determines the focal length.
  bool StaysThroughout() const;
  // Whether the reason that there is no map is a camera that moves too little for one.
  bool HardlyMovesThroughout() const;
  // The result of such a camera: one segment, orientations alone.
  MapResult AtRest();
  const BundleResult* LargestBundle() const;
  void StateSigmas();
  bool SeeksFocalLength() const {
    return StaysThroughout() && options_.ba.lens.refine_focal && !orientations_.CameraStands();
  }

  MapViews ReadViews(const Reconstruction& map, const std::set<FrameId>& frames) const;
  TrackCompletion CompletionByImages() const;
  FrameDescription DescriptionByImages(const Camera& camera) const;

  const Orientations& orientations_;
  const std::vector<Track>& all_tracks_;
  const SlamOptions& options_;
  ImageProvider* images_;
  SlamObserver& observer_;
  BundleOptions bundle_options_;
  TrackCompletion complete_;
  RotationMap keyframe_rotations_;
  RefinedComponents refined_;
  bool has_off_axis_rotations_ = false;  // a pure rotation with another lens would fit these, too
  MapResult result_;
};

KeyframeMapBuilder::KeyframeMapBuilder(const Orientations& orientations,
                                       const std::vector<Track>& all_tracks,
                                       const SlamOptions& options,
                                       ImageProvider* images,
                                       SlamObserver& observer)
    : orientations_(orientations),
      all_tracks_(all_tracks),
      options_(options),
      images_(images),
      observer_(observer),
      bundle_options_(options.ba),
      complete_(CompletionByImages()) {
  bundle_options_.num_threads = options.num_threads;
  bundle_options_.find_lens_covariance = true;
  result_.cam_from_world = orientations.cam_from_world;
  result_.camera = orientations.camera;
  result_.lens_sigmas = StatedSigmas(std::nullopt, bundle_options_.lens, result_.camera);
}

MapResult KeyframeMapBuilder::Build() {
  FindPureRotationSegments();
  SelectKeyframes();
  observer_.OnEnd(SlamStage::kTracks, result_);
  if (StaysThroughout()) {
    if (SeeksFocalLength()) {
      if (auto rotation = PureRotationExplainsMore()) return *std::move(rotation);
    }
    result_.rotates_throughout = true;
    return WithoutMap(std::move(result_), {});
  }

  SolveKnownRotation();
  if (!result_.krot.Usable()) {
    if (auto rotation = PureRotationExplainsMore()) return *std::move(rotation);
    if (HardlyMovesThroughout()) return AtRest();
    std::string failure = result_.krot.message;
    if (result_.keyframe_tracks.empty()) {
      failure += "; the camera moves too little in these " +
                 std::to_string(result_.cam_from_world.size()) + " frames, give more of them";
    }
    return WithoutMap(std::move(result_), std::move(failure));
  }

  observer_.OnBegin(SlamStage::kBundleAdjustment, -1);
  AdjustComponents();
  CorrectMaps();
  StateSigmas();
  CheckCalibration();
  result_.final_bracket = BracketComponents(refined_, options_.krot);
  AlignComponents();
  if (result_.components.empty()) {
    if (auto rotation = PureRotationExplainsMore()) return *std::move(rotation);
    if (HardlyMovesThroughout()) return AtRest();
    return WithoutMap(std::move(result_), "bundle adjustment found no usable map");
  }
  observer_.OnEnd(SlamStage::kBundleAdjustment, result_);
  if (auto rotation = PureRotationExplainsMore()) return *std::move(rotation);
  return std::move(result_);
}

bool KeyframeMapBuilder::HardlyMovesThroughout() const {
  return options_.pure_rotation_segments.enabled && orientations_.breaks.empty() &&
         HardlyMoves(orientations_.graph, orientations_.camera.MeanFocal());
}

MapResult KeyframeMapBuilder::AtRest() {
  MapResult result;
  result.cam_from_world = orientations_.cam_from_world;
  result.camera = orientations_.camera;
  result.lens_sigmas = StatedSigmas(std::nullopt, bundle_options_.lens, result.camera);
  result.keyframes = std::move(result_.keyframes);
  result.keyframe_tracks = std::move(result_.keyframe_tracks);
  result.segments = {AllFramesAsSegment(
      orientations_.graph, result.cam_from_world, options_.pure_rotation_segments)};
  result.rotates_throughout = true;
  return WithoutMap(std::move(result), {});
}

bool KeyframeMapBuilder::StaysThroughout() const {
  const PureRotationSegment* everything =
      SegmentAt(result_.segments, result_.cam_from_world.begin()->first);
  return everything != nullptr && everything->last == result_.cam_from_world.rbegin()->first;
}

void KeyframeMapBuilder::FindPureRotationSegments() {
  result_.segments = rotslam::FindPureRotationSegments(
      orientations_.graph, result_.cam_from_world, options_.pure_rotation_segments);
  if (StaysThroughout()) return;
  const auto num_segments = result_.segments.size();
  result_.segments = WithoutOffAxisRotations(
      std::move(result_.segments),
      {orientations_.camera, orientations_.graph, result_.cam_from_world, all_tracks_},
      options_.rotodom.relative_rotation,
      bundle_options_);
  has_off_axis_rotations_ = result_.segments.size() < num_segments;
}

void KeyframeMapBuilder::SelectKeyframes() {
  result_.keyframes = rotslam::SelectKeyframes(
      result_.cam_from_world,
      all_tracks_,
      SeeksFocalLength() ? std::vector<PureRotationSegment>() : result_.segments,
      options_.keyframes);
  result_.keyframe_tracks = RestrictTracks(all_tracks_, result_.keyframes, 3);
  for (const FrameId frame : result_.keyframes) {
    keyframe_rotations_[frame] = result_.cam_from_world.at(frame);
  }
}

void KeyframeMapBuilder::SolveKnownRotation() {
  observer_.OnBegin(SlamStage::kKnownRotation, -1);
  KrotOptions options = options_.krot;
  options.num_threads = options_.num_threads;
  options.seed = options_.seed;
  result_.krot = rotslam::SolveKnownRotation(keyframe_rotations_,
                                             result_.keyframe_tracks,
                                             orientations_.camera,
                                             options,
                                             OrientationSigmas(orientations_));
  observer_.OnEnd(SlamStage::kKnownRotation, result_);
}

void KeyframeMapBuilder::AdjustComponents() {
  refined_ = RefineComponents({keyframe_rotations_,
                               result_.krot.center_in_world,
                               result_.keyframe_tracks,
                               result_.segments,
                               SensorPriors(orientations_, result_.keyframes)},
                              result_.krot.component,
                              orientations_.camera,
                              bundle_options_,
                              complete_);
  result_.camera = refined_.camera;
}

void KeyframeMapBuilder::CorrectMaps() {
  if (!options_.relocalisation.enabled) return;
  MapCorrectionSources sources;
  sources.calibrated = orientations_.camera;
  sources.tracks = result_.keyframe_tracks;
  sources.seed = options_.seed;
  for (const LoopCheck& check : orientations_.loops) {
    sources.lookalikes.push_back({check.frame, check.match});
  }
  sources.places = orientations_.places;
  sources.unregistered =
      UnregisteredFrames(all_tracks_, refined_, result_, options_.resection.min_inliers);
  sources.describe = DescriptionByImages(refined_.camera);
  sources.complete = complete_;
  sources.segments = result_.segments;
  result_.relocalised =
      rotslam::CorrectMaps(std::move(sources), options_.relocalisation, bundle_options_, refined_);
  result_.keyframes.insert(result_.relocalised.begin(), result_.relocalised.end());
  result_.camera = refined_.camera;
}

// The component that has refined the lens; null: none.
const BundleResult* KeyframeMapBuilder::LargestBundle() const {
  const auto largest =
      std::max_element(refined_.bundles.begin(),
                       refined_.bundles.end(),
                       [](const BundleResult& a, const BundleResult& b) {
                         return a.summary.num_observations < b.summary.num_observations;
                       });
  return largest == refined_.bundles.end() || !largest->Usable() ? nullptr : &*largest;
}

void KeyframeMapBuilder::StateSigmas() {
  const BundleResult* largest = LargestBundle();
  if (largest == nullptr) return;
  result_.lens_sigmas =
      StatedSigmas(largest->summary.lens_sigmas, bundle_options_.lens, result_.camera);
  if (largest->summary.lens_covariance) {
    result_.lens_covariance =
        StatedCovariance(*largest->summary.lens_covariance, bundle_options_.lens);
  }
}

// Not of a lens that is estimated.
void KeyframeMapBuilder::CheckCalibration() {
  if (bundle_options_.lens.expected) return;
  const BundleResult* largest = LargestBundle();
  if (largest == nullptr) return;
  std::set<FrameId> frames;
  for (const auto& [frame, center] : largest->reconstruction.center_in_world) frames.insert(frame);
  result_.calibration_check = rotslam::CheckCalibration(
      largest->reconstruction,
      WithBearingsOf(largest->camera, RestrictTracks(result_.keyframe_tracks, frames, 3)),
      largest->camera,
      bundle_options_);
}

void KeyframeMapBuilder::AlignComponents() {
  for (std::size_t k = 0; k < refined_.components.size(); ++k) {
    MapComponent& component = refined_.components[k];
    BundleResult& bundle = refined_.bundles[k];
    if (!bundle.Usable() || bundle.reconstruction.center_in_world.size() < 2) continue;
    if (!result_.components.empty()) {
      component.placed_by_default = true;
      const Similarity placed = AlignComponent(result_.map,
                                               bundle.reconstruction,
                                               {result_.cam_from_world,
                                                orientations_.timestamps_s,
                                                result_.segments,
                                                all_tracks_,
                                                result_.camera,
                                                options_.resection,
                                                options_.num_threads});
      bundle.reconstruction = Moved(bundle.reconstruction, placed);
      bundle.pose_covariance = Moved(std::move(bundle.pose_covariance), placed);
    }
    result_.pose_covariance.merge(bundle.pose_covariance);
    Append(result_.map, std::move(bundle.reconstruction));
    result_.bundles.push_back(std::move(bundle.summary));
    result_.components.push_back(std::move(component));
    result_.cam_from_world = FollowAnchors(orientations_.graph,
                                           result_.cam_from_world,
                                           result_.map.cam_from_world,
                                           options_.rotodom.averaging);
  }
}

std::optional<MapResult> KeyframeMapBuilder::PureRotationExplainsMore() const {
  if (!options_.pure_rotation_segments.enabled || has_off_axis_rotations_) return std::nullopt;
  observer_.OnBegin(SlamStage::kPureRotation, -1);
  const auto rotation = DetectPureRotation(orientations_.camera,
                                           keyframe_rotations_,
                                           result_.keyframe_tracks,
                                           ExplanationBy(result_.bundles),
                                           bundle_options_);
  if (!rotation || !PairsAllowPureRotation(orientations_.graph,
                                           WithBearingsOf(rotation->camera, all_tracks_),
                                           rotation->camera.MeanFocal(),
                                           options_.rotodom.relative_rotation)) {
    return std::nullopt;
  }
  MapResult throughout = PureRotationThroughout(result_, *rotation, orientations_, options_);
  observer_.OnEnd(SlamStage::kPureRotation, throughout);
  return throughout;
}

MapViews KeyframeMapBuilder::ReadViews(const Reconstruction& map,
                                       const std::set<FrameId>& frames) const {
  MapViews views = ReadMapViews(*images_, frames, orientations_, [&](const std::string& problem) {
    observer_.OnMissingImage(problem);
  });
  SetMotions(
      {orientations_, all_tracks_, orientations_.camera, options_.resection, options_.num_threads},
      map,
      views);
  return views;
}

// Null where the options or missing images rule out track completion.
TrackCompletion KeyframeMapBuilder::CompletionByImages() const {
  if (!options_.track_completion.enabled || images_ == nullptr) return nullptr;
  return [this](const Reconstruction& map, const Camera& camera) {
    std::set<FrameId> frames;
    for (const auto& [frame, center] : map.center_in_world) frames.insert(frame);
    std::vector<Track> tracks = CompleteTracks(
        map, ReadViews(map, frames), camera, options_.track_completion, options_.num_threads);
    SetMotionBlur(camera, RatesOf(orientations_), options_.ba.blur_s_per_px, tracks);
    return tracks;
  };
}

// Null without images.
FrameDescription KeyframeMapBuilder::DescriptionByImages(const Camera& camera) const {
  if (images_ == nullptr) return nullptr;
  return [this, &camera](const Reconstruction& map, const std::set<FrameId>& frames) {
    return DescribeViews(
        ReadViews(map, frames), camera, options_.rotodom.features, options_.num_threads);
  };
}

}  // namespace

MapResult MapKeyframes(const Orientations& orientations,
                       const std::vector<Track>& all_tracks,
                       const SlamOptions& options,
                       ImageProvider* images,
                       SlamObserver& observer) {
  return KeyframeMapBuilder(orientations, all_tracks, options, images, observer).Build();
}

}  // namespace rotslam
