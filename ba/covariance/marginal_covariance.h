#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <ceres/problem.h>

namespace rotslam {

/// Covariances at a minimum, everything else marginalised: blocks of the inverse of J^T J, the loss
/// included, with residuals that have unit variance.
/// @param eliminated  moving blocks of which no residual has two, such as points.
/// @param remaining   the other moving blocks.
/// @param groups      each a list of remaining blocks whose joint covariance is asked for.
/// @return  one matrix per group, in the blocks' tangent spaces, one block after the other; nullopt
///          when the residuals leave something open. Same bytes every time, which Ceres' own
///          covariance does not promise.
/// Error:   equals the inverse of the whole J^T J to 1e-6 of its size (ba tests).
/// Cost:    squared number of blocks in each eliminated block's residuals to assemble;
///          then a sparse Cholesky of the
///          remaining blocks and one solve per asked dimension.
std::optional<std::vector<Eigen::MatrixXd>> MarginalCovariances(
    ceres::Problem& problem,
    const std::vector<double*>& eliminated,
    const std::vector<double*>& remaining,
    const std::vector<std::vector<double*>>& groups);

}  // namespace rotslam
