#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/types/ids.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// A known point and the keypoint at which one image shows it.
struct PointObservation2D3D {
  TrackId track;  // of the point
  Eigen::Vector3d point_in_world;
  Eigen::Vector2d keypoint_px;
  double sigma_px = 1.0;  // standard deviation of the keypoint, per image axis
  Eigen::Vector2f blur = Eigen::Vector2f::Zero();  // as of Observation
};

/// The pose from which resection of a frame starts.
struct ResectionStart {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  /// When given, the start rotation counts as a measurement with this covariance, rad^2, for
  /// delta in Exp(delta) * cam_from_world; but not where the points fit
  /// twice as well without.
  std::optional<Eigen::Matrix3d> rotation_covariance;
};

/// Options of the registration of a frame against known points.
struct ResectionOptions {
  // The parameters that move. A rotation known better than points can tell it is held; so is the
  // centre of a frame inside a pure rotation.
  bool refine_rotation = true;
  bool refine_center = true;
  // Whether observations are less certain along their blurs, as bundle adjustment decides.
  bool has_motion_blur = false;
  // Residual, in sigmas, around which Geman-McClure's weight 1 / (1 + r^2 / scale^2)^2 falls off.
  // The scale comes down to it from the median residual at the start, halving each time.
  double loss_scale = 3.0;
  // Observations farther than this from their point are not inliers. For keypoints with sigma_px
  // above 1 it grows with sigma_px.
  double max_error_px = 3.0;
  // Fewer inliers give no pose.
  int min_inliers = 10;
  // Steps at the last scale; an IRLS step gains about a digit.
  int max_iterations = 20;

  // The first field out of range, by name, value and limit; nullopt when all is well.
  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_error_px", max_error_px);
  }
};

struct ResectedPose {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  int num_inliers = 0;
  double rms_px = 0.0;  // of the inliers
  // Sum of the inliers' squared residuals, in sigmas, over the degrees of freedom: the factor by
  // which their variances are too small.
  double variance_factor = 1.0;
  /// Of (delta, centre): delta in rad as in Exp(delta) * cam_from_world, centre in world units;
  /// from the inliers' sigmas and the rotation's own covariance where given. Zero for what was
  /// held.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Pose of one frame against known points: robust least squares on six unknowns, from a start that
/// is about right (a frame between keyframes, its rotation known and its centre interpolated).
/// @param observations  those with numbers that are not finite are ignored.
/// @return  nullopt with too few inliers, or when they leave the pose open or did not settle.
/// Throws std::invalid_argument for bad options, camera or start.
/// Error:   truth to 1e-9 of the distance to the points on clean observations; with 30 % outliers
///          as good as without them (ba tests).
/// Cost:    about 30 passes over the observations, some more where the rotation is a measurement;
///          one or two milliseconds for 1,000.
/// Source:  iteratively reweighted least squares with a falling scale, as in Barron, A General and
///          Adaptive Robust Loss Function, CVPR 2019, sec. 3; ours is Levenberg-Marquardt inside.
std::optional<ResectedPose> ResectFrame(const Camera& camera,
                                        const std::vector<PointObservation2D3D>& observations,
                                        const ResectionStart& start,
                                        const ResectionOptions& options);

/// The same for a known pose, which stays: that of the start, whose rotation does not count as a
/// measurement. The covariance is that of the parameters that the options let move.
/// Cost:    one pass over the observations.
std::optional<ResectedPose> AssessPose(const Camera& camera,
                                       const std::vector<PointObservation2D3D>& observations,
                                       const ResectionStart& start,
                                       const ResectionOptions& options);

}  // namespace rotslam
