#include "apps/paper_method/paper_odometry.h"

#include <stdexcept>
#include <utility>

#include "apps/paper_method/spread_orb.h"
#include "rotodom/types/parallel.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

PaperGraphOptions GraphOptions(const PaperOdometryOptions& options) {
  PaperGraphOptions graph = options.graph;
  graph.averaging = options.odometry.averaging;
  graph.min_edge_inliers = options.odometry.view_graph.min_edge_inliers;
  graph.seed = options.seed;
  graph.num_threads = options.num_threads;
  return graph;
}

}  // namespace

PaperOdometry::PaperOdometry(const Camera& camera, const PaperOdometryOptions& options)
    : camera_(camera), options_(options), graph_(GraphOptions(options)) {
  if (const auto problem = camera.Problem()) throw std::invalid_argument("camera: " + *problem);
  if (const auto problem = options.odometry.Problem()) {
    throw std::invalid_argument("options: " + *problem);
  }
  if (options.use_loops) {
    loops_.emplace(options.vocabulary, options.candidates, options.odometry.matching);
  }
}

std::shared_ptr<const OrbView> PaperOdometry::Extract(FrameId frame, const MaskedImage& image) {
  const Stopwatch watch(seconds_.extraction);
  auto view = std::make_shared<OrbView>();
  view->frame = frame;
  if (image.image.empty()) return view;
  *view = ToOrbView(
      ExtractSpreadOrb(image, frame, camera_, options_.odometry.features, options_.num_threads));
  return view;
}

std::vector<PairMatches> PaperOdometry::MatchWithWindow(const OrbView& view) {
  const Stopwatch watch(seconds_.matching);
  std::vector<PairMatches> matches(window_.size());
  ParallelFor(static_cast<int>(window_.size()), options_.num_threads, [&](int k) {
    const OrbView& older = *window_[k];
    matches[k] = ToPairMatches(older, view, MatchInWindow(older, view, options_.odometry.matching));
  });
  return matches;
}

PaperGraph::Step PaperOdometry::Connect(FrameId frame, std::span<const PairMatches> matches) {
  const Stopwatch watch(seconds_.graph);
  return graph_.AddFrame(frame, matches);
}

PaperFrame PaperOdometry::AddFrame(FrameId frame, const MaskedImage& image) {
  PaperFrame result;
  result.frame = frame;
  const std::shared_ptr<const OrbView> view = Extract(frame, image);
  result.num_features = static_cast<int>(view->keypoints_px.size());
  const std::vector<PairMatches> matches = MatchWithWindow(*view);
  PaperGraph::Step step = Connect(frame, matches);
  result.edges = std::move(step.edges);
  result.predicted_only = step.predicted_only;
  if (loops_ && result.num_features > 0) FindLoops(view, result);
  result.cam_from_world = graph_.cam_from_world().at(frame);
  window_.push_front(view);
  if (static_cast<int>(window_.size()) > options_.odometry.view_graph.window_frames) {
    window_.pop_back();
  }
  return result;
}

void PaperOdometry::FindLoops(std::shared_ptr<const OrbView> view, PaperFrame& result) {
  const Stopwatch watch(seconds_.loops);
  std::vector<FrameId> neighbours;
  neighbours.reserve(result.edges.size());
  for (const RelativeRotation& edge : result.edges) neighbours.push_back(edge.i);
  const std::vector<PaperLoop> loops = loops_->AddFrame(std::move(view), neighbours);
  std::vector<PairMatches> matches;
  matches.reserve(loops.size());
  for (const PaperLoop& loop : loops) matches.push_back(loop.matches);
  const std::vector<std::optional<RelativeRotation>> verified = graph_.VerifyLoops(matches);
  std::vector<RelativeRotation> accepted;
  for (std::size_t k = 0; k < loops.size(); ++k) {
    LoopCheck& check = result.loops.emplace_back();
    check.frame = result.frame;
    check.match = loops[k].candidate.frame;
    check.score = loops[k].candidate.score;
    if (!verified[k]) continue;
    const Rotation& cam_i = graph_.cam_from_world().at(check.match);
    const Rotation& cam_j = graph_.cam_from_world().at(check.frame);
    check.num_inliers = verified[k]->num_inliers;
    check.angle_deg = (verified[k]->j_from_i * cam_i * cam_j.Inverse()).AngleDeg();
    check.scaled.angle_deg = check.angle_deg;
    check.accepted = true;
    check.num_edges = 1;
    accepted.push_back(*verified[k]);
    loops_->Join(check.match, check.frame);
  }
  graph_.CloseLoops(accepted);
  result.has_averaged = !accepted.empty();
}

}  // namespace rotslam
