#include "krot/pure_rotation_segments.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

#include <Eigen/Dense>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// Of some edges: how many there are and how many of them show no baseline, or no turn.
struct Votes {
  int edges = 0;
  int agreeing = 0;

  void Add(bool agrees) {
    ++edges;
    agreeing += agrees;
  }
  double Ratio() const { return edges == 0 ? 0.0 : static_cast<double>(agreeing) / edges; }
};

// The votes of the edges of the highest rank.
struct Evidence {
  int rank = std::numeric_limits<int>::min();
  Votes votes;

  void Add(int edge_rank, bool agrees) {
    if (edge_rank < rank) return;
    if (edge_rank > rank) *this = {edge_rank, {}};
    votes.Add(agrees);
  }
};

// An edge by the positions of its frames.
struct Edge {
  int first;
  int last;
  const RelativeRotation* measurement;

  int Span() const { return last - first; }
};

// Frames by position, both included.
struct Run {
  int first;
  int last;

  int NumFrames() const { return last - first + 1; }
  bool Contains(int frame) const { return first <= frame && frame <= last; }
  bool Contains(const Edge& edge) const { return first <= edge.first && edge.last <= last; }
};

// Step n leads from frame n-1 to frame n.
std::vector<double> StepRatios(int num_frames, const std::vector<Edge>& edges, int max_span) {
  std::vector<Evidence> steps(num_frames);
  for (const Edge& edge : edges) {
    // Long edges before short ones, but not too long ones.
    const int rank = edge.Span() <= max_span ? edge.Span() : -edge.Span();
    for (int n = edge.first + 1; n <= edge.last; ++n) {
      steps[n].Add(rank, edge.measurement->rotation_only);
    }
  }
  std::vector<double> ratios;
  ratios.reserve(steps.size());
  for (const Evidence& step : steps) ratios.push_back(step.votes.Ratio());
  return ratios;
}

// Runs of at least two frames whose steps all fulfil `is_held`, within `within`.
template <class IsHeld>
std::vector<Run> RunsOf(const Run& within, const IsHeld& is_held) {
  std::vector<Run> runs;
  for (int n = within.first + 1; n <= within.last; ++n) {
    if (!is_held(n)) continue;
    const int first = n - 1;
    while (n <= within.last && is_held(n)) ++n;
    runs.push_back({first, n - 1});
  }
  return runs;
}

class Search {
 public:
  Search(int num_frames, std::vector<Edge> edges, const PureRotationOptions& options)
      : num_frames_(num_frames),
        edges_(std::move(edges)),
        options_(options),
        step_ratio_(StepRatios(num_frames, edges_, options.max_edge_span)) {}

  std::vector<Run> FindRuns() const {
    const std::vector<Run> runs = RunsOf({0, num_frames_ - 1}, [&](int n) {
      return step_ratio_[n] >= options_.min_rotation_only_ratio;
    });
    std::vector<Run> pieces;
    for (const Run& run : Joined(runs)) {
      for (const Run& piece : Checked(run)) {
        if (piece.NumFrames() >= options_.min_frames) pieces.push_back(piece);
      }
    }
    return pieces;
  }

  double EvidenceOf(const Run& run) const {
    if (run.first == run.last) return 0.0;
    double sum = 0.0;
    for (int n = run.first + 1; n <= run.last; ++n) sum += step_ratio_[n];
    return sum / (run.last - run.first);
  }

  // Where the camera does not turn either.
  std::vector<Run> StillRuns(const Run& run) const {
    std::vector<Votes> steps(num_frames_);
    for (const Edge& edge : edges_) {
      if (!run.Contains(edge) || edge.Span() > options_.max_edge_span) continue;
      const bool is_still = IsStill(*edge.measurement);
      for (int n = edge.first + 1; n <= edge.last; ++n) steps[n].Add(is_still);
    }
    std::vector<Run> runs =
        RunsOf(run, [&](int n) { return steps[n].Ratio() >= options_.min_rotation_only_ratio; });
    std::erase_if(runs, [&](const Run& still) { return still.NumFrames() < options_.min_frames; });
    return runs;
  }

 private:
  bool Holds(const Votes& votes) const { return votes.Ratio() >= options_.min_rotation_only_ratio; }

  bool IsStill(const RelativeRotation& edge) const {
    const Eigen::Vector3d turn = edge.j_from_i.Log();
    const double squared = turn.dot(edge.covariance.inverse() * turn);
    return squared <= options_.still_sigmas * options_.still_sigmas;
  }

  // Runs over whose gaps direct edges see no baseline.
  std::vector<Run> Joined(const std::vector<Run>& runs) const {
    std::vector<Run> joined;
    for (const Run& run : runs) {
      if (!joined.empty() && run.first - joined.back().last <= options_.max_gap &&
          Holds(VotesBetween(joined.back(), run))) {
        joined.back().last = run.last;
      } else {
        joined.push_back(run);
      }
    }
    return joined;
  }

  Votes VotesBetween(const Run& a, const Run& b) const {
    Votes votes;
    for (const Edge& edge : edges_) {
      if (a.Contains(edge.first) && b.Contains(edge.last))
        votes.Add(edge.measurement->rotation_only);
    }
    return votes;
  }

  // The parts of a run of whose edges none but a minority contradicts.
  std::vector<Run> Checked(Run run) const {
    run = Trimmed(run);
    if (run.NumFrames() < options_.min_frames) return {};
    // A few long edges may err together.
    constexpr int kEnough = 3;
    std::vector<Votes> steps(num_frames_);
    for (const Edge& edge : edges_) {
      if (!run.Contains(edge) || edge.Span() <= options_.max_edge_span) continue;
      for (int n = edge.first + 1; n <= edge.last; ++n) {
        steps[n].Add(edge.measurement->rotation_only);
      }
    }
    std::vector<Run> parts =
        RunsOf(run, [&](int n) { return steps[n].edges < kEnough || Holds(steps[n]); });
    if (parts.size() == 1 && parts.front().NumFrames() == run.NumFrames()) return parts;
    std::vector<Run> pieces;
    for (const Run& part : parts) {
      for (const Run& piece : Checked(part)) pieces.push_back(piece);
    }
    return pieces;
  }

  // Without the frames at the ends that stand elsewhere than most of those they see.
  Run Trimmed(Run run) const {
    while (run.NumFrames() >= options_.min_frames) {
      Votes first;
      Votes last;
      for (const Edge& edge : edges_) {
        if (!run.Contains(edge)) continue;
        if (edge.first == run.first) first.Add(edge.measurement->rotation_only);
        if (edge.last == run.last) last.Add(edge.measurement->rotation_only);
      }
      const bool keep_first = Holds(first);
      const bool keep_last = Holds(last);
      if (keep_first && keep_last) break;
      if (!keep_first) ++run.first;
      if (!keep_last) --run.last;
    }
    return run;
  }

  int num_frames_;
  std::vector<Edge> edges_;
  const PureRotationOptions& options_;
  std::vector<double> step_ratio_;
};

}  // namespace

std::optional<std::string> PureRotationOptions::Problem() const {
  if (!(min_rotation_only_ratio > 0.0 && min_rotation_only_ratio <= 1.0)) {
    return OutOfRange("min_rotation_only_ratio", min_rotation_only_ratio, "above 0 and at most 1");
  }
  if (max_edge_span < 1) return OutOfRange("max_edge_span", max_edge_span, "at least 1");
  if (max_gap < 0) return OutOfRange("max_gap", max_gap, "at least 0");
  if (min_frames < 2) return OutOfRange("min_frames", min_frames, "at least 2");
  if (!(still_sigmas > 0.0)) return OutOfRange("still_sigmas", still_sigmas, "positive");
  return std::nullopt;
}

namespace {

// The frames in order and their edges.
struct OrderedEdges {
  std::vector<FrameId> frames;
  std::vector<Edge> edges;
};

OrderedEdges OrderedEdgesOf(const ViewGraph& graph, const RotationMap& cam_from_world) {
  OrderedEdges ordered;
  std::map<FrameId, int> position;
  for (const auto& [frame, rotation] : cam_from_world) {
    position[frame] = static_cast<int>(ordered.frames.size());
    ordered.frames.push_back(frame);
  }
  ordered.edges.reserve(graph.edges().size());
  for (const RelativeRotation& edge : graph.edges()) {
    if (!position.contains(edge.i) || !position.contains(edge.j)) {
      throw std::invalid_argument(
          "FindPureRotationSegments: an edge names a frame without orientation");
    }
    ordered.edges.push_back({position.at(edge.i), position.at(edge.j), &edge});
  }
  return ordered;
}

void RequireValid(const PureRotationOptions& options) {
  if (const auto problem = options.Problem())
    throw std::invalid_argument("PureRotationOptions: " + *problem);
}

PureRotationSegment SegmentOf(const Run& run,
                              const std::vector<FrameId>& frames,
                              const Search& search) {
  PureRotationSegment segment = {frames[run.first], frames[run.last], search.EvidenceOf(run), {}};
  for (const Run& still : search.StillRuns(run)) {
    segment.still.push_back({frames[still.first], frames[still.last]});
  }
  return segment;
}

}  // namespace

std::vector<PureRotationSegment> FindPureRotationSegments(const ViewGraph& graph,
                                                          const RotationMap& cam_from_world,
                                                          const PureRotationOptions& options) {
  RequireValid(options);
  if (!options.enabled || cam_from_world.empty()) return {};
  OrderedEdges ordered = OrderedEdgesOf(graph, cam_from_world);
  const Search search(static_cast<int>(ordered.frames.size()), std::move(ordered.edges), options);
  std::vector<PureRotationSegment> segments;
  for (const Run& run : search.FindRuns()) {
    segments.push_back(SegmentOf(run, ordered.frames, search));
  }
  return segments;
}

PureRotationSegment AllFramesAsSegment(const ViewGraph& graph,
                                       const RotationMap& cam_from_world,
                                       const PureRotationOptions& options) {
  RequireValid(options);
  OrderedEdges ordered = OrderedEdgesOf(graph, cam_from_world);
  const int num_frames = static_cast<int>(ordered.frames.size());
  const Search search(num_frames, std::move(ordered.edges), options);
  return SegmentOf({0, num_frames - 1}, ordered.frames, search);
}

}  // namespace rotslam
