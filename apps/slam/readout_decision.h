#pragma once

#include <map>
#include <optional>

#include "apps/slam/options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/odometry.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

/// Decides from the beginning of a sequence whether the sensor has a rolling shutter, where the
/// calibration does not say. Frames are tracked as those of a global shutter. When `found()` is
/// set, tracking has to start again with that readout.
class ReadoutDecision {
 public:
  ReadoutDecision(const Camera& camera, const SlamOptions& options);

  /// Adds the next frame. At some frames the readout is estimated from all frames so far. Does
  /// nothing once the decision is made (IsOn()).
  /// @param result  of the odometry, this frame included.
  void Add(FrameId frame, SeenPoints points, const OdometryResult& result);
  /// Estimates the readout once more after the last frame, if frames were added since the last
  /// estimate.
  void Finish(const OdometryResult& result);

  /// Whether more frames may change the decision.
  bool IsOn() const { return is_on_; }
  /// Set: the camera has a rolling shutter.
  const std::optional<ReadoutEstimate>& found() const { return found_; }

 private:
  void Estimate(const OdometryResult& result);

  Camera camera_;
  ReadoutOptions options_;
  RelativeRotationOptions relative_rotation_;
  int num_threads_;
  bool is_on_;
  std::size_t next_estimate_;  // number of frames
  std::map<FrameId, SeenPoints> frames_;
  std::optional<ReadoutEstimate> found_;
};

/// The camera with that readout.
Camera WithReadout(Camera camera, const ReadoutEstimate& readout);

}  // namespace rotslam
