#pragma once

#include <Eigen/Core>

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// The method of the paper that rotslam started from, to compare with; the program itself minimises
/// Sampson distances over rotation and direction.
///
/// Sums over bearing pairs that suffice for the normal epipolar constraint, so that the cost of a
/// solver iteration does not depend on their number.
///
/// With E = [t]x R the algebraic residual of a pair is r = f_j^T E f_i, linear in the nine entries
/// of E, so sum w r^2 = e^T S e with S = sum w q q^T, q = vec(f_j f_i^T).
class NormalEpipolarSums {
 public:
  void Add(const BearingPair& pair, double weight = 1.0);
  const Eigen::Matrix<double, 9, 9>& S() const { return S_; }

 private:
  Eigen::Matrix<double, 9, 9> S_ = Eigen::Matrix<double, 9, 9>::Zero();
};

/// Minimum of the normal epipolar constraint near a start.
struct NormalEpipolarMinimum {
  Rotation j_from_i;
  Eigen::Vector3d translation_direction;  // unit, sign not decided
  double smallest_eigenvalue = 0.0;
};

/// Minimises the smallest eigenvalue of M(R) = sum n n^T, n = R f_i x f_j, by Levenberg-Marquardt
/// on the rotation, the translation direction projected out.
/// @param start_j_from_i  the minimum found is the one this rotation descends to.
/// Error:   truth to 1e-9 rad on clean pairs with a baseline (relative rotation tests).
/// Source:  Kneip & Lynen, Direct Optimization of Frame-to-Frame Rotation, ICCV 2013; with the
///          Gauss-Newton Hessian of sum (t . n)^2 with t eliminated (Kaufman's variable
///          projection).
NormalEpipolarMinimum MinimiseNormalEpipolar(const NormalEpipolarSums& sums,
                                             const Rotation& start_j_from_i,
                                             int max_iterations);

}  // namespace rotslam
