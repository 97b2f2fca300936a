#include "rotodom/types/triangulation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace rotslam {
namespace {

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

// Point nearest to all rays: sum_i w_i (I - d_i d_i^T)(X - c_i) = 0.
std::optional<Eigen::Vector3d> ClosestPoint(const std::vector<Sighting>& sightings) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Sighting& sighting : sightings) {
    const Eigen::Vector3d ray = sighting.cam_from_world.Inverse() * sighting.bearing;
    const Eigen::Matrix3d P = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    A += P;
    b += P * sighting.center_in_world;
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
  std::optional<Eigen::Vector3d> point = ClosestPoint(sightings);
  if (!point) return std::nullopt;
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const Sighting& sighting : sightings) {
      // Residual: predicted unit direction minus bearing, both in the world frame.
      const Eigen::Vector3d ray = sighting.cam_from_world.Inverse() * sighting.bearing;
      const Eigen::Vector3d offset = *point - sighting.center_in_world;
      const double depth = offset.norm();
      if (depth < 1e-12) return std::nullopt;
      const Eigen::Vector3d direction = offset / depth;
      const Eigen::Matrix3d J = (Eigen::Matrix3d::Identity() - direction * direction.transpose()) /
                                (depth * sighting.sigma);
      H += J.transpose() * J;
      g += J.transpose() * (direction - ray) / sighting.sigma;
    }
    const Eigen::Vector3d step = -H.ldlt().solve(g);
    if (!step.allFinite()) return std::nullopt;
    *point += step;
    if (step.norm() < 1e-10 * point->norm()) break;
  }
  const bool in_front =
      std::all_of(sightings.begin(), sightings.end(), [&](const Sighting& sighting) {
        return (sighting.cam_from_world * (*point - sighting.center_in_world))
                   .dot(sighting.bearing) > 0.0;
      });
  if (!in_front || TriangulationAngle(sightings, *point) < min_angle_rad) return std::nullopt;
  return point;
}

}  // namespace rotslam
