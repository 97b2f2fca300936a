#pragma once

#include <cmath>
#include <cstdlib>
#include <memory>
#include <vector>

#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>
#include <opengv/sac/Ransac.hpp>
#include <opengv/sac_problems/relative_pose/CentralRelativePoseSacProblem.hpp>
#include <opengv/sac_problems/relative_pose/EigensolverSacProblem.hpp>

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// OpenGV's answers to the same matches. Its rotations take the second view's bearings to the
/// first.
class OpenGvReference {
 public:
  /// `inlier_px`: error of the reprojected midpoint, by which OpenGV counts inliers.
  OpenGvReference(const std::vector<BearingPair>& pairs, double focal_px, double inlier_px = 1.5)
      : threshold_(1.0 - std::cos(std::atan(inlier_px / focal_px))) {
    for (const BearingPair& pair : pairs) {
      bearings_i_.push_back(pair.bearing_i);
      bearings_j_.push_back(pair.bearing_j);
    }
  }

  /// Minimum of the normal epipolar constraint on all matches, from the identity.
  Rotation Eigensolver() const {
    opengv::relative_pose::CentralRelativeAdapter adapter(bearings_i_, bearings_j_);
    return Rotation::FromMatrix(opengv::relative_pose::eigensolver(adapter)).Inverse();
  }

  /// RANSAC over the same, from the identity, refined on the inliers; identity when it fails.
  Rotation EigensolverRansac() const {
    using Problem = opengv::sac_problems::relative_pose::EigensolverSacProblem;
    opengv::relative_pose::CentralRelativeAdapter adapter(bearings_i_, bearings_j_);
    constexpr int kSampleSize = 10;
    opengv::sac::Ransac<Problem> ransac;
    Problem::model_t refined;
    return Solve(ransac, std::make_shared<Problem>(adapter, kSampleSize, false), refined)
               ? Rotation::FromMatrix(refined.rotation).Inverse()
               : Rotation();
  }

  /// RANSAC over Nister's five-point solver, refined on the inliers; identity when it fails.
  Rotation FivePointRansac() const {
    using Problem = opengv::sac_problems::relative_pose::CentralRelativePoseSacProblem;
    opengv::relative_pose::CentralRelativeAdapter adapter(bearings_i_, bearings_j_);
    opengv::sac::Ransac<Problem> ransac;
    Problem::model_t refined;
    return Solve(ransac, std::make_shared<Problem>(adapter, Problem::NISTER, false), refined)
               ? Rotation::FromMatrix(refined.leftCols<3>()).Inverse()
               : Rotation();
  }

 private:
  template <class Ransac, class Problem>
  bool Solve(Ransac& ransac,
             const std::shared_ptr<Problem>& problem,
             typename Problem::model_t& refined) const {
    // The eigensolver perturbs its start by the C library's random numbers.
    std::srand(1);
    ransac.sac_model_ = problem;
    ransac.threshold_ = threshold_;
    ransac.max_iterations_ = 400;
    ransac.probability_ = 0.999;
    if (!ransac.computeModel()) return false;
    problem->optimizeModelCoefficients(ransac.inliers_, ransac.model_coefficients_, refined);
    return true;
  }

  opengv::bearingVectors_t bearings_i_;
  opengv::bearingVectors_t bearings_j_;
  double threshold_;
};

}  // namespace rotslam
