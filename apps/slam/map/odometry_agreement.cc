#include "apps/slam/map/odometry_agreement.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "rotodom/averaging/anchors.h"

namespace rotslam {
namespace {

// Covariances of real footage are too small: blur, a rolling shutter and the errors of a lens make
// points err together. Turns between the keyframes of good footage depart by up to 19 of them.
constexpr double kMaxSigmas = 20.0;
// Turns from frame to frame depart by nearly as much where a blurred image follows a sharp one.
constexpr double kMinAngleDeg = 1.0;
// Turns from keyframe to keyframe add up many of these.
constexpr double kMinStepAngleDeg = 1.5;

OdometryDeparture DepartureBy(const Eigen::Vector3d& difference_rad,
                              const Eigen::Matrix3d& covariance) {
  OdometryDeparture departure;
  departure.angle_deg = difference_rad.norm() * kDegFromRad;
  const Eigen::LLT<Eigen::Matrix3d> root(covariance);
  if (root.info() != Eigen::Success) return {};
  departure.sigmas = std::sqrt(std::max(0.0, difference_rad.dot(root.solve(difference_rad))));
  return departure;
}

}  // namespace

bool OdometryDeparture::IsTooFar() const { return angle_deg > kMinAngleDeg && sigmas > kMaxSigmas; }

OdometryDeparture DepartureOf(const RelativeRotation& edge,
                              const OrientationInMap& before,
                              const OrientationInMap& after,
                              const AveragingOptions& options) {
  const Rotation in_map = after.cam_from_world * before.cam_from_world.Inverse();
  const Eigen::Matrix3d R_j_i = in_map.Matrix();
  const double floor_rad = options.edge_floor_deg * kRadFromDeg;
  const Eigen::Matrix3d covariance =
      options.edge_error_factor * options.edge_error_factor * edge.covariance +
      floor_rad * floor_rad * Eigen::Matrix3d::Identity() + after.covariance +
      R_j_i * before.covariance * R_j_i.transpose();
  return DepartureBy((in_map * edge.j_from_i.Inverse()).Log(), covariance);
}

std::vector<DepartingStep> DepartingSteps(const ViewGraph& graph,
                                          const RotationMap& cam_from_world,
                                          const RotationMap& refined,
                                          const std::vector<std::set<FrameId>>& keyframes,
                                          const AveragingOptions& options) {
  // Every second keyframe is an anchor: the others then have covariances relative to a neighbour.
  std::set<FrameId> anchors;
  for (const std::set<FrameId>& component : keyframes) {
    bool is_anchor = true;
    for (const FrameId frame : component) {
      if (is_anchor) anchors.insert(frame);
      is_anchor = !is_anchor;
    }
  }
  const std::map<FrameId, Eigen::Matrix3d> covariances =
      AnchorCovariances(graph, cam_from_world, anchors, options);
  std::vector<DepartingStep> steps;
  for (const std::set<FrameId>& component : keyframes) {
    std::optional<FrameId> before;
    for (const FrameId frame : component) {
      if (!refined.contains(frame)) continue;
      const auto covariance = covariances.find(anchors.contains(frame) && before ? *before : frame);
      if (before && covariance != covariances.end()) {
        const Rotation by_odometry =
            cam_from_world.at(frame) * cam_from_world.at(*before).Inverse();
        const Rotation by_map = refined.at(frame) * refined.at(*before).Inverse();
        const DepartingStep step = {
            *before,
            frame,
            DepartureBy((by_map * by_odometry.Inverse()).Log(), covariance->second)};
        if (step.departure.IsTooFar() && step.departure.angle_deg > kMinStepAngleDeg) {
          steps.push_back(step);
        }
      }
      before = frame;
    }
  }
  return steps;
}

}  // namespace rotslam
