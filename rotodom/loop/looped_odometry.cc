#include "rotodom/loop/looped_odometry.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "rotodom/averaging/global_averaging.h"
#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/pieces.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// Without the weak edges whose views are joined by better ones: chance may have made them.
ViewGraph WithoutWeakCycles(const ViewGraph& graph,
                            const std::set<std::pair<FrameId, FrameId>>& weak_edges) {
  ViewGraph strong;
  Pieces pieces;
  for (const RelativeRotation& edge : graph.edges()) {
    if (weak_edges.contains({edge.i, edge.j})) continue;
    strong.AddEdge(edge);
    pieces.Join(edge.i, edge.j);
  }
  for (const auto& [i, j] : weak_edges) {
    if (pieces.Join(i, j)) strong.AddEdge(*graph.FindEdge(i, j));
  }
  return strong;
}

}  // namespace

LoopedOdometry::LoopedOdometry(const Camera& camera,
                               const OdometryOptions& odometry,
                               const LoopOptions& loops,
                               std::shared_ptr<const Vocabulary> vocabulary,
                               bool keep_features,
                               std::uint64_t seed,
                               int num_threads)
    : odometry_(camera, odometry, seed, num_threads),
      averaging_(odometry.averaging),
      min_correction_deg_(loops.min_correction_deg),
      keep_features_(keep_features),
      num_threads_(num_threads) {
  // Chained orientations are what the odometry gives when nothing is averaged.
  if (!loops.use_loops || odometry.averaging.mode == "off") return;
  if (!vocabulary) vocabulary = std::make_shared<const Vocabulary>(DefaultVocabulary());
  closure_.emplace(camera, loops, odometry, std::move(vocabulary), seed, num_threads);
}

LoopedEstimate LoopedOdometry::AddFrame(FrameId frame, double timestamp_s, const cv::Mat& image) {
  FrameEstimate estimate = odometry_.AddFrame(frame, timestamp_s, image);
  newest_ = {frame, estimate.cam_from_world};
  if (odometry_from_world_) {
    // What was averaged with all others the odometry knows less of.
    std::erase_if(estimate.window,
                  [&](const auto& entry) { return entry.first <= last_averaged_; });
    for (auto& [view, rotation] : estimate.window) rotation = rotation * *odometry_from_world_;
    estimate.cam_from_world = estimate.cam_from_world * *odometry_from_world_;
  }

  LoopedEstimate looped;
  looped.frame = frame;
  looped.covariance = estimate.covariance;
  looped.report = estimate.report;
  if (estimate.report.weak) {
    const RelativeRotation& edge = estimate.connections.front().edge;
    weak_edges_.emplace(edge.i, edge.j);
  }
  if (closure_) {
    result_.cam_from_world[frame] = estimate.cam_from_world;
    LoopReport loops = closure_->AddFrame(estimate, image, result_.cam_from_world);
    result_.Add(std::move(estimate), keep_features_);
    looped.has_averaged = Close(loops);
    looped.loops = std::move(loops.checks);
  } else {
    result_.Add(std::move(estimate), keep_features_);
  }
  looped.cam_from_world = result_.cam_from_world.at(frame);
  return looped;
}

std::vector<LoopCheck> LoopedOdometry::Finish() {
  LoopReport loops;
  if (closure_) loops = closure_->Finish(result_.cam_from_world);
  Close(loops);
  if (has_loops_) AverageAll();
  // Orientations still in the window have not been said to be settled.
  int count = 0;
  for (auto entry = result_.cam_from_world.rbegin();
       entry != result_.cam_from_world.rend() && count < averaging_.window;
       ++entry, ++count) {
    if (const auto covariance = odometry_.CovarianceOf(entry->first)) {
      result_.covariance[entry->first] = *covariance;
    }
  }
  return loops.checks;
}

void LoopedOdometry::AlignPieces(const RelativeRotation& loop) {
  Pieces pieces;
  for (const RelativeRotation& edge : result_.graph.edges()) {
    if (!weak_edges_.contains({edge.i, edge.j})) pieces.Join(edge.i, edge.j);
  }
  const FrameId piece_i = pieces.Of(loop.i);
  const FrameId piece_j = pieces.Of(loop.j);
  if (piece_i == piece_j) return;
  // The piece that began later is turned: the world stays that of the first frame.
  RotationMap& cam_from_world = result_.cam_from_world;
  const Rotation world_j_from_i =
      cam_from_world.at(loop.j).Inverse() * (loop.j_from_i * cam_from_world.at(loop.i));
  const Rotation turn = piece_i < piece_j ? world_j_from_i : world_j_from_i.Inverse();
  for (auto& [frame, rotation] : cam_from_world) {
    if (pieces.Of(frame) == std::max(piece_i, piece_j)) rotation = rotation * turn;
  }
}

bool LoopedOdometry::Close(LoopReport& loops) {
  // The best edge comes first.
  if (!loops.connections.empty()) AlignPieces(loops.connections.front().edge);
  for (Connection& connection : loops.connections) {
    result_.graph.AddEdge(connection.edge);
    if (keep_features_) result_.edge_matches.push_back(std::move(connection.matches));
  }
  has_loops_ = has_loops_ || !loops.connections.empty();
  const bool is_large =
      std::any_of(loops.checks.begin(), loops.checks.end(), [&](const LoopCheck& check) {
        return check.accepted && check.angle_deg >= min_correction_deg_;
      });
  if (is_large) AverageAll();
  return is_large;
}

void LoopedOdometry::AverageAll() {
  const Stopwatch stopwatch(averaging_seconds_);
  const RotationMap averaged = CloseLoops(WithoutWeakCycles(result_.graph, weak_edges_),
                                          result_.cam_from_world,
                                          averaging_,
                                          num_threads_)
                                   .cam_from_world;
  for (const auto& [view, rotation] : averaged) result_.cam_from_world[view] = rotation;
  const auto& [newest, cam_from_odometry] = newest_;
  odometry_from_world_ = cam_from_odometry.Inverse() * result_.cam_from_world.at(newest);
  last_averaged_ = newest;
}

}  // namespace rotslam
