#include "ba/covariance/marginal_covariance.h"

#include <map>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <ceres/crs_matrix.h>

namespace rotslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Where each block begins in its own list, tangent dimensions.
struct Columns {
  std::vector<int> begin;  // one more than blocks
  int size() const { return begin.back(); }

  Columns(const ceres::Problem& problem, const std::vector<double*>& blocks) : begin{0} {
    begin.reserve(blocks.size() + 1);
    for (const double* block : blocks) {
      begin.push_back(begin.back() + problem.ParameterBlockTangentSize(block));
    }
  }
};

Sparse JacobianOf(ceres::Problem& problem,
                  const std::vector<double*>& eliminated,
                  const std::vector<double*>& remaining) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = eliminated;
  options.parameter_blocks.insert(
      options.parameter_blocks.end(), remaining.begin(), remaining.end());
  options.num_threads = 1;
  ceres::CRSMatrix rows;
  problem.Evaluate(options, nullptr, nullptr, nullptr, &rows);
  using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(rows.num_rows,
                                    rows.num_cols,
                                    static_cast<Eigen::Index>(rows.values.size()),
                                    rows.rows.data(),
                                    rows.cols.data(),
                                    rows.values.data());
}

// The inverse of a matrix of diagonal blocks; nullopt when one has none.
std::optional<Sparse> InverseOfBlocks(const Sparse& H, const Columns& columns) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(3 * static_cast<std::size_t>(columns.size()));
  for (std::size_t k = 0; k + 1 < columns.begin.size(); ++k) {
    const int first = columns.begin[k];
    const int size = columns.begin[k + 1] - first;
    const Eigen::MatrixXd block = H.block(first, first, size, size);
    const Eigen::LLT<Eigen::MatrixXd> factor(block);
    if (factor.info() != Eigen::Success) return std::nullopt;
    const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(size, size));
    for (int c = 0; c < size; ++c) {
      for (int r = 0; r < size; ++r) entries.emplace_back(first + r, first + c, inverse(r, c));
    }
  }
  Sparse inverse(H.rows(), H.cols());
  inverse.setFromTriplets(entries.begin(), entries.end());
  return inverse;
}

}  // namespace

std::optional<std::vector<Eigen::MatrixXd>> MarginalCovariances(
    ceres::Problem& problem,
    const std::vector<double*>& eliminated,
    const std::vector<double*>& remaining,
    const std::vector<std::vector<double*>>& groups) {
  const Columns e(problem, eliminated);
  const Columns c(problem, remaining);
  const Sparse J = JacobianOf(problem, eliminated, remaining);
  const Sparse J_e = J.leftCols(e.size());
  const Sparse J_c = J.rightCols(c.size());
  const std::optional<Sparse> from_eliminated = InverseOfBlocks(Sparse(J_e.transpose() * J_e), e);
  if (!from_eliminated) return std::nullopt;
  const Sparse H_ec = J_e.transpose() * J_c;
  const Sparse H_cc = J_c.transpose() * J_c;
  const Sparse reduced = H_cc - Sparse(H_ec.transpose() * Sparse(*from_eliminated * H_ec));
  const Eigen::SimplicialLLT<Sparse> factor(reduced);
  if (factor.info() != Eigen::Success) return std::nullopt;

  std::map<const double*, int> position;
  for (std::size_t k = 0; k < remaining.size(); ++k) position[remaining[k]] = static_cast<int>(k);
  std::vector<Eigen::MatrixXd> covariances;
  covariances.reserve(groups.size());
  for (const std::vector<double*>& group : groups) {
    std::vector<int> dimensions;
    for (const double* block : group) {
      const int k = position.at(block);
      for (int d = c.begin[k]; d < c.begin[k + 1]; ++d) dimensions.push_back(d);
    }
    const auto size = static_cast<Eigen::Index>(dimensions.size());
    Eigen::MatrixXd units = Eigen::MatrixXd::Zero(c.size(), size);
    for (Eigen::Index d = 0; d < size; ++d) units(dimensions[d], d) = 1.0;
    const Eigen::MatrixXd solved = factor.solve(units);
    if (!solved.allFinite()) return std::nullopt;
    Eigen::MatrixXd covariance(size, size);
    for (Eigen::Index d = 0; d < size; ++d) covariance.row(d) = solved.row(dimensions[d]);
    covariances.push_back(0.5 * (covariance + covariance.transpose()));
  }
  return covariances;
}

}  // namespace rotslam
