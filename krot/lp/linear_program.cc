#include "krot/lp/linear_program.h"

#include <cmath>

namespace rotslam {

void LinearProgram::AddRow(double lower, double upper) {
  row_lower.push_back(lower);
  row_upper.push_back(upper);
}

void LinearProgram::AddColumn(double column_cost,
                              double lower,
                              double upper,
                              std::span<const std::pair<int, double>> entries) {
  cost.push_back(column_cost);
  column_lower.push_back(lower);
  column_upper.push_back(upper);
  for (const auto& [row, entry] : entries) {
    row_index.push_back(row);
    value.push_back(entry);
  }
  column_start.push_back(static_cast<int>(row_index.size()));
}

std::string LinearProgram::Problem() const {
  if (num_rows() == 0 || num_columns() == 0) return "linear program: no rows or no columns";
  for (const int row : row_index) {
    if (row < 0 || row >= num_rows()) {
      return "linear program: entry in row " + std::to_string(row) + " of " +
             std::to_string(num_rows());
    }
  }
  for (const double entry : value) {
    if (!std::isfinite(entry)) return "linear program: an entry is not finite";
  }
  for (const double entry : cost) {
    if (!std::isfinite(entry)) return "linear program: a cost is not finite";
  }
  return {};
}

}  // namespace rotslam
