#pragma once

#include <algorithm>
#include <cstddef>

namespace rotslam {

/// Sum of all rows' products of slack and multiplier.
template <typename Iterate>
double Complementarity(const Iterate& at) {
  double sum = 0.0;
  for (std::size_t o = 0; o < at.y.size(); ++o) sum += (at.y[o] * at.r[o]).sum();
  return sum;
}

/// Sets the first slack s, rows r and multipliers y at a point that is set in `at`: all rows are
/// positive, all products y r are equal, and sum sigma_k y_k is one.
/// @param program      has size(), the number of observations, and Sigma(o), the coefficients of s
///                     in the rows of one observation.
/// @param margin       smallest value of a row, in units of s.
/// @param update_rows  computes the rows at a point and its s.
template <typename Program, typename Iterate, typename UpdateRows>
void StartRows(const Program& program, double margin, const UpdateRows& update_rows, Iterate& at) {
  at.y.resize(program.size());
  at.r.resize(program.size());
  at.s = 0.0;
  update_rows(program, at);
  double least = 0.0;
  for (int o = 0; o < program.size(); ++o) {
    const auto sigma = program.Sigma(o);
    for (int k = 0; k < sigma.size(); ++k) {
      if (sigma[k] > 0.0) least = std::min(least, at.r[o][k] / sigma[k]);
    }
  }
  at.s = margin - least;
  update_rows(program, at);
  double sum = 0.0;
  for (int o = 0; o < program.size(); ++o) {
    at.r[o] = at.r[o].max(1e-12 * margin);
    sum += (program.Sigma(o) / at.r[o]).sum();
  }
  for (int o = 0; o < program.size(); ++o) at.y[o] = 1.0 / (sum * at.r[o]);
}

}  // namespace rotslam
