#include "rotodom/types/triangulation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace rotslam {
namespace {

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

std::vector<Eigen::Vector3d> DirectionsInWorld(const std::vector<PosedRay>& rays) {
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(rays.size());
  for (const PosedRay& ray : rays) {
    directions.push_back(ray.cam_from_world.Inverse() * ray.bearing);
  }
  return directions;
}

// Point nearest to all directions: sum_i w_i (I - d_i d_i^T)(X - c_i) = 0.
std::optional<Eigen::Vector3d> ClosestPoint(const std::vector<PosedRay>& rays,
                                            const std::vector<Eigen::Vector3d>& directions) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const Eigen::Matrix3d P =
        Eigen::Matrix3d::Identity() - directions[k] * directions[k].transpose();
    A += P;
    b += P * rays[k].center_in_world;
  }
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(A);
  if (ldlt.info() != Eigen::Success || ldlt.vectorD().minCoeff() < 1e-14) return std::nullopt;
  return ldlt.solve(b);
}

}  // namespace

double BearingError(const PosedRay& ray, const Eigen::Vector3d& point_in_world) {
  return AngleBetween(ray.cam_from_world * (point_in_world - ray.center_in_world), ray.bearing);
}

double TriangulationAngle(const std::vector<PosedRay>& rays,
                          const Eigen::Vector3d& point_in_world) {
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(rays.size());
  for (const PosedRay& ray : rays) {
    directions.push_back((point_in_world - ray.center_in_world).stableNormalized());
  }
  // The widest pair by its chord, which grows with the angle and is exact for small ones; long
  // tracks have thousands of pairs, so only that one pays for an arc tangent.
  double largest_chord_squared = 0.0;
  std::size_t best_a = 0;
  std::size_t best_b = 0;
  for (std::size_t a = 0; a < directions.size(); ++a) {
    for (std::size_t b = a + 1; b < directions.size(); ++b) {
      const double chord_squared = (directions[a] - directions[b]).squaredNorm();
      if (chord_squared <= largest_chord_squared) continue;
      largest_chord_squared = chord_squared;
      best_a = a;
      best_b = b;
    }
  }
  return directions.empty() ? 0.0 : AngleBetween(directions[best_a], directions[best_b]);
}

std::optional<Eigen::Vector3d> Triangulate(const std::vector<PosedRay>& rays,
                                           double min_angle_rad) {
  const std::vector<Eigen::Vector3d> directions = DirectionsInWorld(rays);
  std::optional<Eigen::Vector3d> point = ClosestPoint(rays, directions);
  if (!point) return std::nullopt;
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < rays.size(); ++k) {
      // Residual: predicted unit direction minus ray. Its derivative is the projection onto the
      // plane across the direction, over the depth; a projection is its own square.
      const Eigen::Vector3d offset = *point - rays[k].center_in_world;
      const double depth = offset.norm();
      if (depth < 1e-12) return std::nullopt;
      const Eigen::Vector3d direction = offset / depth;
      const double information = 1.0 / (rays[k].sigma * rays[k].sigma);
      const Eigen::Vector3d across = directions[k] - direction * direction.dot(directions[k]);
      H += information / (depth * depth) *
           (Eigen::Matrix3d::Identity() - direction * direction.transpose());
      g -= information / depth * across;
    }
    const Eigen::Vector3d step = -H.ldlt().solve(g);
    if (!step.allFinite()) return std::nullopt;
    *point += step;
    if (step.norm() < 1e-10 * point->norm()) break;
  }
  for (std::size_t k = 0; k < rays.size(); ++k) {
    if (!((*point - rays[k].center_in_world).dot(directions[k]) > 0.0)) return std::nullopt;
  }
  if (TriangulationAngle(rays, *point) < min_angle_rad) return std::nullopt;
  return point;
}

}  // namespace rotslam
