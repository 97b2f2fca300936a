#include "apps/paper_method/eigensolver.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include <opengv/math/cayley.hpp>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>
#include <opengv/sac/Ransac.hpp>
#include <opengv/sac_problems/relative_pose/EigensolverSacProblem.hpp>

#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// Matches of a sample, and largest change of a sample's start, of each Cayley parameter (MRO).
constexpr int kSampleSize = 10;
constexpr double kMaxVariation = 1e-4;
// Sum over both views of 1 - cos(angle between a bearing and the triangulated point) below which a
// match is an inlier (MRO): about a pixel at KITTI's focal length.
constexpr double kThreshold = 1e-6;
// OpenGV's own defaults.
constexpr int kMaxSamples = 1000;
constexpr double kConfidence = 0.99;

using Eigensolver = opengv::sac_problems::relative_pose::EigensolverSacProblem;

// OpenGV's problem with random numbers of its own instead of the process's.
class SeededEigensolver : public Eigensolver {
 public:
  SeededEigensolver(adapter_t& adapter, std::uint64_t seed)
      : Eigensolver(adapter, kSampleSize, false), random_(HashOf(seed)) {
    // 31 bits, as OpenGV's own generator gives them.
    rng_gen_ = std::make_shared<std::function<int()>>(
        [random = SplitMix64(seed)]() mutable { return static_cast<int>(random.Next() >> 33); });
  }

  bool computeModelCoefficients(const std::vector<int>& indices, model_t& model) const override {
    opengv::cayley_t cayley = opengv::math::rot2cayley(_adapter.getR12());
    for (int k = 0; k < 3; ++k) cayley[k] += kMaxVariation * NextSigned();
    model.rotation = opengv::math::cayley2rot(cayley);
    opengv::relative_pose::eigensolver(_adapter, indices, model);
    return model.rotation.allFinite();
  }

  void optimizeModelCoefficients(const std::vector<int>& inliers,
                                 const model_t& model,
                                 model_t& optimized) override {
    optimized.rotation = model.rotation;
    opengv::relative_pose::eigensolver(_adapter, inliers, optimized, true);
  }

 private:
  // Uniform in [-1, 1).
  double NextSigned() const { return static_cast<double>(random_.Next() >> 11) * 0x1p-52 - 1.0; }

  mutable SplitMix64 random_;
};

}  // namespace

std::optional<EigensolverEstimate> EstimateByEigensolver(std::span<const BearingPair> pairs,
                                                         const Rotation& start_j_from_i,
                                                         std::uint64_t seed) {
  if (pairs.size() <= kSampleSize) return std::nullopt;
  opengv::bearingVectors_t bearings_i;
  opengv::bearingVectors_t bearings_j;
  bearings_i.reserve(pairs.size());
  bearings_j.reserve(pairs.size());
  for (const BearingPair& pair : pairs) {
    bearings_i.push_back(pair.bearing_i);
    bearings_j.push_back(pair.bearing_j);
  }
  // OpenGV's rotations take bearings of the second view to the first.
  opengv::relative_pose::CentralRelativeAdapter adapter(
      bearings_i, bearings_j, start_j_from_i.Inverse().Matrix());
  opengv::sac::Ransac<SeededEigensolver> ransac(kMaxSamples, kThreshold, kConfidence);
  const auto problem = std::make_shared<SeededEigensolver>(adapter, seed);
  ransac.sac_model_ = problem;
  if (!ransac.computeModel() || ransac.inliers_.size() <= kSampleSize) return std::nullopt;
  SeededEigensolver::model_t refined;
  problem->optimizeModelCoefficients(ransac.inliers_, ransac.model_coefficients_, refined);
  if (!refined.rotation.allFinite()) return std::nullopt;

  EigensolverEstimate estimate;
  estimate.j_from_i = Rotation::FromMatrix(refined.rotation).Inverse();
  const double length = refined.translation.norm();
  if (length > 0.0 && std::isfinite(length)) {
    estimate.translation_direction = -(estimate.j_from_i * (refined.translation / length));
  }
  estimate.inliers = std::move(ransac.inliers_);
  std::sort(estimate.inliers.begin(), estimate.inliers.end());
  estimate.num_samples = ransac.iterations_;
  return estimate;
}

}  // namespace rotslam
