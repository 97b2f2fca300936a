#include "rotodom/averaging/consensus_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <queue>
#include <tuple>

#include "rotodom/types/disjoint_sets.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

constexpr int kEdgesPerChunk = 8192;
// Cycles enough to decide, and the neighbours of a view that are tried for cycles of four.
constexpr int kEnoughCycles = 3;
constexpr int kMaxNeighbours = 32;
// Right edges close at least this share of their cycles while most edges are right.
constexpr int kCyclesPerConsistent = 6;
// Unconfirmed edges on a path count one, those that short cycles contradict more.
constexpr double kUnconfirmedClass = 1.0;
constexpr double kContradictedClass = 3.0;
// Beyond this tolerance agreement is no evidence: one rotation at random in a thousand agrees.
constexpr double kLargestEvidence_rad = 0.25;
// Trees at random that are tried in a row without confirming anything, by size of the graph.
constexpr int kMaxVainTrees = 60;
constexpr int kMinVainTrees = 2;
constexpr double kVainTreeEdges = 2.5e5;
// Edges between two pieces: compared in pairs up to this number; the share that must agree.
constexpr int kMaxVotes = 64;
constexpr int kVotesPerAgreement = 4;

// Square of twice the sine of half the angle: the angle's square while it is small.
double SquaredAngle(const Eigen::Quaterniond& q) { return 4.0 * q.vec().squaredNorm(); }

bool IsEvidence(double squared_tolerance) {
  return squared_tolerance < kLargestEvidence_rad * kLargestEvidence_rad;
}

// A number from 0 to 1 that looks random.
double Hash(std::uint64_t seed, std::uint64_t trial, std::uint64_t edge) {
  std::uint64_t z = ((seed * 0x2545f4914f6cdd1dU + trial) << 32) + edge + 0x9e3779b97f4a7c15U;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

class Consensus {
 public:
  Consensus(const ConsensusProblem& problem, int num_threads);
  ConsensusStart Find();

 private:
  struct Neighbour {
    int view;
    int edge;
  };
  enum class Verdict : char { kUnknown, kContradicted, kConfirmed };
  struct Node {
    int parent = -1;
    int edge = -1;
    int depth = 0;
    int jump = 0;  // an ancestor, for paths in logarithmic time
    double path_class = 0.0;
    double variance = 0.0;
  };
  // Candidates for the tree, best last.
  using Candidate = std::tuple<double, double, int, int>;  // class, variance, view, edge

  std::span<const Neighbour> NeighboursOf(int view) const {
    return {neighbours_.data() + first_[view],
            static_cast<std::size_t>(first_[view + 1] - first_[view])};
  }
  // The edge's rotation, read from `from`.
  Eigen::Quaterniond Along(int edge, int from) const {
    const ConsensusEdge& e = problem_.edges[edge];
    return e.i == from ? e.j_from_i : e.j_from_i.conjugate();
  }
  double Tolerance(double variance) const {
    return problem_.trust_sigmas * problem_.trust_sigmas * variance;
  }
  bool IsConfirmed(int edge) const { return verdict_[edge] == Verdict::kConfirmed; }

  void ListNeighbours();
  void FindComponents();
  Verdict JudgeByTriangles(int edge) const;
  Verdict JudgeBySquares(int edge, std::vector<int>& mark) const;
  void JudgeByShortCycles();
  void JudgeByStart();
  void FindPieces();
  std::vector<int> Roots() const;
  void BuildTree(int trial);
  void Settle(int view, int edge);
  int CommonAncestor(int a, int b) const;
  double PathVariance(int a, int b) const;
  double SquaredResidual(int edge) const;
  bool Agrees(int edge, bool needs_evidence) const;
  bool ConfirmCycles();
  bool ConfirmByVotes();
  bool ConfirmVotes(std::vector<int>& edges);
  void ConfirmByTrees();

  const ConsensusProblem& problem_;
  int num_threads_;
  int num_edges_;
  std::vector<int> first_;
  std::vector<Neighbour> neighbours_;  // by view, then by neighbour
  std::vector<int> component_;
  std::vector<Verdict> verdict_;
  std::vector<int> piece_;
  std::vector<Node> tree_;
  std::vector<Eigen::Quaterniond> cam_from_world_;
};

Consensus::Consensus(const ConsensusProblem& problem, int num_threads)
    : problem_(problem),
      num_threads_(num_threads),
      num_edges_(static_cast<int>(problem.edges.size())),
      verdict_(problem.edges.size(), Verdict::kUnknown),
      piece_(static_cast<std::size_t>(problem.num_views)),
      cam_from_world_(problem.cam_from_world) {
  ListNeighbours();
  FindComponents();
}

void Consensus::ListNeighbours() {
  first_.assign(static_cast<std::size_t>(problem_.num_views) + 1, 0);
  for (const ConsensusEdge& edge : problem_.edges) {
    ++first_[edge.i + 1];
    ++first_[edge.j + 1];
  }
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  neighbours_.resize(2 * problem_.edges.size());
  std::vector<int> next(first_.begin(), first_.end() - 1);
  for (int k = 0; k < num_edges_; ++k) {
    const ConsensusEdge& edge = problem_.edges[k];
    neighbours_[next[edge.i]++] = {edge.j, k};
    neighbours_[next[edge.j]++] = {edge.i, k};
  }
  for (int view = 0; view < problem_.num_views; ++view) {
    std::sort(neighbours_.begin() + first_[view],
              neighbours_.begin() + first_[view + 1],
              [](const Neighbour& a, const Neighbour& b) {
                return std::tie(a.view, a.edge) < std::tie(b.view, b.edge);
              });
  }
}

void Consensus::FindComponents() {
  DisjointSets sets(problem_.num_views);
  for (const ConsensusEdge& edge : problem_.edges) sets.Join(edge.i, edge.j);
  component_.assign(static_cast<std::size_t>(problem_.num_views), -1);
  int count = 0;
  for (int view = 0; view < problem_.num_views; ++view) {
    const int first = sets.Find(view);
    component_[view] = first == view ? count++ : component_[first];
  }
}

Consensus::Verdict Consensus::JudgeByTriangles(int edge) const {
  const ConsensusEdge& e = problem_.edges[edge];
  const std::span<const Neighbour> at_i = NeighboursOf(e.i);
  const std::span<const Neighbour> at_j = NeighboursOf(e.j);
  int tried = 0;
  int consistent = 0;
  for (std::size_t a = 0, b = 0; a < at_i.size() && b < at_j.size();) {
    if (at_i[a].view != at_j[b].view) {
      ++(at_i[a].view < at_j[b].view ? a : b);
      continue;
    }
    const Neighbour& first = at_i[a++];
    const Neighbour& last = at_j[b++];
    const double variance =
        e.variance + problem_.edges[first.edge].variance + problem_.edges[last.edge].variance;
    const Eigen::Quaterniond around =
        Along(last.edge, last.view) * Along(first.edge, e.i) * e.j_from_i.conjugate();
    const double tolerance = Tolerance(variance);
    if (!IsEvidence(tolerance)) continue;
    ++tried;
    if (SquaredAngle(around) <= tolerance && ++consistent == kEnoughCycles) break;
  }
  if (consistent > 0 && kCyclesPerConsistent * consistent >= tried) return Verdict::kConfirmed;
  return tried > 1 ? Verdict::kContradicted : Verdict::kUnknown;
}

Consensus::Verdict Consensus::JudgeBySquares(int edge, std::vector<int>& mark) const {
  const ConsensusEdge& e = problem_.edges[edge];
  const std::span<const Neighbour> at_i = NeighboursOf(e.i);
  const std::span<const Neighbour> at_j = NeighboursOf(e.j);
  const auto few = [](std::span<const Neighbour> all) {
    return all.first(std::min<std::size_t>(all.size(), kMaxNeighbours));
  };
  for (const Neighbour& n : few(at_j)) mark[n.view] = n.edge;
  int tried = 0;
  int consistent = 0;
  for (const Neighbour& n : few(at_i)) {
    if (n.view == e.j || consistent == kEnoughCycles) continue;
    const Eigen::Quaterniond to_neighbour = Along(n.edge, e.i);
    for (const Neighbour& m : few(NeighboursOf(n.view))) {
      const int back = m.view == e.i || m.view == e.j ? -1 : mark[m.view];
      if (back < 0) continue;
      const double variance = e.variance + problem_.edges[n.edge].variance +
                              problem_.edges[m.edge].variance + problem_.edges[back].variance;
      const Eigen::Quaterniond around =
          Along(back, m.view) * Along(m.edge, n.view) * to_neighbour * e.j_from_i.conjugate();
      const double tolerance = Tolerance(variance);
      if (!IsEvidence(tolerance)) continue;
      ++tried;
      if (SquaredAngle(around) <= tolerance && ++consistent == kEnoughCycles) break;
    }
  }
  for (const Neighbour& n : few(at_j)) mark[n.view] = -1;
  if (consistent > 0 && 2 * kCyclesPerConsistent * consistent >= tried) return Verdict::kConfirmed;
  return tried > 2 ? Verdict::kContradicted : Verdict::kUnknown;
}

void Consensus::JudgeByShortCycles() {
  const int num_chunks = (num_edges_ + kEdgesPerChunk - 1) / kEdgesPerChunk;
  ParallelFor(num_chunks, num_threads_, [&](int chunk) {
    std::vector<int> mark(static_cast<std::size_t>(problem_.num_views), -1);
    const int end = std::min(num_edges_, (chunk + 1) * kEdgesPerChunk);
    for (int edge = chunk * kEdgesPerChunk; edge < end; ++edge) {
      const Verdict by_triangles = JudgeByTriangles(edge);
      verdict_[edge] = by_triangles;
      if (by_triangles == Verdict::kConfirmed) continue;
      const Verdict by_squares = JudgeBySquares(edge, mark);
      if (by_squares != Verdict::kUnknown) verdict_[edge] = by_squares;
    }
  });
}

void Consensus::JudgeByStart() {
  for (int edge = 0; edge < num_edges_; ++edge) {
    const bool agrees = SquaredResidual(edge) <= Tolerance(problem_.edges[edge].variance);
    verdict_[edge] = agrees ? Verdict::kConfirmed : Verdict::kUnknown;
  }
}

// What confirmed edges tie together; the held views of a component are one piece.
void Consensus::FindPieces() {
  DisjointSets sets(problem_.num_views);
  for (int edge = 0; edge < num_edges_; ++edge) {
    if (IsConfirmed(edge)) sets.Join(problem_.edges[edge].i, problem_.edges[edge].j);
  }
  std::vector<int> held(static_cast<std::size_t>(problem_.num_views), -1);
  for (int view = 0; view < problem_.num_views; ++view) {
    if (problem_.is_held[view] == 0) continue;
    int& first = held[component_[view]];
    if (first < 0) first = view;
    sets.Join(first, view);
  }
  for (int view = 0; view < problem_.num_views; ++view) piece_[view] = sets.Find(view);
}

// The held views; in components without one, the view with the most confirmed edges.
std::vector<int> Consensus::Roots() const {
  std::vector<int> best(static_cast<std::size_t>(problem_.num_views), -1);
  std::vector<std::array<int, 2>> score(static_cast<std::size_t>(problem_.num_views), {-1, -1});
  std::vector<int> roots;
  for (int view = 0; view < problem_.num_views; ++view) {
    const int component = component_[view];
    if (problem_.is_held[view] != 0) {
      roots.push_back(view);
      best[component] = -2;
    }
    if (best[component] == -2) continue;
    const std::span<const Neighbour> neighbours = NeighboursOf(view);
    const auto confirmed = std::count_if(neighbours.begin(),
                                         neighbours.end(),
                                         [&](const Neighbour& n) { return IsConfirmed(n.edge); });
    const std::array<int, 2> here = {static_cast<int>(confirmed),
                                     static_cast<int>(neighbours.size())};
    if (here > score[component]) {
      score[component] = here;
      best[component] = view;
    }
  }
  for (const int view : best) {
    if (view >= 0) roots.push_back(view);
  }
  return roots;
}

void Consensus::Settle(int view, int edge) {
  Node& node = tree_[view];
  node.edge = edge;
  if (edge < 0) {
    node.jump = view;
    if (!problem_.has_start && problem_.is_held[view] == 0) {
      cam_from_world_[view] = Eigen::Quaterniond::Identity();
    }
    return;
  }
  const ConsensusEdge& e = problem_.edges[edge];
  node.parent = e.i == view ? e.j : e.i;
  const Node& parent = tree_[node.parent];
  const Node& jump = tree_[parent.jump];
  node.depth = parent.depth + 1;
  node.jump =
      parent.depth - jump.depth == jump.depth - tree_[jump.jump].depth ? jump.jump : node.parent;
  if (!problem_.has_start) {
    cam_from_world_[view] = (Along(edge, node.parent) * cam_from_world_[node.parent]).normalized();
  }
}

// Shortest paths. A piece is entered once: its views lie to each other as confirmed edges say.
// Trials from the first one on try other unconfirmed edges.
void Consensus::BuildTree(int trial) {
  tree_.assign(static_cast<std::size_t>(problem_.num_views), Node{});
  std::vector<char> is_settled(static_cast<std::size_t>(problem_.num_views), 0);
  std::vector<char> is_entered(static_cast<std::size_t>(problem_.num_views), 0);
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
  for (const int root : Roots()) queue.emplace(0, 0.0, root, -1);
  while (!queue.empty()) {
    const auto [path_class, variance, view, edge] = queue.top();
    queue.pop();
    if (is_settled[view] != 0) continue;
    if (edge >= 0 && !IsConfirmed(edge) && is_entered[piece_[view]] != 0) continue;
    is_settled[view] = 1;
    is_entered[piece_[view]] = 1;
    tree_[view].path_class = path_class;
    tree_[view].variance = variance;
    Settle(view, edge);
    for (const Neighbour& n : NeighboursOf(view)) {
      if (is_settled[n.view] != 0) continue;
      const Verdict verdict = verdict_[n.edge];
      if (verdict != Verdict::kConfirmed && is_entered[piece_[n.view]] != 0) continue;
      double extra = 0.0;
      if (verdict != Verdict::kConfirmed) {
        extra = verdict == Verdict::kUnknown ? kUnconfirmedClass : kContradictedClass;
        if (trial > 0) extra *= 0.5 + Hash(problem_.seed, trial, n.edge);
      }
      queue.emplace(path_class + extra, variance + problem_.edges[n.edge].variance, n.view, n.edge);
    }
  }
}

// -1 when the two hang on different roots.
int Consensus::CommonAncestor(int a, int b) const {
  while (tree_[a].depth != tree_[b].depth) {
    int& deeper = tree_[a].depth > tree_[b].depth ? a : b;
    const int depth = std::min(tree_[a].depth, tree_[b].depth);
    const Node& node = tree_[deeper];
    deeper = tree_[node.jump].depth >= depth ? node.jump : node.parent;
  }
  while (a != b) {
    if (tree_[a].depth == 0) return -1;
    const bool jumps = tree_[a].jump != tree_[b].jump;
    a = jumps ? tree_[a].jump : tree_[a].parent;
    b = jumps ? tree_[b].jump : tree_[b].parent;
  }
  return a;
}

double Consensus::PathVariance(int a, int b) const {
  const int common = CommonAncestor(a, b);
  const double to_common = common < 0 ? 0.0 : tree_[common].variance;
  return problem_.drift_factor * problem_.drift_factor *
         (tree_[a].variance + tree_[b].variance - 2.0 * to_common);
}

double Consensus::SquaredResidual(int edge) const {
  const ConsensusEdge& e = problem_.edges[edge];
  return SquaredAngle(cam_from_world_[e.j] * cam_from_world_[e.i].conjugate() *
                      e.j_from_i.conjugate());
}

bool Consensus::Agrees(int edge, bool needs_evidence) const {
  const ConsensusEdge& e = problem_.edges[edge];
  const double tolerance = Tolerance(e.variance + PathVariance(e.i, e.j));
  if (needs_evidence && !IsConfirmed(edge) && !IsEvidence(tolerance)) return false;
  return SquaredResidual(edge) <= tolerance;
}

// Edges outside the tree that agree with it confirm their cycles.
bool Consensus::ConfirmCycles() {
  DisjointSets confirmed_up(problem_.num_views);  // named by the view next to the root
  std::vector<int> top(static_cast<std::size_t>(problem_.num_views));
  std::iota(top.begin(), top.end(), 0);
  const auto climb = [&](int view) { return top[confirmed_up.Find(view)]; };
  bool is_new = false;
  for (int edge = 0; edge < num_edges_; ++edge) {
    const ConsensusEdge& e = problem_.edges[edge];
    if (IsConfirmed(edge) || tree_[e.i].edge == edge || tree_[e.j].edge == edge) continue;
    const double tolerance = Tolerance(e.variance + PathVariance(e.i, e.j));
    if (!IsEvidence(tolerance) || SquaredResidual(edge) > tolerance) continue;
    verdict_[edge] = Verdict::kConfirmed;
    is_new = true;
    const int common = CommonAncestor(e.i, e.j);
    const int depth = common < 0 ? 0 : tree_[common].depth;
    for (const int end : {e.i, e.j}) {
      for (int view = climb(end); tree_[view].depth > depth; view = climb(view)) {
        verdict_[tree_[view].edge] = Verdict::kConfirmed;
        const int above = climb(tree_[view].parent);
        confirmed_up.Join(view, tree_[view].parent);
        top[confirmed_up.Find(view)] = above;
      }
    }
  }
  return is_new;
}

// Edges between two pieces that agree on how these lie to each other.
bool Consensus::ConfirmByVotes() {
  std::vector<std::tuple<int, int, int>> between;  // piece, piece, edge
  for (int edge = 0; edge < num_edges_; ++edge) {
    const int a = piece_[problem_.edges[edge].i];
    const int b = piece_[problem_.edges[edge].j];
    if (a != b) between.emplace_back(std::min(a, b), std::max(a, b), edge);
  }
  std::sort(between.begin(), between.end());
  bool is_new = false;
  std::vector<int> edges;
  for (std::size_t begin = 0; begin < between.size();) {
    edges.clear();
    std::size_t end = begin;
    for (; end < between.size() && std::get<0>(between[end]) == std::get<0>(between[begin]) &&
           std::get<1>(between[end]) == std::get<1>(between[begin]);
         ++end) {
      edges.push_back(std::get<2>(between[end]));
    }
    if (edges.size() > 1) is_new |= ConfirmVotes(edges);
    begin = end;
  }
  return is_new;
}

bool Consensus::ConfirmVotes(std::vector<int>& edges) {
  if (edges.size() > kMaxVotes) edges.resize(kMaxVotes);
  struct Vote {
    int low;  // the edge's end in the piece of the lower number
    int high;
    Eigen::Quaterniond turn;  // of the higher piece's world against the lower one's
  };
  std::vector<Vote> votes;
  votes.reserve(edges.size());
  for (const int edge : edges) {
    const ConsensusEdge& e = problem_.edges[edge];
    const Eigen::Quaterniond turn =
        cam_from_world_[e.j].conjugate() * e.j_from_i * cam_from_world_[e.i];
    const bool flipped = piece_[e.i] > piece_[e.j];
    votes.push_back({flipped ? e.j : e.i, flipped ? e.i : e.j, flipped ? turn.conjugate() : turn});
  }
  const auto agree = [&](std::size_t a, std::size_t b) {
    const double tolerance = Tolerance(
        problem_.edges[edges[a]].variance + problem_.edges[edges[b]].variance +
        PathVariance(votes[a].low, votes[b].low) + PathVariance(votes[a].high, votes[b].high));
    return IsEvidence(tolerance) &&
           SquaredAngle(votes[a].turn.conjugate() * votes[b].turn) <= tolerance;
  };
  std::size_t best = 0;
  int best_count = 0;
  for (std::size_t a = 0; a < votes.size(); ++a) {
    int count = 1;
    for (std::size_t b = 0; b < votes.size(); ++b) count += a != b && agree(a, b);
    if (count > best_count) {
      best_count = count;
      best = a;
    }
  }
  if (best_count < 2 || kVotesPerAgreement * best_count < static_cast<int>(votes.size())) {
    return false;
  }
  for (std::size_t b = 0; b < votes.size(); ++b) {
    if (b == best || agree(best, b)) verdict_[edges[b]] = Verdict::kConfirmed;
  }
  return true;
}

void Consensus::ConfirmByTrees() {
  const int max_vain =
      std::clamp(static_cast<int>(kVainTreeEdges / num_edges_), kMinVainTrees, kMaxVainTrees);
  int vain = 0;
  for (int trial = 0; vain < max_vain; ++trial) {
    BuildTree(trial);
    const bool by_cycles = ConfirmCycles();
    if (by_cycles) FindPieces();
    const bool by_votes = ConfirmByVotes();
    if (by_votes) FindPieces();
    vain = by_cycles || by_votes ? 0 : vain + 1;
    const bool is_one =
        std::all_of(piece_.begin(), piece_.end(), [&](int piece) { return piece == piece_[0]; });
    if (is_one) break;
  }
}

ConsensusStart Consensus::Find() {
  if (problem_.has_start) {
    JudgeByStart();
    FindPieces();
  } else {
    JudgeByShortCycles();
    FindPieces();
    ConfirmByTrees();
  }
  BuildTree(0);
  ConsensusStart start;
  start.is_trusted.resize(problem_.edges.size());
  // Where cycles are short enough to tell right from wrong, long ones that prove nothing are not
  // believed.
  const auto confirmed = std::count(verdict_.begin(), verdict_.end(), Verdict::kConfirmed);
  const bool cycles_tell = !problem_.has_start && 2 * confirmed > num_edges_;
  for (int edge = 0; edge < num_edges_; ++edge) {
    start.is_trusted[edge] = Agrees(edge, cycles_tell) ? 1 : 0;
  }
  start.roots = Roots();
  start.cam_from_world = std::move(cam_from_world_);
  start.component = std::move(component_);
  return start;
}

}  // namespace

ConsensusStart FindConsensusStart(const ConsensusProblem& problem, int num_threads) {
  return Consensus(problem, num_threads).Find();
}

}  // namespace rotslam
