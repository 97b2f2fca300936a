#include "rotodom/relative_rotation/planar_ambiguity.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

constexpr std::size_t kFewestPairs = 10;  // three determine a plane; ten leave room for outliers

// Equation n . point = value of a pair for the plane n with homography R + t n^T. Units are
// radians: n . f_i is the flow of the pair along its epipolar line.
struct PlaneEquation {
  Eigen::Vector3d point;
  double value = 0.0;
};

std::vector<PlaneEquation> EquationsOf(const PairArrays& pairs,
                                       const EpipolarModel& model,
                                       double threshold) {
  constexpr double kNearEpipole = 1e-3;
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  const std::vector<double> squared_distances = SquaredDistances(pairs, model);
  std::vector<PlaneEquation> equations;
  for (int k = 0; k < pairs.size(); ++k) {
    if (!(squared_distances[k] < threshold * threshold)) continue;
    const Eigen::Vector3d f_i = pairs.BearingI(k);
    const Eigen::Vector3d f_j = pairs.BearingJ(k);
    // f_j x (R f_i + (n . f_i) t) = 0
    const Eigen::Vector3d along = f_j.cross(model.direction);
    const double length = along.norm();
    if (length < kNearEpipole) continue;
    equations.push_back({length * f_i, -f_j.cross(R_j_i * f_i).dot(along) / length});
  }
  return equations;
}

// Fits the plane on which most pairs lie by iteratively re-weighted least squares with a decreasing
// scale.
Eigen::Vector3d FitPlane(const std::vector<PlaneEquation>& equations, double threshold) {
  constexpr int kRounds = 8;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double scale = std::numeric_limits<double>::infinity();
  std::vector<double> errors(equations.size());
  for (int round = 0; round < kRounds; ++round) {
    // Points on a line determine no plane; the damping selects the smallest n.
    Eigen::Matrix3d H = 1e-12 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const auto& [point, value] : equations) {
      const double ratio = (point.dot(normal) - value) / scale;
      const double weight = 1.0 / ((1.0 + ratio * ratio) * (1.0 + ratio * ratio));
      H += weight * point * point.transpose();
      b += weight * value * point;
    }
    normal = H.ldlt().solve(b);
    for (std::size_t k = 0; k < equations.size(); ++k) {
      errors[k] = std::abs(equations[k].point.dot(normal) - equations[k].value);
    }
    scale = std::max(threshold, 2.0 * Median(errors));
  }
  return normal;
}

}  // namespace

std::optional<EpipolarModel> PlanarAmbiguity(const PairArrays& pairs,
                                             const EpipolarModel& model,
                                             double threshold) {
  const std::vector<PlaneEquation> equations = EquationsOf(pairs, model, threshold);
  if (equations.size() < kFewestPairs) return std::nullopt;
  const Eigen::Vector3d normal = FitPlane(equations, threshold);
  Eigen::Matrix3d H = model.j_from_i.Matrix() + model.direction * normal.transpose();
  // If both views see the same side of the plane, the homography has a positive determinant.
  if (!H.allFinite() || !(H.determinant() > 0.0)) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullV);
  const Eigen::Vector3d singular = svd.singularValues() / svd.singularValues()[1];
  H /= svd.singularValues()[1];
  const double stretch = std::max(0.0, singular[0] * singular[0] - 1.0);
  const double shrink = std::max(0.0, 1.0 - singular[2] * singular[2]);
  if (!(stretch + shrink > threshold * threshold)) return std::nullopt;

  // Each of the two motions preserves the length of the middle singular vector and of one of two
  // directions in the plane of the first and last one.
  std::optional<EpipolarModel> alternative;
  double farthest = 0.0;
  for (const double sign : {-1.0, 1.0}) {
    const Eigen::Vector3d middle = svd.matrixV().col(1);
    const Eigen::Vector3d kept = (std::sqrt(shrink) * svd.matrixV().col(0) +
                                  sign * std::sqrt(stretch) * svd.matrixV().col(2)) /
                                 std::sqrt(shrink + stretch);
    Eigen::Matrix3d before;
    before << middle, kept, middle.cross(kept);
    Eigen::Matrix3d after;
    after << H * middle, H * kept, (H * middle).cross(H * kept);
    const Eigen::Matrix3d R_j_i = after * before.transpose();
    const Eigen::Vector3d translation = (H - R_j_i) * middle.cross(kept);
    if (!R_j_i.allFinite() || !(translation.norm() > 0.0)) continue;
    const Rotation j_from_i(Eigen::Quaterniond(R_j_i).normalized());
    const double away = (j_from_i * model.j_from_i.Inverse()).Angle();
    if (away < farthest) continue;
    farthest = away;
    alternative = EpipolarModel{j_from_i, translation.normalized()};
  }
  return alternative;
}

}  // namespace rotslam
