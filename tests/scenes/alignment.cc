#include "tests/scenes/alignment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>

namespace rotslam {
namespace {

struct Pairs {
  Eigen::Matrix3Xd estimate;
  Eigen::Matrix3Xd truth;
};

Pairs SharedCenters(const CenterMap& estimate, const CenterMap& truth) {
  Pairs pairs;
  std::vector<Eigen::Vector3d> a;
  std::vector<Eigen::Vector3d> b;
  for (const auto& [frame, center] : estimate) {
    const auto entry = truth.find(frame);
    if (entry == truth.end()) continue;
    a.push_back(center);
    b.push_back(entry->second);
  }
  pairs.estimate.resize(3, a.size());
  pairs.truth.resize(3, a.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    pairs.estimate.col(k) = a[k];
    pairs.truth.col(k) = b[k];
  }
  return pairs;
}

}  // namespace

Similarity AlignCenters(const CenterMap& estimate, const CenterMap& truth) {
  const Pairs pairs = SharedCenters(estimate, truth);
  if (pairs.truth.cols() < 3) throw std::invalid_argument("AlignCenters: fewer than three frames");
  const Eigen::Matrix4d T = Eigen::umeyama(pairs.estimate, pairs.truth, true);
  Similarity similarity;
  similarity.scale = std::cbrt(T.topLeftCorner<3, 3>().determinant());
  similarity.turn = Rotation::FromMatrix(T.topLeftCorner<3, 3>() / similarity.scale);
  similarity.shift = T.topRightCorner<3, 1>();
  return similarity;
}

Similarity AlignCentersKnownRotation(const CenterMap& estimate, const CenterMap& truth) {
  Pairs pairs = SharedCenters(estimate, truth);
  if (pairs.truth.cols() < 2) throw std::invalid_argument("AlignCenters: fewer than two frames");
  const Eigen::Vector3d mean_estimate = pairs.estimate.rowwise().mean();
  const Eigen::Vector3d mean_truth = pairs.truth.rowwise().mean();
  pairs.estimate.colwise() -= mean_estimate;
  pairs.truth.colwise() -= mean_truth;
  Similarity similarity;
  similarity.scale = pairs.estimate.cwiseProduct(pairs.truth).sum() / pairs.estimate.squaredNorm();
  similarity.shift = mean_truth - similarity.scale * mean_estimate;
  return similarity;
}

CenterError CompareCenters(const CenterMap& estimate,
                           const CenterMap& truth,
                           const Similarity& truth_from_estimate) {
  CenterError error;
  double sum = 0.0;
  for (const auto& [frame, center] : estimate) {
    const auto entry = truth.find(frame);
    if (entry == truth.end()) continue;
    const double distance = (truth_from_estimate.Move(center) - entry->second).norm();
    error.max = std::max(error.max, distance);
    sum += distance * distance;
    ++error.count;
  }
  error.rmse = error.count > 0 ? std::sqrt(sum / error.count) : 0.0;
  return error;
}

double MaxPointError(const PointMap& estimate,
                     const PointMap& truth,
                     const Similarity& truth_from_estimate) {
  double largest = 0.0;
  for (const auto& [track, point] : estimate) {
    const auto entry = truth.find(track);
    if (entry == truth.end()) continue;
    largest = std::max(largest, (truth_from_estimate.Move(point) - entry->second).norm());
  }
  return largest;
}

}  // namespace rotslam
