#include "output/graph/rotation_cycles.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr std::size_t kMaxCycles = 3000;
constexpr std::size_t kMaxCycleLength = 60;
// The mean of the logarithms must differ from zero by so many of its standard deviations.
constexpr double kBeyondDoubt = 5.0;
// Where there are few cycles, it must be so large.
const double kMinMeanLogOfFew = std::log(5.0);
constexpr std::size_t kFewCycles = 10;

struct Step {
  std::size_t edge = 0;
  bool is_forward = true;
};
using Cycle = std::vector<Step>;

struct Neighbour {
  int view = 0;
  Step step;
};
using Neighbours = std::vector<std::vector<Neighbour>>;

Neighbours NeighboursOf(const std::vector<RelativeRotation>& edges) {
  int num_views = 0;
  for (const RelativeRotation& edge : edges) {
    num_views = std::max({num_views, edge.i.value + 1, edge.j.value + 1});
  }
  Neighbours neighbours(static_cast<std::size_t>(num_views));
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const int i = edges[k].i.value;
    const int j = edges[k].j.value;
    neighbours[static_cast<std::size_t>(i)].push_back({j, {k, true}});
    neighbours[static_cast<std::size_t>(j)].push_back({i, {k, false}});
  }
  return neighbours;
}

std::vector<Cycle> Triangles(const std::vector<RelativeRotation>& edges,
                             const Neighbours& neighbours) {
  constexpr int kMaxPerEdge = 3;
  std::vector<Cycle> triangles;
  std::vector<const Neighbour*> of_i(neighbours.size(), nullptr);
  const std::size_t stride = edges.size() / kMaxCycles + 1;
  for (std::size_t k = 0; k < edges.size() && triangles.size() < kMaxCycles; k += stride) {
    const auto& around_i = neighbours[static_cast<std::size_t>(edges[k].i.value)];
    for (const Neighbour& n : around_i) of_i[static_cast<std::size_t>(n.view)] = &n;
    int count = 0;
    for (const Neighbour& n : neighbours[static_cast<std::size_t>(edges[k].j.value)]) {
      const Neighbour* back = of_i[static_cast<std::size_t>(n.view)];
      if (back == nullptr || n.view == edges[k].i.value || n.view == edges[k].j.value) continue;
      // i to j, j to the third view, and from there back to i.
      triangles.push_back({{k, true}, n.step, {back->step.edge, !back->step.is_forward}});
      if (++count == kMaxPerEdge) break;
    }
    for (const Neighbour& n : around_i) of_i[static_cast<std::size_t>(n.view)] = nullptr;
  }
  return triangles;
}

// Of each edge outside a breadth-first tree, the cycle that it closes.
std::vector<Cycle> TreeCycles(const std::vector<RelativeRotation>& edges,
                              const Neighbours& neighbours) {
  struct Parent {
    int view = -1;
    Step step;  // from the parent
    int depth = -1;
  };
  std::vector<Parent> parents(neighbours.size());
  std::vector<char> is_in_tree(edges.size(), 0);
  std::vector<int> order(neighbours.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<int>(k);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return neighbours[static_cast<std::size_t>(a)].size() >
           neighbours[static_cast<std::size_t>(b)].size();
  });
  for (const int root : order) {
    if (parents[static_cast<std::size_t>(root)].depth >= 0) continue;
    parents[static_cast<std::size_t>(root)].depth = 0;
    std::deque<int> queue = {root};
    while (!queue.empty()) {
      const int view = queue.front();
      queue.pop_front();
      for (const Neighbour& n : neighbours[static_cast<std::size_t>(view)]) {
        Parent& parent = parents[static_cast<std::size_t>(n.view)];
        if (parent.depth >= 0) continue;
        parent = {view, n.step, parents[static_cast<std::size_t>(view)].depth + 1};
        is_in_tree[n.step.edge] = 1;
        queue.push_back(n.view);
      }
    }
  }
  std::vector<Cycle> cycles;
  for (std::size_t k = 0; k < edges.size() && cycles.size() < kMaxCycles; ++k) {
    if (is_in_tree[k] != 0) continue;
    // From j up to the common ancestor, then down to i.
    int a = edges[k].j.value;
    int b = edges[k].i.value;
    Cycle up = {{k, true}};
    Cycle down;
    while (a != b && up.size() + down.size() < kMaxCycleLength) {
      const Parent& from_a = parents[static_cast<std::size_t>(a)];
      const Parent& from_b = parents[static_cast<std::size_t>(b)];
      if (from_a.depth >= from_b.depth) {
        up.push_back({from_a.step.edge, !from_a.step.is_forward});
        a = from_a.view;
      } else {
        down.push_back(from_b.step);
        b = from_b.view;
      }
    }
    if (a != b || up.size() + down.size() < 3) continue;
    up.insert(up.end(), down.rbegin(), down.rend());
    cycles.push_back(std::move(up));
  }
  return cycles;
}

// The angle that each cycle closes to.
std::vector<double> ClosuresDeg(const std::vector<RelativeRotation>& edges,
                                const std::vector<Cycle>& cycles,
                                const EdgeReading& reading) {
  std::vector<double> angles_deg;
  angles_deg.reserve(cycles.size());
  for (const Cycle& cycle : cycles) {
    Rotation around;
    for (const Step& step : cycle) {
      const Rotation R = ReadEdgeAs(edges[step.edge].j_from_i, reading);
      around = (step.is_forward ? R : R.Inverse()) * around;
    }
    angles_deg.push_back(around.AngleDeg());
  }
  return angles_deg;
}

// Below this, noise decides how well a cycle closes: the best tenth of the cycles.
double NoiseDeg(std::vector<double> closures_deg) {
  constexpr double kRounding = 1e-3;
  const auto tenth = static_cast<std::ptrdiff_t>(closures_deg.size() / 10);
  std::nth_element(closures_deg.begin(), closures_deg.begin() + tenth, closures_deg.end());
  return closures_deg[static_cast<std::size_t>(tenth)] + kRounding;
}

struct ReadingComparison {
  double mean_log = 0.0;  // of `b` over `a`: positive where `a` closes better
  bool is_certain = false;
  double a_deg = 0.0;  // medians of the tenth of the cycles that tell most
  double b_deg = 0.0;
};

ReadingComparison Compare(const std::vector<double>& a_deg, const std::vector<double>& b_deg) {
  const double noise_deg = std::min(NoiseDeg(a_deg), NoiseDeg(b_deg));
  const auto n = static_cast<double>(a_deg.size());
  std::vector<double> logs;
  logs.reserve(a_deg.size());
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (std::size_t k = 0; k < a_deg.size(); ++k) {
    logs.push_back(std::log((b_deg[k] + noise_deg) / (a_deg[k] + noise_deg)));
    sum += logs.back();
    sum_of_squares += logs.back() * logs.back();
  }
  ReadingComparison comparison;
  comparison.mean_log = sum / n;
  const double variance = std::max(0.0, sum_of_squares / n - sum / n * sum / n);
  const bool is_significant =
      std::abs(comparison.mean_log) > kBeyondDoubt * std::sqrt(variance / n) + 1e-6;
  const bool is_large = std::abs(comparison.mean_log) > kMinMeanLogOfFew;
  comparison.is_certain = a_deg.size() < kFewCycles ? is_large : is_significant;
  const double sign = comparison.mean_log < 0.0 ? -1.0 : 1.0;
  std::vector<std::size_t> order(logs.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::sort(order.begin(), order.end(), [&](std::size_t k, std::size_t l) {
    return sign * logs[k] != sign * logs[l] ? sign * logs[k] > sign * logs[l] : k < l;
  });
  order.resize(order.size() / 10 + 1);
  std::vector<double> of_a;
  std::vector<double> of_b;
  for (const std::size_t k : order) {
    of_a.push_back(a_deg[k]);
    of_b.push_back(b_deg[k]);
  }
  comparison.a_deg = Median(of_a);
  comparison.b_deg = Median(of_b);
  return comparison;
}

}  // namespace

Rotation ReadEdgeAs(const Rotation& rotation, const EdgeReading& reading) {
  Rotation read = rotation;
  if (reading.has_other_order) {
    const Eigen::Vector4d q = rotation.Quaternion().coeffs();
    read = Rotation(Eigen::Quaterniond(q[0], q[1], q[2], q[3]));
  }
  if (reading.has_y_up) {
    const Eigen::Quaterniond q = read.Quaternion();
    read = Rotation(Eigen::Quaterniond(q.w(), q.x(), -q.y(), -q.z()));
  }
  return reading.is_inverse ? read.Inverse() : read;
}

EdgeChoice ChooseEdgeReading(const std::vector<RelativeRotation>& edges,
                             const std::vector<EdgeReading>& readings) {
  EdgeChoice choice;
  const Neighbours neighbours = NeighboursOf(edges);
  std::vector<Cycle> cycles = Triangles(edges, neighbours);
  for (Cycle& cycle : TreeCycles(edges, neighbours)) cycles.push_back(std::move(cycle));
  const auto taken_as = [&] { return "taken as " + readings[choice.reading].description; };
  if (cycles.empty()) {
    choice.note = taken_as() + "; there is no cycle of edges to check it";
    return choice;
  }
  std::vector<std::vector<double>> closures_deg;
  closures_deg.reserve(readings.size());
  for (const EdgeReading& reading : readings) {
    closures_deg.push_back(ClosuresDeg(edges, cycles, reading));
  }
  for (std::size_t k = 1; k < readings.size(); ++k) {
    const ReadingComparison comparison = Compare(closures_deg[choice.reading], closures_deg[k]);
    if (comparison.is_certain && comparison.mean_log < 0.0) choice.reading = k;
  }
  // Against the best of the others.
  std::optional<ReadingComparison> nearest;
  std::size_t other = 0;
  for (std::size_t k = 0; k < readings.size(); ++k) {
    if (k == choice.reading) continue;
    const ReadingComparison comparison = Compare(closures_deg[choice.reading], closures_deg[k]);
    if (nearest && nearest->mean_log <= comparison.mean_log) continue;
    nearest = comparison;
    other = k;
  }
  choice.note = taken_as();
  if (!nearest) return choice;
  choice.note += ": cycles close to " + FormatNumber("%.2g", nearest->a_deg) + " deg, as " +
                 readings[other].description + " to " + FormatNumber("%.2g", nearest->b_deg);
  if (!nearest->is_certain) choice.note += ", which does not tell them apart";
  return choice;
}

}  // namespace rotslam
