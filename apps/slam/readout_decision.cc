#include "apps/slam/readout_decision.h"

#include <utility>

namespace rotslam {
namespace {

// Number of frames after which the readout is first estimated, and the factor between the numbers
// of two estimates. With fewer frames the camera has often hardly rotated, and the estimate is off
// by tens of percent.
constexpr std::size_t kFirstEstimateFrames = 120;
constexpr std::size_t kEstimateFactor = 4;

}  // namespace

ReadoutDecision::ReadoutDecision(const Camera& camera, const SlamOptions& options)
    : camera_(camera),
      options_(options.readout),
      relative_rotation_(options.rotodom.relative_rotation),
      num_threads_(options.num_threads),
      is_on_(options.readout.enabled && !camera.knows_readout),
      next_estimate_(kFirstEstimateFrames) {}

void ReadoutDecision::Add(FrameId frame, SeenPoints points, const OdometryResult& result) {
  if (!is_on_) return;
  frames_.emplace(frame, std::move(points));
  if (frames_.size() == next_estimate_) {
    Estimate(result);
    next_estimate_ *= kEstimateFactor;
  }
  if (frames_.size() >= static_cast<std::size_t>(options_.max_frames)) is_on_ = false;
  if (!is_on_) frames_.clear();
}

void ReadoutDecision::Finish(const OdometryResult& result) {
  // A last estimate is worth its time only with at least half as many frames again as the one
  // before.
  const std::size_t last_estimate =
      next_estimate_ > kFirstEstimateFrames ? next_estimate_ / kEstimateFactor : 0;
  if (is_on_ && frames_.size() > last_estimate + last_estimate / 2) Estimate(result);
}

void ReadoutDecision::Estimate(const OdometryResult& result) {
  const auto readout = EstimateReadout(
      camera_, {frames_, result.graph, result.cam_from_world}, relative_rotation_, num_threads_);
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
