#include "rotodom/loop/looped_orientations.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "rotodom/averaging/global_averaging.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {

LoopedOrientations::LoopedOrientations(const AveragingOptions& averaging,
                                       const LoopOptions& loops,
                                       bool keep_features,
                                       int num_threads)
    : averaging_options_(averaging),
      min_correction_deg_(loops.min_correction_deg),
      handover_frames_(loops.handover_frames),
      keep_features_(keep_features),
      num_threads_(num_threads) {}

void LoopedOrientations::BeginFrame(FrameEstimate& estimate) {
  if (odometry_from_world_) {
    estimate.cam_from_world = estimate.cam_from_world * *odometry_from_world_;
    std::erase_if(estimate.window, [&](const auto& entry) { return entry.first <= settled_; });
    for (auto& [view, rotation] : estimate.window) rotation = rotation * *odometry_from_world_;
  }
  newest_ = estimate.frame;
  result_.cam_from_world[newest_] = estimate.cam_from_world;
}

void LoopedOrientations::AddFrame(FrameEstimate estimate) {
  if (estimate.report.weak) {
    const RelativeRotation& edge = estimate.connections.front().edge;
    weak_edges_.emplace(edge.i, edge.j);
  } else {
    for (const EdgeWithMatches& connection : estimate.connections) {
      pieces_.Join(connection.edge.i.value, connection.edge.j.value);
    }
  }
  result_.Add(std::move(estimate), keep_features_);
}

void LoopedOrientations::AddLoop(std::vector<EdgeWithMatches> connections) {
  if (connections.empty()) return;
  const RelativeRotation& best = connections.front().edge;
  AlignPieces(best);
  open_loops_.push_back(best);
  has_loops_ = true;
  for (EdgeWithMatches& connection : connections) {
    pieces_.Join(connection.edge.i.value, connection.edge.j.value);
    result_.graph.AddEdge(connection.edge);
    if (keep_features_) result_.edge_matches.push_back(std::move(connection.matches));
  }
}

void LoopedOrientations::AddMatches(std::vector<EdgeMatches> matches) {
  if (!keep_features_) return;
  std::move(matches.begin(), matches.end(), std::back_inserter(result_.edge_matches));
}

bool LoopedOrientations::EndFrame() {
  if (averaging_ && --averaging_->frames_left == 0) EndAveraging();
  if (!averaging_ && NeedsAveraging()) {
    BeginAveraging();
    if (handover_frames_ == 0) EndAveraging();
  }
  return std::exchange(has_moved_, false);
}

void LoopedOrientations::Finish() {
  if (averaging_) EndAveraging();
  if (!has_loops_) return;
  BeginAveraging();
  EndAveraging();
}

void LoopedOrientations::AlignPieces(const RelativeRotation& loop) {
  const int piece_i = pieces_.Find(loop.i.value);
  const int piece_j = pieces_.Find(loop.j.value);
  if (piece_i == piece_j) return;
  // A running averaging has the old orientations of the component.
  if (averaging_) EndAveraging();
  RotationMap& cam_from_world = result_.cam_from_world;
  const Rotation world_j_from_i =
      cam_from_world.at(loop.j).Inverse() * (loop.j_from_i * cam_from_world.at(loop.i));
  // The world remains that of the first frame.
  const int later_piece = std::max(piece_i, piece_j);
  const Rotation old_from_new_world =
      later_piece == piece_j ? world_j_from_i : world_j_from_i.Inverse();
  for (auto& [frame, rotation] : cam_from_world) {
    if (pieces_.Find(frame.value) == later_piece) rotation = rotation * old_from_new_world;
  }
  const bool is_newest = pieces_.Find(newest_.value) == later_piece;
  TurnOdometry(is_newest ? old_from_new_world : Rotation(), newest_);
  has_aligned_ = true;
}

void LoopedOrientations::TurnOdometry(const Rotation& old_from_new_world, FrameId settled) {
  odometry_from_world_ = odometry_from_world_.value_or(Rotation()) * old_from_new_world;
  settled_ = settled;
  has_moved_ = true;
}

bool LoopedOrientations::NeedsAveraging() const {
  const RotationMap& cam_from_world = result_.cam_from_world;
  return has_aligned_ || std::any_of(open_loops_.begin(), open_loops_.end(), [&](const auto& loop) {
           const Rotation j_from_i =
               cam_from_world.at(loop.j) * cam_from_world.at(loop.i).Inverse();
           return (loop.j_from_i * j_from_i.Inverse()).AngleDeg() >= min_correction_deg_;
         });
}

std::vector<RelativeRotation> LoopedOrientations::ReliableEdges() const {
  std::vector<RelativeRotation> edges;
  edges.reserve(result_.graph.edges().size());
  for (const RelativeRotation& edge : result_.graph.edges()) {
    if (!weak_edges_.contains({edge.i, edge.j})) edges.push_back(edge);
  }
  DisjointSets joined = pieces_;
  for (const auto& [i, j] : weak_edges_) {
    if (joined.Join(i.value, j.value)) edges.push_back(*result_.graph.FindEdge(i, j));
  }
  return edges;
}

void LoopedOrientations::BeginAveraging() {
  open_loops_.clear();
  has_aligned_ = false;
  const bool has_own_thread = handover_frames_ > 0 && num_threads_ > 1;
  auto average = [edges = ReliableEdges(),
                  start = result_.cam_from_world,
                  options = averaging_options_,
                  num_threads = has_own_thread ? 1 : num_threads_] {
    Averaged averaged;
    {
      const Stopwatch stopwatch(averaged.seconds);
      averaged.cam_from_world = CloseLoops(edges, start, options, num_threads).cam_from_world;
    }
    return averaged;
  };
  const auto launch = has_own_thread ? std::launch::async : std::launch::deferred;
  averaging_ = Averaging{std::async(launch, std::move(average)), handover_frames_};
}

void LoopedOrientations::EndAveraging() {
  std::future<Averaged> pending = std::move(averaging_->averaged);
  averaging_.reset();
  const Averaged averaged = pending.get();
  averaging_seconds_ += averaged.seconds;
  RotationMap& cam_from_world = result_.cam_from_world;
  const auto& [last, last_from_world] = *averaged.cam_from_world.rbegin();
  const Rotation old_from_new_world = cam_from_world.at(last).Inverse() * last_from_world;
  for (auto later = cam_from_world.upper_bound(last); later != cam_from_world.end(); ++later) {
    later->second = later->second * old_from_new_world;
  }
  for (const auto& [view, rotation] : averaged.cam_from_world) cam_from_world[view] = rotation;
  TurnOdometry(old_from_new_world, last);
}

}  // namespace rotslam
