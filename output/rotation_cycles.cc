#include "output/rotation_cycles.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr std::size_t kMaxCycles = 3000;
constexpr std::size_t kMaxCycleLength = 60;
// How many times better another reading must close cycles before it is believed.
constexpr double kMuchBetter = 3.0;
constexpr double kWellClosedDeg = 0.5;

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

// The angle that the best tenth of the cycles close to.
double ClosureDeg(const std::vector<RelativeRotation>& edges,
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
  const auto tenth = static_cast<std::ptrdiff_t>(angles_deg.size() / 10);
  std::nth_element(angles_deg.begin(), angles_deg.begin() + tenth, angles_deg.end());
  return angles_deg[static_cast<std::size_t>(tenth)];
}

}  // namespace

Rotation ReadEdgeAs(const Rotation& rotation, const EdgeReading& reading) {
  Rotation read = rotation;
  if (reading.has_other_order) {
    const Eigen::Vector4d q = rotation.Quaternion().coeffs();
    read = Rotation(Eigen::Quaterniond(q[0], q[1], q[2], q[3]));
  }
  return reading.is_inverse ? read.Inverse() : read;
}

EdgeChoice ChooseEdgeReading(const std::vector<RelativeRotation>& edges,
                             const std::vector<EdgeReading>& readings) {
  EdgeChoice choice;
  const Neighbours neighbours = NeighboursOf(edges);
  std::vector<Cycle> cycles = Triangles(edges, neighbours);
  if (cycles.size() < 10) {
    for (Cycle& cycle : TreeCycles(edges, neighbours)) cycles.push_back(std::move(cycle));
  }
  const auto taken_as = [&] { return "taken as " + readings[choice.reading].description; };
  if (cycles.empty()) {
    choice.note = taken_as() + "; there is no cycle of edges to check it";
    return choice;
  }
  std::vector<double> closures_deg;
  for (const EdgeReading& reading : readings) {
    closures_deg.push_back(ClosureDeg(edges, cycles, reading));
  }
  const auto best = static_cast<std::size_t>(
      std::min_element(closures_deg.begin(), closures_deg.end()) - closures_deg.begin());
  const bool is_much_better = kMuchBetter * closures_deg[best] < closures_deg[0] &&
                              closures_deg[0] > kWellClosedDeg;
  if (is_much_better) choice.reading = best;
  double other_deg = 1e9;
  std::size_t other = choice.reading;
  for (std::size_t k = 0; k < readings.size(); ++k) {
    if (k == choice.reading || closures_deg[k] >= other_deg) continue;
    other_deg = closures_deg[k];
    other = k;
  }
  choice.note = taken_as() + ": cycles close to " +
                FormatNumber("%.2g", closures_deg[choice.reading]) + " deg (best tenth)";
  if (other == choice.reading) return choice;
  choice.note += ", as " + readings[other].description + " to " + FormatNumber("%.2g", other_deg);
  if (!(kMuchBetter * closures_deg[choice.reading] < other_deg)) {
    choice.note += ", which does not tell them apart";
  }
  return choice;
}

}  // namespace rotslam
