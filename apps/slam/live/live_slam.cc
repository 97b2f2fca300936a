#include "apps/slam/live/live_slam.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "apps/slam/live/live_pose.h"
#include "rotodom/tracks/keyframes.h"

namespace rotslam {
namespace {

SlamInputs Reduced(SlamInputs inputs, const WorkingSize& working) {
  inputs.log = nullptr;
  inputs.masks = inputs.masks.Reduced(working);
  inputs.static_content.mask = working.Reduced(inputs.static_content.mask);
  return inputs;
}

// What is asked whether the camera turns in place: long enough to notice that it creeps.
constexpr int kRecentFrames = 40;

// Keyframes whose orientations by the odometry go to the map with a new one: those that it has not
// settled yet, and those of a part that is built anew.
constexpr std::ptrdiff_t kSentKeyframes = 16;

// Keyframes on either side of a place that loops find whose observations tie the map to it.
constexpr std::ptrdiff_t kPlaceKeyframes = 2;

// Orientations against a keyframe are known no better.
constexpr double kLeastSigma = 0.03 * kRadFromDeg;

// Until there is a map, keyframes need this share of the parallax.
constexpr double kStartParallax = 0.15;

// Orientations as emitted follow the map in so long, s.
constexpr double kFollowTime = 1.0;

// Frames of before the map that are placed with one new frame; each costs a millisecond or two.
constexpr int kLatePoses = 2;

// Velocity is that over so long, s. Without points a position is carried on with it for as long;
// then there is none.
constexpr double kVelocityTime = 0.3;

// The stretch of pure rotation that lasts until the newest frame, as the newest frames show it.
std::optional<PureRotationSegment> RotationOfLate(const OdometryResult& odometry,
                                                  const PureRotationOptions& options) {
  RotationMap recent;
  for (auto entry = odometry.cam_from_world.rbegin();
       entry != odometry.cam_from_world.rend() && std::ssize(recent) < kRecentFrames;
       ++entry) {
    recent.insert(*entry);
  }
  ViewGraph graph;
  for (const auto& [frame, rotation] : recent) {
    for (const int index : odometry.graph.EdgesOf(frame)) {
      const RelativeRotation& edge = odometry.graph.edges()[index];
      if (edge.j == frame && recent.contains(edge.i)) graph.AddEdge(edge);
    }
  }
  const std::vector<PureRotationSegment> segments =
      FindPureRotationSegments(graph, recent, options);
  if (segments.empty() || segments.back().last != recent.rbegin()->first) return std::nullopt;
  return segments.back();
}

}  // namespace

const char* ToString(LiveState state) {
  switch (state) {
    case LiveState::kStarting:
      return "starting";
    case LiveState::kTracking:
      return "tracking";
    case LiveState::kRotating:
      return "rotating";
    case LiveState::kStill:
      return "still";
    case LiveState::kExtrapolated:
      return "extrapolated";
  }
  return "unknown";
}

LiveSlam::LiveSlam(const Camera& camera,
                   const SlamOptions& options,
                   const LiveOptions& live,
                   const SlamInputs& inputs)
    : options_(options),
      live_(live),
      original_camera_(camera),
      working_({camera.width, camera.height}, options.max_image_side_px),
      original_masks_(inputs.masks),
      inputs_(Reduced(inputs, working_)),
      collector_(
          {std::nullopt, inputs_.static_content}, working_.Reduced(camera), options_, inputs_),
      mapping_(collector_.camera(), options_) {}

LiveEstimate LiveSlam::AddFrame(double timestamp_s, const cv::Mat& image, const std::string& name) {
  Frame frame;
  frame.id = FrameId{num_frames_++};
  frame.timestamp_s = timestamp_s;
  frame.name = name;
  frame.image = working_.Reduced(image);
  const Candidate candidate = {frame.id, timestamp_s};
  const std::size_t num_edges = odometry().edge_matches.size();
  TrackedFrame tracked = collector_.Track(std::move(frame));
  if (live_.correct_map) {
    has_loops_ = has_loops_ || tracked.estimate.has_averaged;
    if (std::any_of(tracked.estimate.loops.begin(),
                    tracked.estimate.loops.end(),
                    [](const LoopCheck& loop) { return loop.accepted; })) {
      NoteLoops(num_edges);
    }
  }
  LiveEstimate estimate;
  estimate.frame = candidate.frame;
  estimate.timestamp_s = timestamp_s;
  estimate.cam_from_world = tracked.estimate.cam_from_world;
  estimate.covariance = tracked.estimate.covariance;
  {
    std::shared_ptr<const LiveMap> map = mapping_.TakeDue(timestamp_s);
    if (map) FollowCorrection(*map);
    const std::lock_guard lock(mutex_);
    map_ = std::move(map);
  }
  rotation_ = RotationOfLate(odometry(), options_.pure_rotation_segments);
  const auto features = odometry().features.find(candidate.frame);
  const bool has_features = features != odometry().features.end();
  if (map_) Place(has_features ? features->second : Features(), estimate);
  SetState(estimate);
  // With a rolling shutter the frame before has just been corrected by what followed it.
  const bool is_global_shutter = collector_.camera().readout_s == 0.0;
  const std::optional<Candidate> asked =
      is_global_shutter ? (has_features ? std::optional(candidate) : std::nullopt) : newest_;
  if (asked) ChooseKeyframe(*asked, timestamp_s);
  newest_ = has_features ? std::optional(candidate) : std::nullopt;
  if (has_loops_ && !collector_.is_averaging()) PostLoops(timestamp_s);
  UpdateVelocity(estimate);
  NotePath(estimate);
  PlaceEarlierFrames();
  last_ = estimate;
  SlamObserver nobody;
  if (const auto found = collector_.Take(std::move(tracked), nobody); found && !found_) {
    found_ = found;
  }
  return estimate;
}

// The mean velocity over the frames of late that the map has placed.
void LiveSlam::UpdateVelocity(const LiveEstimate& estimate) {
  if (estimate.state == LiveState::kExtrapolated) return;
  if (estimate.state != LiveState::kTracking) {
    placed_.clear();
    velocity_.setZero();
    return;
  }
  placed_.push_back(
      {estimate.timestamp_s, estimate.cam_from_world.Inverse(), *estimate.center_in_world});
  while (placed_.front().timestamp_s < estimate.timestamp_s - kVelocityTime) placed_.pop_front();
  const StampedPose& oldest = placed_.front();
  const double seconds = estimate.timestamp_s - oldest.timestamp_s;
  velocity_ = seconds > 0.0
                  ? Eigen::Vector3d((*estimate.center_in_world - oldest.center_in_world) / seconds)
                  : Eigen::Vector3d(Eigen::Vector3d::Zero());
}

// Orientation and position in the world of the map.
void LiveSlam::Place(const Features& features, LiveEstimate& estimate) {
  const LiveKeyframe& reference = *map_->Newest();
  estimate.map_revision = map_->revision;
  const RotationMap& rotations = odometry().cam_from_world;
  ResectionStart start;
  start.cam_from_world = rotations.at(estimate.frame) * rotations.at(reference.frame).Inverse() *
                         reference.cam_from_world;
  // As emitted, the odometry's turn since the last frame.
  if (last_ && last_->map_revision > 0) {
    estimate.cam_from_world =
        rotations.at(estimate.frame) * rotations.at(last_->frame).Inverse() * last_->cam_from_world;
  } else {
    estimate.cam_from_world = start.cam_from_world;
  }
  const auto variance = [&](FrameId frame) {
    const auto covariance = odometry().covariance.find(frame);
    return covariance == odometry().covariance.end() ? 0.0 : covariance->second.trace() / 3.0;
  };
  const double own = estimate.covariance ? estimate.covariance->trace() / 3.0 : 0.0;
  const double since = std::max(own - variance(reference.frame), kLeastSigma * kLeastSigma);
  start.rotation_covariance = since * Eigen::Matrix3d::Identity();
  const bool has_last = last_ && last_->center_in_world;
  const double step_s = has_last ? estimate.timestamp_s - last_->timestamp_s : 0.0;
  start.center_in_world =
      has_last ? *last_->center_in_world + step_s * velocity_ : reference.center_in_world;
  if (rotation_ && has_last) {
    estimate.center_in_world = last_->center_in_world;
    return;
  }
  const auto pose = FindLivePose(*map_, features, start, collector_.camera(), options_.resection);
  if (pose) {
    // What the map says of the odometry's orientations has the errors of its newest points, and
    // jumps where it is adjusted: it is followed slowly.
    estimate.cam_from_world = Interpolate(
        estimate.cam_from_world, pose->cam_from_world, 1.0 - std::exp(-step_s / kFollowTime));
    estimate.center_in_world = pose->center_in_world;
    estimate.num_points = pose->num_inliers;
    return;
  }
  const bool has_velocity =
      !placed_.empty() && estimate.timestamp_s - placed_.back().timestamp_s <= kVelocityTime;
  if (!has_velocity) return;
  estimate.center_in_world = start.center_in_world;
}

void LiveSlam::NotePath(const LiveEstimate& estimate) {
  PathFrame& frame = path_.emplace_back();
  frame.timestamp_s = estimate.timestamp_s;
  if (!estimate.center_in_world) unplaced_.push_back(estimate.frame);
  if (!map_) return;
  const LiveKeyframe& keyframe = *map_->Newest();
  frame.keyframe = keyframe.frame;
  frame.scale = keyframe.scale;
  frame.cam_from_keyframe = estimate.cam_from_world * keyframe.cam_from_world.Inverse();
  if (!estimate.center_in_world) return;
  frame.center_in_keyframe =
      keyframe.cam_from_world * (*estimate.center_in_world - keyframe.center_in_world);
}

void LiveSlam::PlaceEarlierFrames() {
  for (int k = 0; k < kLatePoses && !unplaced_.empty(); ++k) {
    const FrameId frame = unplaced_.front();
    if (!map_ || map_->Newest()->frame < frame) return;
    unplaced_.pop_front();
    const auto features = odometry().features.find(frame);
    if (features == odometry().features.end()) continue;
    // The map has begun with the next keyframe, or has the one before.
    const LiveKeyframe& keyframe = *map_->KeyframeAt(frame);
    const RotationMap& rotations = odometry().cam_from_world;
    const Rotation cam_from_keyframe = rotations.at(frame) * rotations.at(keyframe.frame).Inverse();
    ResectionStart start;
    start.cam_from_world = cam_from_keyframe * keyframe.cam_from_world;
    start.center_in_world = keyframe.center_in_world;
    start.rotation_covariance = kLeastSigma * kLeastSigma * Eigen::Matrix3d::Identity();
    const auto pose =
        FindLivePose(*map_, features->second, start, collector_.camera(), options_.resection);
    if (!pose) continue;
    PathFrame& placed = path_[frame.value];
    placed.keyframe = keyframe.frame;
    placed.scale = keyframe.scale;
    placed.cam_from_keyframe = pose->cam_from_world * keyframe.cam_from_world.Inverse();
    placed.center_in_keyframe =
        keyframe.cam_from_world * (pose->center_in_world - keyframe.center_in_world);
  }
}

std::vector<LivePathPose> LiveSlam::Path() const {
  std::vector<LivePathPose> path;
  if (!map_) return path;
  const RotationMap& rotations = odometry().cam_from_world;
  for (std::size_t k = 0; k < path_.size(); ++k) {
    const PathFrame& frame = path_[k];
    const FrameId id{static_cast<int>(k)};
    LivePathPose& pose = path.emplace_back();
    pose.frame = id;
    pose.timestamp_s = frame.timestamp_s;
    const LiveKeyframe& keyframe = *map_->KeyframeAt(frame.keyframe.value_or(id));
    if (!frame.keyframe || keyframe.frame != *frame.keyframe) {
      pose.cam_from_world =
          rotations.at(id) * rotations.at(keyframe.frame).Inverse() * keyframe.cam_from_world;
      continue;
    }
    pose.cam_from_world = frame.cam_from_keyframe * keyframe.cam_from_world;
    if (!frame.center_in_keyframe) continue;
    pose.center_in_world = keyframe.center_in_world +
                           keyframe.scale / frame.scale *
                               (keyframe.cam_from_world.Inverse() * *frame.center_in_keyframe);
  }
  return path;
}

void LiveSlam::SetState(LiveEstimate& estimate) const {
  if (rotation_) {
    const bool is_still =
        !rotation_->still.empty() && rotation_->still.back().last == estimate.frame;
    estimate.state = is_still ? LiveState::kStill : LiveState::kRotating;
  } else if (!estimate.center_in_world) {
    estimate.state = LiveState::kStarting;
  } else {
    estimate.state = estimate.num_points > 0 ? LiveState::kTracking : LiveState::kExtrapolated;
  }
}

std::vector<TrackRay> LiveSlam::RaysOf(FrameId frame) const {
  const Features& features = odometry().features.at(frame);
  const Rotation world_from_cam = odometry().cam_from_world.at(frame).Inverse();
  std::vector<TrackRay> rays;
  rays.reserve(features.size());
  for (int n = 0; n < features.size(); ++n) {
    rays.push_back({features.tracks[n].value, world_from_cam * features.bearings[n]});
  }
  return rays;
}

ViewOverlap LiveSlam::OverlapWithKeyframe(FrameId frame) const {
  return OverlapOf(RaysOf(keyframe_->frame), RaysOf(frame));
}

void LiveSlam::ChooseKeyframe(const Candidate& frame, double now_s) {
  const KeyframeOptions& options = options_.keyframes;
  if (!keyframe_) {
    AddKeyframe(frame, now_s);
  } else {
    ViewOverlap overlap = OverlapWithKeyframe(frame.frame);
    if (overlap.shared_ratio < options.min_shared_ratio && before_ &&
        before_->frame > keyframe_->frame) {
      // This frame shares too few tracks; the frame before becomes the keyframe.
      AddKeyframe(*before_, now_s);
      overlap = OverlapWithKeyframe(frame.frame);
    }
    // The first map needs parallax soon.
    const double min_parallax_deg = options.min_parallax_deg * (map_ ? 1.0 : kStartParallax);
    if (overlap.parallax_rad >= min_parallax_deg * kRadFromDeg ||
        overlap.shared_ratio < options.min_shared_ratio) {
      AddKeyframe(frame, now_s);
    }
  }
  before_ = frame;
}

void LiveSlam::AddKeyframe(const Candidate& frame, double now_s) {
  KeyframeInput input;
  input.frame = frame.frame;
  input.timestamp_s = frame.timestamp_s;
  keyframes_.push_back(frame.frame);
  const auto num_sent = std::min(std::ssize(keyframes_), kSentKeyframes);
  for (auto entry = keyframes_.end() - num_sent; entry != keyframes_.end(); ++entry) {
    const FrameId keyframe = *entry;
    input.cam_from_world[keyframe] = odometry().cam_from_world.at(keyframe);
    const auto covariance = odometry().covariance.find(keyframe);
    if (covariance == odometry().covariance.end()) continue;
    input.sigma_rad[keyframe] = std::sqrt(covariance->second.trace() / 3.0);
  }
  input.only_rotated = keyframe_ && rotation_ && rotation_->first <= keyframe_->frame;
  input.features = odometry().features.at(frame.frame);
  mapping_.Post(std::move(input), now_s + live_.handover_s);
  keyframe_ = frame;
}

void LiveSlam::FollowCorrection(const LiveMap& map) {
  if (!map_ || map.num_corrections == map_->num_corrections) return;
  const Similarity move = map.moved * map_->moved.Inverse();
  const Rotation turn = move.turn;
  // The position moves with the map. The orientation follows it as always, without a jump.
  if (last_ && last_->center_in_world) {
    last_->center_in_world = move.Move(*last_->center_in_world);
  }
  for (StampedPose& pose : placed_) {
    pose.world_from_cam = turn * pose.world_from_cam;
    pose.center_in_world = move.Move(pose.center_in_world);
  }
  velocity_ = move.scale * (turn * velocity_);
}

FrameId LiveSlam::KeyframeNearest(FrameId frame) const {
  const auto after = std::lower_bound(keyframes_.begin(), keyframes_.end(), frame);
  if (after == keyframes_.begin()) return *after;
  const auto before = std::prev(after);
  const bool is_nearer =
      after == keyframes_.end() || frame.value - before->value <= after->value - frame.value;
  return is_nearer ? *before : *after;
}

void LiveSlam::NoteLoops(std::size_t first_edge) {
  has_loops_ = true;
  if (keyframes_.empty()) return;
  const std::vector<EdgeMatches>& edges = odometry().edge_matches;
  for (std::size_t k = first_edge; k < edges.size(); ++k) {
    const EdgeMatches& edge = edges[k];
    const Features& older = odometry().features.at(edge.frame_i);
    const Features& newer = odometry().features.at(edge.frame_j);
    RevisitedPlace place;
    place.older = KeyframeNearest(edge.frame_i);
    std::map<TrackId, std::size_t> index;
    for (const auto& [i, j] : edge.pairs) {
      // The other edges follow tracks.
      if (older.tracks[i] == newer.tracks[j] || index.contains(older.tracks[i])) continue;
      index[older.tracks[i]] = place.points.size();
      place.points.push_back({older.tracks[i], newer.tracks[j], {}});
    }
    if (place.points.empty()) continue;
    // Where the keyframes around the older place see them.
    const auto nearest = std::lower_bound(keyframes_.begin(), keyframes_.end(), place.older);
    const auto num_before = std::min(std::distance(keyframes_.begin(), nearest), kPlaceKeyframes);
    const auto num_after = std::min(std::distance(nearest, keyframes_.end()), kPlaceKeyframes + 1);
    for (auto keyframe = nearest - num_before; keyframe != nearest + num_after; ++keyframe) {
      const Features& features = odometry().features.at(*keyframe);
      for (int n = 0; n < features.size(); ++n) {
        const auto point = index.find(features.tracks[n]);
        if (point == index.end()) continue;
        place.points[point->second].observations.push_back(
            {*keyframe, features.keypoints_px[n], features.bearings[n]});
      }
    }
    revisited_.push_back(std::move(place));
  }
}

void LiveSlam::PostLoops(double now_s) {
  LoopInput input;
  for (const FrameId keyframe : keyframes_) {
    input.cam_from_world[keyframe] = odometry().cam_from_world.at(keyframe);
  }
  input.places = std::move(revisited_);
  revisited_.clear();
  has_loops_ = false;
  mapping_.Post(std::move(input), now_s + live_.handover_s);
}

std::vector<Eigen::Vector2d> LiveSlam::SeenPointsPx() const {
  std::vector<Eigen::Vector2d> seen_px;
  if (!map_ || !last_) return seen_px;
  const auto entry = odometry().features.find(last_->frame);
  if (entry == odometry().features.end()) return seen_px;
  const Features& features = entry->second;
  const Eigen::Vector2d half(0.5, 0.5);
  for (int n = 0; n < features.size(); ++n) {
    if (map_->FindPoint(features.tracks[n]) == nullptr) continue;
    seen_px.emplace_back((features.keypoints_px[n] + half) / working_.scale() - half);
  }
  return seen_px;
}

std::shared_ptr<const LiveMap> LiveSlam::Map() const {
  const std::lock_guard lock(mutex_);
  return map_;
}

Orientations LiveSlam::FinishOrientations(FrameSource* frames, SlamObserver& observer) {
  if (!found_) found_ = collector_.EndFrames();
  if (!found_ || frames == nullptr) return collector_.Finish(observer, nullptr);
  frames->Rewind();
  return FindOrientations(*frames, working_.Reduced(original_camera_), options_, inputs_, observer);
}

SlamResult LiveSlam::Finish(FrameSource* original_frames, SlamObserver& observer) {
  if (original_frames != nullptr && inputs_.estimate_lens) {
    original_frames->Rewind();
    SlamInputs inputs = inputs_;
    inputs.masks = original_masks_;
    return RunSlam(*original_frames, original_camera_, options_, observer, inputs);
  }
  std::optional<ReducedFrames> frames;
  if (original_frames != nullptr) frames.emplace(*original_frames, working_);
  FrameSource* again = frames ? &*frames : nullptr;
  const ReducedInput reduced = {
      working_, original_camera_, original_masks_, options_.rotodom.features.scale_factor};
  SlamResult result;
  result.orientations = FinishOrientations(again, observer);
  result.map = BuildMap(result.orientations, options_, again, observer);
  ToOriginalSize(reduced, result.map);
  ToOriginalSize(reduced, result.orientations);
  return result;
}

}  // namespace rotslam
