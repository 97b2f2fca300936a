#include "rotodom/averaging/fill.h"

#include <cstdint>
#include <vector>

namespace rotslam {

CholeskyFill CountFill(const Eigen::SparseMatrix<double>& upper, double max_products) {
  const auto size = static_cast<std::size_t>(upper.cols());
  std::vector<int> parent(size, -1);
  std::vector<int> visited(size, -1);
  std::vector<std::int64_t> count(size, 0);
  CholeskyFill fill;
  for (int k = 0; k < static_cast<int>(size); ++k) {
    visited[k] = k;
    for (int p = upper.outerIndexPtr()[k]; p < upper.outerIndexPtr()[k + 1]; ++p) {
      for (int i = upper.innerIndexPtr()[p]; i < k && visited[i] != k; i = parent[i]) {
        if (parent[i] < 0) parent[i] = k;
        fill.products += static_cast<double>(2 * count[i] + 1);
        fill.entries += 1.0;
        ++count[i];
        visited[i] = k;
      }
    }
    if (fill.products > max_products) return fill;
  }
  fill.is_complete = true;
  return fill;
}

}  // namespace rotslam
