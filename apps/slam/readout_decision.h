#pragma once

#include <map>
#include <optional>

#include "apps/slam/options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/odometry.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

/// Watches the beginning of a sequence whose calibration does not say how the sensor is read out.
/// Frames are taken as a global shutter's; when it turns out that it rolls, the sequence is to be
/// read once more.
class ReadoutDecision {
 public:
  ReadoutDecision(const Camera& camera, const SlamOptions& options);

  /// Takes the next frame, and at some frames looks at all of them. Nothing once it is off.
  /// @param result  of the odometry, this frame included.
  void Add(FrameId frame, SeenPoints points, const OdometryResult& result);
  /// Looks after the last frame, if need be.
  void Finish(const OdometryResult& result);

  /// Whether it wants more frames.
  bool IsOn() const { return is_on_; }
  /// Set: the shutter rolls.
  const std::optional<ReadoutEstimate>& found() const { return found_; }

 private:
  void Look(const OdometryResult& result);

  Camera camera_;
  ReadoutOptions options_;
  RelativeRotationOptions relative_rotation_;
  int num_threads_;
  bool is_on_;
  std::size_t next_look_;
  std::map<FrameId, SeenPoints> frames_;
  std::optional<ReadoutEstimate> found_;
};

/// The camera with that readout.
Camera WithReadout(Camera camera, const ReadoutEstimate& readout);

}  // namespace rotslam
