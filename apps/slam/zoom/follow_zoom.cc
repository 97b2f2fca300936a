#include "apps/slam/zoom/follow_zoom.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "ba/zoom/focal_resection.h"
#include "ba/zoom/zoom_adjustment.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Frames of the map before a zoom: enough to see points from two sides.
constexpr int kMostFramesBefore = 100;
constexpr int kFewestFramesBefore = 8;
// The zoom may begin so many frames before it was noticed.
constexpr int kMargin = 4;
// A focal length rests that changes by less than this, as a logarithm, within so many frames.
constexpr int kRestingFrames = 10;
constexpr double kResting = 0.01;
// It changes that goes by more than this, as a logarithm, per frame, over so many frames on both
// sides.
constexpr double kChangePerFrame = 0.002;
constexpr int kSlopeFrames = 3;
// Frames after the zoom that help to tell its size, at most.
constexpr int kMostFramesAfter = 40;
// The zoom has begun once the logarithm of its focal length is this.
constexpr double kBegun = 0.05;
// Frames of a zoom, at most.
constexpr int kMostFrames = 200;
// Frames without a focal length, one after the other, at most.
constexpr int kMostMissing = 5;
// A point whose rays meet at a smaller angle has no depth.
constexpr double kMinAngle_rad = 0.4 * kRadFromDeg;
// Observations of a frame that are used.
constexpr int kMostPoints = 400;

// The frames first to last of an odometry.
OdometryResult PartOf(const OdometryResult& whole, FrameId first, FrameId last) {
  const auto is_in = [&](FrameId frame) { return first <= frame && frame <= last; };
  OdometryResult part;
  for (const auto& [frame, features] : whole.features) {
    if (is_in(frame)) part.features[frame] = features;
  }
  for (const auto& [frame, rotation] : whole.cam_from_world) {
    if (is_in(frame)) part.cam_from_world[frame] = rotation;
  }
  for (const auto& [frame, covariance] : whole.covariance) {
    if (is_in(frame)) part.covariance[frame] = covariance;
  }
  for (const RelativeRotation& edge : whole.graph.edges()) {
    if (is_in(edge.i) && is_in(edge.j)) part.graph.AddEdge(edge);
  }
  for (const EdgeMatches& matches : whole.edge_matches) {
    if (is_in(matches.frame_i) && is_in(matches.frame_j)) part.edge_matches.push_back(matches);
  }
  return part;
}

// A tracked point by the rays of the frames that see it.
class RayPoint {
 public:
  void Add(const Eigen::Vector3d& center, const Eigen::Vector3d& ray) {
    if (num_rays_ == 0) first_ray_ = ray;
    angle_rad_ =
        std::max(angle_rad_, std::atan2(first_ray_.cross(ray).norm(), first_ray_.dot(ray)));
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    normal_ += across;
    right_ += across * center;
    direction_ += ray;
    ++num_rays_;
  }

  // nullopt: too little parallax.
  std::optional<Eigen::Vector3d> Place() const {
    if (num_rays_ < 3 || angle_rad_ < kMinAngle_rad) return std::nullopt;
    return normal_.ldlt().solve(right_);
  }
  // Where the point is seen by a camera that only rotates, which tells no depth.
  Eigen::Vector3d Direction() const { return direction_.normalized(); }
  double angle_rad() const { return angle_rad_; }

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d first_ray_;
  double angle_rad_ = 0.0;
  int num_rays_ = 0;
};

// The frames around a zoom, one after the other.
class ZoomPath {
 public:
  ZoomPath(const OdometryResult& tracked, FramesBeforeZoom before)
      : tracked_(tracked), before_(std::move(before)), poses_(before_.poses) {
    for (const auto& [frame, pose] : poses_) AddRays(frame, pose);
  }

  // Resects frames until the focal length has rested for a while.
  // @return  whether it has changed.
  bool Follow() {
    const FrameId end = tracked_.features.rbegin()->first;
    int num_missing = 0;
    int num_after = 0;
    for (FrameId frame{poses_.rbegin()->first.value + 1};
         frame <= end && std::ssize(poses_) < std::ssize(before_.poses) + kMostFrames;
         ++frame.value) {
      num_missing = AddFrame(frame) ? 0 : num_missing + 1;
      if (num_missing > kMostMissing) break;
      if (Rests()) {
        if (++num_after == kMostFramesAfter) break;
      } else if (num_after > kRestingFrames) {
        // The next zoom begins.
        for (int n = 0; n < kRestingFrames; ++n) poses_.erase(std::prev(poses_.end()));
        break;
      }
    }
    return HasBegun();
  }

  // All frames together.
  void Adjust() {
    const std::vector<Track> tracks = Tracks();
    ZoomProblem problem = {
        before_.camera, poses_, {}, unzoomed_, alike_, before_.moves, {}, tracks, noise_px_};
    // These hold place and scale.
    problem.known = {before_.poses.begin()->first, before_.poses.rbegin()->first};
    for (const auto& [frame, pose] : before_.poses) problem.unzoomed.insert(frame);
    for (const auto& [track, point] : points_) {
      if (const auto place = PlaceOf(point)) problem.points[track] = *place;
    }
    poses_ = AdjustZoom(problem);
  }

  // Takes the frames before and after the change of the focal length for unchanged.
  // @return  whether there is a change.
  bool SplitIntoStretches() {
    std::vector<FrameId> frames;
    std::vector<double> log_scales;
    for (const auto& [frame, pose] : poses_) {
      if (before_.poses.contains(frame)) continue;
      frames.push_back(frame);
      log_scales.push_back(pose.log_scale);
    }
    const int num_frames = static_cast<int>(frames.size());
    const auto is_changing = [&](int n) {
      const int from = std::max(0, n - kSlopeFrames);
      const int to = std::min(num_frames - 1, n + kSlopeFrames);
      return std::abs(log_scales[to] - log_scales[from]) > kChangePerFrame * (to - from);
    };
    int first = 0;
    while (first < num_frames && !is_changing(first)) ++first;
    int last = first;
    while (last < num_frames && (is_changing(last) || std::abs(log_scales[last]) < kBegun)) {
      ++last;
    }
    const double at_end = Median({log_scales.begin() + last, log_scales.end()}, log_scales.back());
    if (std::abs(at_end) < kLeastLogZoom) return false;
    for (int n = 0; n < first; ++n) {
      unzoomed_.insert(frames[n]);
      poses_.at(frames[n]).log_scale = 0.0;
    }
    for (int n = last; n < num_frames; ++n) {
      alike_.insert(frames[n]);
      poses_.at(frames[n]).log_scale = at_end;
    }
    return true;
  }

  FollowedZoom Result() const {
    FollowedZoom result;
    result.camera = before_.camera;
    const FrameId end = poses_.rbegin()->first;
    double log_scale = 0.0;
    result.zoom.first = result.zoom.last = end;
    for (const auto& [frame, features] : tracked_.features) {
      const auto found = poses_.find(frame);
      if (found != poses_.end()) log_scale = found->second.log_scale;
      if (log_scale != 0.0) result.scales[frame] = std::exp(log_scale);
      if (log_scale != 0.0 && frame < result.zoom.first) result.zoom.first = frame;
    }
    if (!alike_.empty()) result.zoom.last = *alike_.begin();
    result.zoom.factor = std::exp(log_scale);
    return result;
  }

 private:
  bool HasBegun() const {
    return std::any_of(poses_.begin(), poses_.end(), [](const auto& pose) {
      return std::abs(pose.second.log_scale) > kBegun;
    });
  }

  bool Rests() const {
    if (!HasBegun() || poses_.size() < kRestingFrames) return false;
    double least = std::numeric_limits<double>::infinity();
    double most = -least;
    auto pose = poses_.rbegin();
    for (int n = 0; n < kRestingFrames; ++n, ++pose) {
      least = std::min(least, pose->second.log_scale);
      most = std::max(most, pose->second.log_scale);
    }
    return most - least < kResting && std::abs(most) > kBegun;
  }

  std::optional<Eigen::Vector3d> PlaceOf(const RayPoint& point) const {
    return before_.moves ? point.Place() : point.Direction();
  }

  // The rays of a frame's points through its lens.
  void AddRays(FrameId frame, const ZoomedPose& pose) {
    const auto found = tracked_.features.find(frame);
    if (found == tracked_.features.end()) return;
    const Features& features = found->second;
    const Rotation world_from_cam = pose.cam_from_world.Inverse();
    const double back = std::exp(-pose.log_scale);
    for (std::size_t n = 0; n < features.tracks.size(); ++n) {
      const auto bearing =
          before_.camera.Unproject(Zoomed(features.keypoints_px[n], before_.camera, back));
      if (bearing) points_[features.tracks[n]].Add(pose.center_in_world, world_from_cam * *bearing);
    }
  }

  // The pose that the next frame has if movement and zoom go on as before.
  ZoomedPose StartOf(FrameId frame) const {
    const auto newest = poses_.rbegin();
    const auto before = std::next(newest);
    ZoomedPose start = newest->second;
    start.cam_from_world = tracked_.cam_from_world.at(frame) *
                           tracked_.cam_from_world.at(newest->first).Inverse() *
                           newest->second.cam_from_world;
    const int gap = newest->first.value - before->first.value;
    const double share = static_cast<double>(frame.value - newest->first.value) / gap;
    start.center_in_world +=
        share * (newest->second.center_in_world - before->second.center_in_world);
    start.log_scale += share * (newest->second.log_scale - before->second.log_scale);
    return start;
  }

  bool AddFrame(FrameId frame) {
    const auto found = tracked_.features.find(frame);
    if (found == tracked_.features.end() || !tracked_.cam_from_world.contains(frame)) return false;
    const Features& features = found->second;
    std::vector<PointObservation2D3D> observations;
    for (std::size_t n = 0; n < features.tracks.size(); ++n) {
      const auto point = points_.find(features.tracks[n]);
      if (point == points_.end()) continue;
      if (const auto place = PlaceOf(point->second)) {
        observations.push_back({point->first, *place, features.keypoints_px[n]});
      }
    }
    const auto resected =
        ResectWithFocal(before_.camera, observations, StartOf(frame), before_.moves);
    if (!resected) return false;
    poses_[frame] = resected->pose;
    noises_px_.push_back(resected->noise_px);
    noise_px_ = Median(noises_px_);
    AddRays(frame, resected->pose);
    return true;
  }

  // The tracks of these frames.
  std::vector<Track> Tracks() const {
    std::map<TrackId, Track> tracks;
    for (const auto& [frame, pose] : poses_) {
      const auto found = tracked_.features.find(frame);
      if (found == tracked_.features.end()) continue;
      const Features& features = found->second;
      const std::size_t step = 1 + features.tracks.size() / kMostPoints;
      for (std::size_t n = 0; n < features.tracks.size(); ++n) {
        // Tracks are left out by their number, so that a track is left out of all frames alike.
        if (features.tracks[n].value % static_cast<int>(step) != 0) continue;
        Track& track = tracks[features.tracks[n]];
        track.id = features.tracks[n];
        track.observations.push_back(
            {frame, features.keypoints_px[n], Eigen::Vector3d::UnitZ(), 1.0});
      }
    }
    std::vector<Track> list;
    for (auto& [id, track] : tracks) {
      if (track.observations.size() >= 3) list.push_back(std::move(track));
    }
    return list;
  }

  const OdometryResult& tracked_;
  FramesBeforeZoom before_;
  std::map<FrameId, ZoomedPose> poses_;
  std::set<FrameId> unzoomed_;
  std::set<FrameId> alike_;
  std::map<TrackId, RayPoint> points_;
  std::vector<double> noises_px_;
  double noise_px_ = 1.0;
};

}  // namespace

std::optional<FollowedZoom> FollowZoom(const OdometryResult& tracked,
                                       const Camera& camera,
                                       const Zoom& zoom,
                                       const MapOfPart& map_of_part) {
  const FrameId last{zoom.first.value - kMargin};
  const FrameId first{
      std::max(tracked.cam_from_world.begin()->first.value, last.value - kMostFramesBefore + 1)};
  if (last.value - first.value + 1 < kFewestFramesBefore) return std::nullopt;
  std::optional<FramesBeforeZoom> before = map_of_part(PartOf(tracked, first, last), camera);
  if (!before || std::ssize(before->poses) < kFewestFramesBefore) return std::nullopt;
  ZoomPath path(tracked, *std::move(before));
  if (!path.Follow()) return std::nullopt;
  path.Adjust();
  if (!path.SplitIntoStretches()) return std::nullopt;
  path.Adjust();
  return path.Result();
}

}  // namespace rotslam
