#pragma once

#include <vector>

#include <Eigen/Core>

#include "rotodom/relative_rotation/pair_arrays.h"

namespace rotslam {

/// An epipolar model at a minimum of the robust Sampson distances, with its normal equations.
struct EpipolarFit {
  EpipolarModel model;
  EpipolarNormal normal;
};

/// Levenberg-Marquardt on the Sampson distances of all pairs with the Geman-McClure loss. A step
/// takes one pass over the pairs: the normal equations of a candidate are computed together with
/// its cost.
/// @param loss            scale of the loss, rad.
/// @param max_iterations  steps tried, rejected ones among them.
/// @param tolerance       stop when the predicted decrease of the cost is below this share of it.
EpipolarFit RefineEpipolar(const PairArrays& pairs,
                           const EpipolarModel& start,
                           double loss,
                           int max_iterations,
                           double tolerance);

/// A rotation at a minimum of the robust differences R f_i - f_j, with its Hessian.
struct RotationFit {
  Rotation j_from_i;
  Eigen::Matrix3d H;
};

/// Iteratively re-weighted alignment, R f_i ~ f_j, with the Geman-McClure loss.
/// @param loss  scale of the loss, rad.
RotationFit RefineRotation(const PairArrays& pairs,
                           const Rotation& start,
                           double loss,
                           int max_iterations);

/// Candidates for the direction of translation with a given rotation, as columns, the likeliest
/// first: principal axes of the normals of the epipolar planes.
Eigen::Matrix3d TranslationAxes(const PairArrays& pairs, const Rotation& j_from_i);

/// Robust standard deviation of the distances below `threshold`: 1.4826 times their median, to
/// 0.2 %.
/// @param squared_distances  see SquaredDistances.
/// @return  at least `smallest`; `threshold` when no distance is below it.
double NoiseOf(const std::vector<double>& squared_distances, double threshold, double smallest);

}  // namespace rotslam
