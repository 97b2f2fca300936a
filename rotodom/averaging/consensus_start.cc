#include "rotodom/averaging/consensus_start.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "rotodom/averaging/consensus_graph.h"
#include "rotodom/averaging/consensus_tree.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {
namespace {

// Number of successive random trees without a new confirmation at which the search ends, by number
// of edges.
constexpr int kMaxVainTrees = 60;
constexpr int kMinVainTrees = 2;
constexpr double kVainTreeEdges = 2.5e5;
// Edges between two groups of confirmed views: largest number compared in pairs, and the inverse of
// the share that must agree.
constexpr int kMaxVotes = 64;
constexpr int kVotesPerAgreement = 4;
// Number of restarts, by number of edges, while the best tree contradicts more than this share of
// the edges; and the numbering offset of trials between restarts.
constexpr int kMaxBeginnings = 5;
constexpr double kBeginningEdges = 2e4;
constexpr double kLittleContradiction = 0.15;
constexpr int kTrialsPerBeginning = 1000;

class Consensus {
 public:
  Consensus(const ConsensusProblem& problem, int num_threads)
      : problem_(problem),
        graph_(problem),
        num_threads_(num_threads),
        component_(graph_.Components()),
        cam_from_world_(problem.cam_from_world) {}
  ConsensusStart Find();

 private:
  bool IsConfirmed(int edge) const { return knowledge_.IsConfirmed(edge); }
  void Confirm(int edge) { knowledge_.verdict[edge] = EdgeVerdict::kConfirmed; }
  void ClassifyByStart();
  void FindPieces();
  std::vector<int> Roots() const;
  ConsensusTree BuildTree(int trial);
  double SquaredResidual(int edge) const;
  // Tolerance of an edge's residual against orientations along the tree.
  double ToleranceIn(const ConsensusTree& tree, int edge) const;
  bool Agrees(const ConsensusTree& tree, int edge, bool needs_evidence) const;
  bool ConfirmCycles(const ConsensusTree& tree);
  bool ConfirmByVotes(const ConsensusTree& tree);
  bool ConfirmVotes(const ConsensusTree& tree, std::vector<int>& edges);
  void ConfirmByTrees(int first_trial);
  void ConfirmByBestTrees();
  double ContradictionOf(const ConsensusTree& tree) const;

  const ConsensusProblem& problem_;
  ConsensusGraph graph_;
  int num_threads_;
  std::vector<int> component_;
  EdgeKnowledge knowledge_;
  std::vector<Eigen::Quaterniond> cam_from_world_;
};

void Consensus::ClassifyByStart() {
  knowledge_.verdict.resize(problem_.edges.size());
  for (int edge = 0; edge < graph_.num_edges(); ++edge) {
    const bool agrees = SquaredResidual(edge) <= graph_.Tolerance(graph_.edge(edge).variance);
    knowledge_.verdict[edge] = agrees ? EdgeVerdict::kConfirmed : EdgeVerdict::kUnknown;
  }
}

// Groups views that confirmed edges connect. The fixed views of a component form one group.
void Consensus::FindPieces() {
  DisjointSets sets(problem_.num_views);
  for (int edge = 0; edge < graph_.num_edges(); ++edge) {
    if (IsConfirmed(edge)) sets.Join(graph_.edge(edge).i, graph_.edge(edge).j);
  }
  std::vector<int> held(static_cast<std::size_t>(problem_.num_views), -1);
  for (int view = 0; view < problem_.num_views; ++view) {
    if (problem_.is_held[view] == 0) continue;
    int& first = held[component_[view]];
    if (first < 0) first = view;
    sets.Join(first, view);
  }
  knowledge_.piece.resize(static_cast<std::size_t>(problem_.num_views));
  for (int view = 0; view < problem_.num_views; ++view) knowledge_.piece[view] = sets.Find(view);
}

// The fixed views; in components without one the view with the most confirmed edges.
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
    const std::span<const ConsensusGraph::Neighbour> neighbours = graph_.NeighboursOf(view);
    const auto confirmed = std::count_if(
        neighbours.begin(), neighbours.end(), [&](const auto& n) { return IsConfirmed(n.edge); });
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

// Builds the tree and the orientations along it, unless these are given.
ConsensusTree Consensus::BuildTree(int trial) {
  ConsensusTree tree(graph_, knowledge_, Roots(), trial);
  if (!problem_.has_start) tree.Chain(cam_from_world_);
  return tree;
}

double Consensus::SquaredResidual(int edge) const {
  const ConsensusEdge& e = graph_.edge(edge);
  return SquaredAngle(cam_from_world_[e.j] * cam_from_world_[e.i].conjugate() *
                      e.j_from_i.conjugate());
}

double Consensus::ToleranceIn(const ConsensusTree& tree, int edge) const {
  const ConsensusEdge& e = graph_.edge(edge);
  return graph_.Tolerance(e.variance + tree.PathVariance(e.i, e.j));
}

bool Consensus::Agrees(const ConsensusTree& tree, int edge, bool needs_evidence) const {
  const double tolerance = ToleranceIn(tree, edge);
  if (needs_evidence && !IsConfirmed(edge) && !IsEvidence(tolerance)) return false;
  return SquaredResidual(edge) <= tolerance;
}

// Confirms the cycles of edges outside the tree that agree with it.
bool Consensus::ConfirmCycles(const ConsensusTree& tree) {
  DisjointSets confirmed_up(problem_.num_views);  // named by the view next to the root
  std::vector<int> top(static_cast<std::size_t>(problem_.num_views));
  std::iota(top.begin(), top.end(), 0);
  const auto climb = [&](int view) { return top[confirmed_up.Find(view)]; };
  bool is_new = false;
  for (int edge = 0; edge < graph_.num_edges(); ++edge) {
    const ConsensusEdge& e = graph_.edge(edge);
    if (IsConfirmed(edge) || tree.Has(edge)) continue;
    const double tolerance = ToleranceIn(tree, edge);
    if (!IsEvidence(tolerance) || SquaredResidual(edge) > tolerance) continue;
    Confirm(edge);
    is_new = true;
    const int common = tree.CommonAncestor(e.i, e.j);
    const int depth = common < 0 ? 0 : tree.DepthOf(common);
    for (const int end : {e.i, e.j}) {
      for (int view = climb(end); tree.DepthOf(view) > depth; view = climb(view)) {
        Confirm(tree.EdgeAbove(view));
        const int above = climb(tree.ParentOf(view));
        confirmed_up.Join(view, tree.ParentOf(view));
        top[confirmed_up.Find(view)] = above;
      }
    }
  }
  return is_new;
}

// Confirms edges between two groups that agree on the rotation between the groups.
bool Consensus::ConfirmByVotes(const ConsensusTree& tree) {
  std::vector<std::tuple<int, int, int>> between;  // piece, piece, edge
  for (int edge = 0; edge < graph_.num_edges(); ++edge) {
    const int a = knowledge_.piece[graph_.edge(edge).i];
    const int b = knowledge_.piece[graph_.edge(edge).j];
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
    if (edges.size() > 1) is_new |= ConfirmVotes(tree, edges);
    begin = end;
  }
  return is_new;
}

bool Consensus::ConfirmVotes(const ConsensusTree& tree, std::vector<int>& edges) {
  if (edges.size() > kMaxVotes) edges.resize(kMaxVotes);
  struct Vote {
    int low;  // the edge's end in the piece of the lower number
    int high;
    Eigen::Quaterniond turn;  // of the higher piece's world against the lower one's
  };
  std::vector<Vote> votes;
  votes.reserve(edges.size());
  for (const int edge : edges) {
    const ConsensusEdge& e = graph_.edge(edge);
    const Eigen::Quaterniond turn =
        cam_from_world_[e.j].conjugate() * e.j_from_i * cam_from_world_[e.i];
    const bool flipped = knowledge_.piece[e.i] > knowledge_.piece[e.j];
    votes.push_back({flipped ? e.j : e.i, flipped ? e.i : e.j, flipped ? turn.conjugate() : turn});
  }
  const auto agree = [&](std::size_t a, std::size_t b) {
    const double tolerance =
        graph_.Tolerance(graph_.edge(edges[a]).variance + graph_.edge(edges[b]).variance +
                         tree.PathVariance(votes[a].low, votes[b].low) +
                         tree.PathVariance(votes[a].high, votes[b].high));
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
    if (b == best || agree(best, b)) Confirm(edges[b]);
  }
  return true;
}

void Consensus::ConfirmByTrees(int first_trial) {
  const int max_vain = std::clamp(
      static_cast<int>(kVainTreeEdges / graph_.num_edges()), kMinVainTrees, kMaxVainTrees);
  int vain = 0;
  for (int trial = first_trial; vain < max_vain; ++trial) {
    const ConsensusTree tree = BuildTree(trial);
    const bool by_cycles = ConfirmCycles(tree);
    if (by_cycles) FindPieces();
    const bool by_votes = ConfirmByVotes(tree);
    if (by_votes) FindPieces();
    vain = by_cycles || by_votes ? 0 : vain + 1;
    const std::vector<int>& piece = knowledge_.piece;
    if (std::all_of(piece.begin(), piece.end(), [&](int one) { return one == piece[0]; })) break;
  }
}

// Some of many long cycles of wrong edges close by chance, and the confirmations persist. Other
// trees have other cycles, and the right one contradicts fewer edges.
void Consensus::ConfirmByBestTrees() {
  if (graph_.num_edges() == 0) return;
  const int max_beginnings =
      std::min(static_cast<int>(kBeginningEdges / graph_.num_edges()), kMaxBeginnings);
  if (max_beginnings < 2) {
    ConfirmByTrees(0);
    return;
  }
  const EdgeKnowledge by_short_cycles = knowledge_;
  EdgeKnowledge best;
  double least_doubt = std::numeric_limits<double>::infinity();
  for (int k = 0; k < max_beginnings && least_doubt > kLittleContradiction; ++k) {
    knowledge_ = by_short_cycles;
    ConfirmByTrees(k * kTrialsPerBeginning);
    const double doubt = ContradictionOf(BuildTree(0));
    if (doubt >= least_doubt) continue;
    least_doubt = doubt;
    best = knowledge_;
  }
  knowledge_ = std::move(best);
}

// Share of the edges that contradict a tree; inaccurate ones count in part.
double Consensus::ContradictionOf(const ConsensusTree& tree) const {
  constexpr double kLeastTolerance = kLargestEvidence_rad * kLargestEvidence_rad;
  double sum = 0.0;
  for (int edge = 0; edge < graph_.num_edges(); ++edge) {
    const double tolerance = std::max(kLeastTolerance, ToleranceIn(tree, edge));
    sum += std::min(1.0, SquaredResidual(edge) / tolerance);
  }
  return sum / graph_.num_edges();
}

ConsensusStart Consensus::Find() {
  if (problem_.has_start) {
    ClassifyByStart();
    FindPieces();
  } else {
    knowledge_.verdict = ClassifyByShortCycles(graph_, num_threads_);
    FindPieces();
    ConfirmByBestTrees();
  }
  const ConsensusTree tree = BuildTree(0);
  ConsensusStart start;
  start.is_trusted.resize(problem_.edges.size());
  // Where short cycles classify the edges, long cycles, which are no evidence, are not used.
  const auto confirmed =
      std::count(knowledge_.verdict.begin(), knowledge_.verdict.end(), EdgeVerdict::kConfirmed);
  const bool cycles_tell = !problem_.has_start && 2 * confirmed > graph_.num_edges();
  for (int edge = 0; edge < graph_.num_edges(); ++edge) {
    start.is_trusted[edge] = Agrees(tree, edge, cycles_tell) ? 1 : 0;
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
