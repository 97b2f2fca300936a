#include "ba/problem/stray_points.h"

#include <optional>

#include "rotodom/types/parallel.h"

namespace rotslam {

StrayPoints::StrayPoints(const BundleState& state, double min_angle_rad, int num_threads)
    : state_(state),
      min_angle_rad_(min_angle_rad),
      num_threads_(num_threads),
      shifts_(state.tracks.size()),
      accepted_shifts_(shifts_),
      positions_(state.tracks.size(), Eigen::Vector3d::Zero()),
      accepted_positions_(state.tracks.size(), Eigen::Vector3d::Zero()),
      errors_px_(state.tracks.size(), 0.0),
      accepted_errors_px_(errors_px_) {}

void StrayPoints::Start(const std::vector<Pose>& poses) {
  poses_ = poses;
  ForEachPoint([&](std::size_t k) {
    positions_[k] = state_.tracks[k].position + shifts_[k].shift;
    errors_px_[k] = ErrorPx(state_.tracks[k], positions_[k]);
  });
  Accept();
}

void StrayPoints::Try(const std::vector<Pose>& poses) {
  poses_ = poses;
  ForEachPoint([&](std::size_t k) { Follow(k); });
}

void StrayPoints::Accept() {
  ForEachPoint([&](std::size_t k) {
    accepted_shifts_[k] = shifts_[k];
    if (shifts_[k].lost) return;
    accepted_positions_[k] = positions_[k];
    accepted_errors_px_[k] = errors_px_[k];
  });
  accepted_poses_ = poses_;
}

// Of the bearings: a lens is not needed to tell what is far out.
double StrayPoints::ErrorPx(const TrackState& track, const Eigen::Vector3d& position) const {
  double sum = 0.0;
  for (const ObservationState& one : track.observations) {
    if (!one.used) continue;
    const Pose& pose = poses_[one.frame];
    const Eigen::Vector3d seen = pose.R_c_w * (position - pose.center);
    sum += (seen.normalized() - one.bearing).norm();
  }
  return state_.camera.MeanFocal() * sum;
}

void StrayPoints::Follow(std::size_t k) {
  const TrackState& track = state_.tracks[k];
  shifts_[k] = {accepted_shifts_[k].shift, false};
  positions_[k] = track.position + shifts_[k].shift;
  errors_px_[k] = ErrorPx(track, positions_[k]);
  const double limit_px = accepted_errors_px_[k] + kUnseenResidual_px;
  if (errors_px_[k] <= limit_px) return;
  Offer(k, CarriedAlong(k));
  if (const auto position = Triangulate(RaysOf(track), min_angle_rad_)) Offer(k, *position);
  shifts_[k].lost = !CheaperSeen(k);
}

// Whether the point would cost more if it were lost, on top of what it has cost so far. Close to a
// camera's plane one observation alone can be thousands of pixels off.
bool StrayPoints::CheaperSeen(std::size_t k) const {
  const TrackState& track = state_.tracks[k];
  double sum = 0.0;
  double unseen = accepted_errors_px_[k];
  for (const ObservationState& one : track.observations) {
    if (!one.used) continue;
    const Pose& pose = poses_[one.frame];
    const std::optional<Eigen::Vector2d> pixel =
        state_.camera.Project(pose.R_c_w * (positions_[k] - pose.center));
    unseen += kUnseenResidual_px;
    sum += pixel ? (*pixel - one.observation->keypoint_px).norm() : kUnseenResidual_px;
  }
  return sum < unseen;
}

// Takes a position that is seen better.
void StrayPoints::Offer(std::size_t k, const Eigen::Vector3d& position) {
  const TrackState& track = state_.tracks[k];
  const double error_px = ErrorPx(track, position);
  if (!(error_px < errors_px_[k])) return;
  errors_px_[k] = error_px;
  positions_[k] = position;
  shifts_[k].shift = position - track.position;
}

// From where it was, as far as its cameras have moved.
Eigen::Vector3d StrayPoints::CarriedAlong(std::size_t k) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const ObservationState& one : state_.tracks[k].observations) {
    if (!one.used) continue;
    sum += poses_[one.frame].center - accepted_poses_[one.frame].center;
    ++count;
  }
  return accepted_positions_[k] + sum / count;
}

std::vector<PosedRay> StrayPoints::RaysOf(const TrackState& track) const {
  std::vector<PosedRay> rays;
  for (const ObservationState& one : track.observations) {
    if (!one.used) continue;
    const Pose& pose = poses_[one.frame];
    rays.push_back(
        {Rotation::FromMatrix(pose.R_c_w), pose.center, one.bearing, one.observation->sigma_px});
  }
  return rays;
}

void StrayPoints::ForEachPoint(const std::function<void(std::size_t)>& work) const {
  ParallelFor(static_cast<int>(state_.tracks.size()), num_threads_, [&](int k) {
    if (state_.tracks[k].kind == TrackKind::kPoint) work(static_cast<std::size_t>(k));
  });
}

}  // namespace rotslam
