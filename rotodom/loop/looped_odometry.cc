#include "rotodom/loop/looped_odometry.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "rotodom/averaging/global_averaging.h"
#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {

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
  for (auto& [view, rotation] : estimate.window) rotation = rotation * odometry_from_world_;
  estimate.cam_from_world = estimate.cam_from_world * odometry_from_world_;

  LoopedEstimate looped;
  looped.frame = frame;
  looped.covariance = estimate.covariance;
  looped.report = estimate.report;
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
  if (has_new_loops_) AverageAll();
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

bool LoopedOdometry::Close(LoopReport& loops) {
  for (Connection& connection : loops.connections) {
    result_.graph.AddEdge(connection.edge);
    if (keep_features_) result_.edge_matches.push_back(std::move(connection.matches));
  }
  has_new_loops_ = has_new_loops_ || !loops.connections.empty();
  const bool is_large =
      std::any_of(loops.checks.begin(), loops.checks.end(), [&](const LoopCheck& check) {
        return check.accepted && check.angle_deg >= min_correction_deg_;
      });
  if (is_large) AverageAll();
  return is_large;
}

void LoopedOdometry::AverageAll() {
  const Stopwatch stopwatch(averaging_seconds_);
  const RotationMap averaged =
      CloseLoops(result_.graph, result_.cam_from_world, averaging_, num_threads_).cam_from_world;
  for (const auto& [view, rotation] : averaged) result_.cam_from_world[view] = rotation;
  const auto& [newest, cam_from_odometry] = newest_;
  odometry_from_world_ = cam_from_odometry.Inverse() * result_.cam_from_world.at(newest);
  has_new_loops_ = false;
}

}  // namespace rotslam
