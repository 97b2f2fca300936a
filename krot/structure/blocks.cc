#include "krot/structure/blocks.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <set>
#include <utility>

#include <Eigen/Cholesky>

#include "rotodom/types/disjoint_sets.h"
#include "rotodom/types/median.h"
#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// Smallest number of shared views and points: fewer may be wrong together.
constexpr int kMinShared = 8;
// Number of pairs of shared views and points whose distances are compared, which bounds the time.
constexpr int kNumDistances = 1000;
// Largest median deviation of the ratios of distances, natural logarithm. Beyond it the two blocks
// contradict each other.
constexpr double kMaxSpread = 0.5;
// Assumed deformation of a block relative to its size, as a standard deviation.
constexpr double kBend = 0.01;

// One view or point, in two blocks.
struct Shared {
  Eigen::Vector3d in_a;
  Eigen::Vector3d in_b;
};

// value(a) - value(b) = difference.
struct Tie {
  int a;
  int b;
  Eigen::VectorXd difference;
  double sigma;
};

struct Spread {
  double median;
  double deviation;  // median absolute
};

Spread SpreadOf(const std::vector<double>& values) {
  Spread spread;
  spread.median = Median(values);
  std::vector<double> deviations;
  deviations.reserve(values.size());
  for (const double value : values) deviations.push_back(std::abs(value - spread.median));
  spread.deviation = Median(std::move(deviations));
  return spread;
}

template <class Key>
void TakeShared(const std::map<Key, Eigen::Vector3d>& a,
                const std::map<Key, Eigen::Vector3d>& b,
                std::vector<Shared>& shared) {
  for (const auto& [key, in_a] : a) {
    const auto in_b = b.find(key);
    if (in_b != b.end()) shared.push_back({in_a, in_b->second});
  }
}

// Scale of b relative to a (natural logarithm) from the distances between shared views and points.
std::optional<Tie> ScaleTie(int a, int b, const std::vector<Shared>& shared) {
  SplitMix64 random(1);
  const int count = static_cast<int>(shared.size());
  std::vector<std::pair<double, double>> lengths;
  for (int k = 0; k < kNumDistances; ++k) {
    const Shared& one = shared[random.Index(count)];
    const Shared& other = shared[random.Index(count)];
    const double in_a = (one.in_a - other.in_a).norm();
    const double in_b = (one.in_b - other.in_b).norm();
    if (in_a > 0.0 && in_b > 0.0) lengths.emplace_back(in_a * in_b, std::log(in_b / in_a));
  }
  // Only the longer half is used, on which noise has least effect.
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  std::vector<double> ratios;
  for (auto it = middle; it != lengths.end(); ++it) ratios.push_back(it->second);
  if (static_cast<int>(ratios.size()) < kMinShared) return std::nullopt;
  const Spread spread = SpreadOf(ratios);
  if (spread.deviation > kMaxSpread) return std::nullopt;
  const double sigma = kSigmasPerMedianDeviation * spread.deviation / std::sqrt(count);
  return Tie{a, b, Eigen::VectorXd::Constant(1, spread.median), std::hypot(sigma, kBend)};
}

// Shift of b relative to a, both in the world's scale.
Tie ShiftTie(
    int a, int b, const std::vector<Shared>& shared, double scale_of_a, double scale_of_b) {
  Eigen::Vector3d shift;
  double variance = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> offsets;
    std::vector<double> places;
    for (const Shared& item : shared) {
      places.push_back(scale_of_b * item.in_b[axis]);
      offsets.push_back(places.back() - scale_of_a * item.in_a[axis]);
    }
    const Spread spread = SpreadOf(offsets);
    shift[axis] = spread.median;
    const double size = SpreadOf(places).deviation;
    variance += std::pow(kSigmasPerMedianDeviation * spread.deviation, 2) /
                    static_cast<double>(shared.size()) +
                std::pow(kBend * size, 2);
  }
  return {a, b, shift, std::max(std::sqrt(variance), std::numeric_limits<double>::min())};
}

// Values along the spanning tree of the ties with least deviation; zero at the root.
Eigen::MatrixXd AlongTree(int root, int num_nodes, const std::vector<Tie>& ties) {
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(num_nodes, ties.front().difference.size());
  std::vector<bool> known(num_nodes, false);
  known[root] = true;
  for (;;) {
    const Tie* best = nullptr;
    for (const Tie& tie : ties) {
      if (known[tie.a] != known[tie.b] && (!best || tie.sigma < best->sigma)) best = &tie;
    }
    if (!best) return values;
    if (known[best->b]) {
      values.row(best->a) = values.row(best->b) + best->difference.transpose();
    } else {
      values.row(best->b) = values.row(best->a) - best->difference.transpose();
    }
    known[best->a] = known[best->b] = true;
  }
}

// Robust least-squares values of `nodes` by the ties between them, one row per node; zero at the
// first of them and at other nodes.
Eigen::MatrixXd Reconcile(const std::vector<int>& nodes,
                          int num_nodes,
                          const std::vector<Tie>& ties) {
  constexpr int kIterations = 20;
  constexpr double kHuber = 3.0;  // sigmas
  Eigen::MatrixXd values = AlongTree(nodes.front(), num_nodes, ties);
  std::vector<Eigen::Index> column(num_nodes, -1);
  for (std::size_t k = 1; k < nodes.size(); ++k)
    column[nodes[k]] = static_cast<Eigen::Index>(k) - 1;
  const auto size = static_cast<Eigen::Index>(nodes.size()) - 1;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
    Eigen::MatrixXd g = Eigen::MatrixXd::Zero(size, values.cols());
    for (const Tie& tie : ties) {
      const double error =
          (values.row(tie.a) - values.row(tie.b) - tie.difference.transpose()).norm() / tie.sigma;
      const double weight = std::min(1.0, kHuber / error) / (tie.sigma * tie.sigma);
      const Eigen::Index a = column[tie.a];
      const Eigen::Index b = column[tie.b];
      if (a >= 0) H(a, a) += weight;
      if (b >= 0) H(b, b) += weight;
      if (a >= 0 && b >= 0) H(a, b) -= weight;
      if (a >= 0 && b >= 0) H(b, a) -= weight;
      if (a >= 0) g.row(a) += weight * tie.difference.transpose();
      if (b >= 0) g.row(b) -= weight * tie.difference.transpose();
    }
    const Eigen::MatrixXd solved = H.ldlt().solve(g);
    if (!solved.allFinite()) break;
    for (const int node : nodes) {
      if (column[node] >= 0) values.row(node) = solved.row(column[node]);
    }
  }
  return values;
}

// The connected group of blocks with the most views.
std::vector<int> LargestGroup(const std::vector<Block>& blocks, const std::vector<Tie>& ties) {
  DisjointSets groups(static_cast<int>(blocks.size()));
  for (const Tie& tie : ties) {
    groups.Join(tie.a, tie.b);
  }
  std::vector<int> best;
  std::size_t most = 0;
  for (std::size_t g = 0; g < blocks.size(); ++g) {
    std::vector<int> members;
    std::set<FrameId> views;
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      if (groups.Find(static_cast<int>(k)) != static_cast<int>(g)) continue;
      members.push_back(static_cast<int>(k));
      for (const auto& [view, center] : blocks[k].centers) views.insert(view);
    }
    if (views.size() <= most) continue;
    most = views.size();
    best = std::move(members);
  }
  return best;
}

}  // namespace

std::vector<std::optional<BlockPlace>> JoinBlocks(const std::vector<Block>& blocks) {
  const int num_blocks = static_cast<int>(blocks.size());
  std::vector<std::optional<BlockPlace>> places(blocks.size());
  std::vector<Tie> scales;
  std::vector<std::vector<Shared>> shared_by;  // by tie
  for (int a = 0; a < num_blocks; ++a) {
    for (int b = a + 1; b < num_blocks; ++b) {
      std::vector<Shared> shared;
      TakeShared(blocks[a].centers, blocks[b].centers, shared);
      TakeShared(blocks[a].points, blocks[b].points, shared);
      if (static_cast<int>(shared.size()) < kMinShared) continue;
      std::optional<Tie> tie = ScaleTie(a, b, shared);
      if (!tie) continue;
      scales.push_back(std::move(*tie));
      shared_by.push_back(std::move(shared));
    }
  }
  const std::vector<int> group = LargestGroup(blocks, scales);
  for (const int block : group) places[block].emplace();
  if (group.size() < 2) return places;

  const Eigen::MatrixXd logarithms = Reconcile(group, num_blocks, scales);
  std::vector<Tie> shifts;
  for (std::size_t t = 0; t < scales.size(); ++t) {
    const auto& [a, b, difference, sigma] = scales[t];
    if (!places[a]) continue;
    shifts.push_back(
        ShiftTie(a, b, shared_by[t], std::exp(logarithms(a, 0)), std::exp(logarithms(b, 0))));
  }
  const Eigen::MatrixXd moved = Reconcile(group, num_blocks, shifts);
  for (const int block : group) {
    places[block] = {std::exp(logarithms(block, 0)), moved.row(block).transpose()};
  }
  return places;
}

CenterMap BlendBlocks(const std::vector<Block>& blocks,
                      const std::vector<std::optional<BlockPlace>>& places) {
  CenterMap sums;
  std::map<FrameId, double> weights;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    if (!places[k]) continue;
    const auto count = static_cast<double>(blocks[k].centers.size());
    double position = 0.5;
    for (const auto& [view, center] : blocks[k].centers) {
      const double weight = std::min(position, count - position);
      position += 1.0;
      sums.try_emplace(view, Eigen::Vector3d::Zero()).first->second +=
          weight * (places[k]->scale * center + places[k]->shift);
      weights[view] += weight;
    }
  }
  for (auto& [view, sum] : sums) sum /= weights.at(view);
  return sums;
}

}  // namespace rotslam
