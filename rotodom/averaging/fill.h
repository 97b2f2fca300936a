#pragma once

#include <Eigen/SparseCore>

namespace rotslam {

/// The cost of a Cholesky factorisation, counted without doing it.
struct CholeskyFill {
  double entries = 0.0;      // below the factor's diagonal
  double products = 0.0;     // multiplications, about: the sum of the columns' squared counts
  bool is_complete = false;  // false: the count stopped at the limit
};

/// Counts the factor's columns by walking up the elimination tree, row by row.
/// @param upper         n x n, the pattern of the upper triangle in the order of elimination.
/// @param max_products  counting stops beyond these.
/// Cost:    the factor's entries.
/// Source:  Davis, Direct Methods for Sparse Linear Systems, 2006, ch. 4.
CholeskyFill CountFill(const Eigen::SparseMatrix<double>& upper, double max_products);

}  // namespace rotslam
