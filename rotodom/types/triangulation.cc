#include "rotodom/types/triangulation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace rotslam {
namespace {

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

std::vector<Eigen::Vector3d> RaysInWorld(const std::vector<Sighting>& sightings) {
  std::vector<Eigen::Vector3d> rays;
  rays.reserve(sightings.size());
  for (const Sighting& sighting : sightings) {
    rays.push_back(sighting.cam_from_world.Inverse() * sighting.bearing);
  }
  return rays;
}

// Point nearest to all rays: sum_i w_i (I - d_i d_i^T)(X - c_i) = 0.
std::optional<Eigen::Vector3d> ClosestPoint(const std::vector<Sighting>& sightings,
                                            const std::vector<Eigen::Vector3d>& rays) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const Eigen::Matrix3d P = Eigen::Matrix3d::Identity() - rays[k] * rays[k].transpose();
    A += P;
    b += P * sightings[k].center_in_world;
  }
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(A);
  if (ldlt.info() != Eigen::Success || ldlt.vectorD().minCoeff() < 1e-14) return std::nullopt;
  return ldlt.solve(b);
}

}  // namespace

double BearingError(const Sighting& sighting, const Eigen::Vector3d& point_in_world) {
  return AngleBetween(sighting.cam_from_world * (point_in_world - sighting.center_in_world),
                      sighting.bearing);
}

double TriangulationAngle(const std::vector<Sighting>& sightings,
                          const Eigen::Vector3d& point_in_world) {
  std::vector<Eigen::Vector3d> rays;
  rays.reserve(sightings.size());
  for (const Sighting& sighting : sightings) {
    rays.push_back((point_in_world - sighting.center_in_world).stableNormalized());
  }
  // The widest pair by its chord, which grows with the angle and is exact for small ones; long
  // tracks have thousands of pairs, so only that one pays for an arc tangent.
  double largest_chord_squared = 0.0;
  std::size_t best_a = 0;
  std::size_t best_b = 0;
  for (std::size_t a = 0; a < rays.size(); ++a) {
    for (std::size_t b = a + 1; b < rays.size(); ++b) {
      const double chord_squared = (rays[a] - rays[b]).squaredNorm();
      if (chord_squared <= largest_chord_squared) continue;
      largest_chord_squared = chord_squared;
      best_a = a;
      best_b = b;
    }
  }
  return rays.empty() ? 0.0 : AngleBetween(rays[best_a], rays[best_b]);
}

std::optional<Eigen::Vector3d> Triangulate(const std::vector<Sighting>& sightings,
                                           double min_angle_rad) {
  const std::vector<Eigen::Vector3d> rays = RaysInWorld(sightings);
  std::optional<Eigen::Vector3d> point = ClosestPoint(sightings, rays);
  if (!point) return std::nullopt;
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < sightings.size(); ++k) {
      // Residual: predicted unit direction minus ray. Its derivative is the projection onto the
      // plane across the direction, over the depth; a projection is its own square.
      const Eigen::Vector3d offset = *point - sightings[k].center_in_world;
      const double depth = offset.norm();
      if (depth < 1e-12) return std::nullopt;
      const Eigen::Vector3d direction = offset / depth;
      const double information = 1.0 / (sightings[k].sigma * sightings[k].sigma);
      const Eigen::Vector3d across = rays[k] - direction * direction.dot(rays[k]);
      H += information / (depth * depth) *
           (Eigen::Matrix3d::Identity() - direction * direction.transpose());
      g -= information / depth * across;
    }
    const Eigen::Vector3d step = -H.ldlt().solve(g);
    if (!step.allFinite()) return std::nullopt;
    *point += step;
    if (step.norm() < 1e-10 * point->norm()) break;
  }
  for (std::size_t k = 0; k < sightings.size(); ++k) {
    if (!((*point - sightings[k].center_in_world).dot(rays[k]) > 0.0)) return std::nullopt;
  }
  if (TriangulationAngle(sightings, *point) < min_angle_rad) return std::nullopt;
  return point;
}

}  // namespace rotslam
