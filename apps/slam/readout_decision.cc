#include "apps/slam/readout_decision.h"

#include <utility>

namespace rotslam {
namespace {

// Frames after which it looks first, and how many times as many after which it looks next. In its
// first seconds a camera may hardly have started to turn (0.023 s of 0.030 after 30 frames of a
// gimbal, 0.034 of 0.026 after 60 of a hand-held Kinect).
constexpr std::size_t kFirstLook = 120;
constexpr std::size_t kBetweenLooks = 4;

}  // namespace

ReadoutDecision::ReadoutDecision(const Camera& camera, const SlamOptions& options)
    : camera_(camera),
      options_(options.readout),
      relative_rotation_(options.rotodom.relative_rotation),
      num_threads_(options.num_threads),
      is_on_(options.readout.enabled && !camera.knows_readout),
      next_look_(kFirstLook) {}

void ReadoutDecision::Add(FrameId frame, SeenPoints points, const OdometryResult& result) {
  if (!is_on_) return;
  frames_.emplace(frame, std::move(points));
  if (frames_.size() == next_look_) {
    Look(result);
    next_look_ *= kBetweenLooks;
  }
  if (frames_.size() >= static_cast<std::size_t>(options_.max_frames)) is_on_ = false;
  if (!is_on_) frames_.clear();
}

void ReadoutDecision::Finish(const OdometryResult& result) {
  // Little more than at the last look tells little more.
  const std::size_t last_look = next_look_ > kFirstLook ? next_look_ / kBetweenLooks : 0;
  if (is_on_ && frames_.size() > last_look + last_look / 2) Look(result);
}

void ReadoutDecision::Look(const OdometryResult& result) {
  const auto readout = EstimateReadout(
      camera_, frames_, result.graph, result.cam_from_world, relative_rotation_, num_threads_);
  if (!readout) return;
  if (readout->IsRolling()) found_ = readout;
  is_on_ = !found_ && !readout->IsGlobal();
}

Camera WithReadout(Camera camera, const ReadoutEstimate& readout) {
  camera.readout_s = readout.readout_s;
  camera.readout_from = readout.readout_from;
  camera.knows_readout = true;
  return camera;
}

}  // namespace rotslam
