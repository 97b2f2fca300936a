#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// A ray towards a scene point from a camera of known pose.
struct PosedRay {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world;
  Eigen::Vector3d bearing;  // unit, in the camera frame
  double sigma = 1.0;       // standard deviation of the bearing, rad; only ratios matter
};

/// The point whose bearings differ least from the rays, weighted by 1/sigma (least squares on
/// the sphere, from the directions' closest point).
/// @param rays  at least two.
/// @return  nullopt when the directions do not meet in front of every camera or are parallel to
/// within `min_angle_rad`.
std::optional<Eigen::Vector3d> Triangulate(const std::vector<PosedRay>& rays, double min_angle_rad);

/// Largest angle between two of the world-frame directions from `rays`' centres to
/// `point_in_world`, rad.
double TriangulationAngle(const std::vector<PosedRay>& rays, const Eigen::Vector3d& point_in_world);

/// Angle between a ray and the direction in which its camera should see the point, rad.
double BearingError(const PosedRay& ray, const Eigen::Vector3d& point_in_world);

}  // namespace rotslam
