#pragma once

#include <map>
#include <optional>
#include <string>

#include "apps/cli/input/input.h"
#include "apps/cli/input/pipeline.h"
#include "output/tables/summary.h"
#include "rotodom/odometry.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

/// Watches the beginning of a sequence whose calibration does not say how the sensor is read out.
/// Frames are taken as a global shutter's; when it turns out that it rolls, the sequence is to be
/// read once more.
class ReadoutDecision {
 public:
  ReadoutDecision(const Camera& camera, const PipelineOptions& options, int num_threads);

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

/// Gives the input's camera that readout.
void SetReadout(ReadoutEstimate readout, Input& input);

/// In words: `20.3 +- 0.2 ms from the top`.
std::string DescribeReadout(const ReadoutEstimate& readout);

/// As a camera file has it: `readout_s: 0.0203, readout_from: top`.
std::string CameraLines(const ReadoutEstimate& readout);

/// The part of summary.json.
SummaryTable SummaryOf(const ReadoutEstimate& readout);

}  // namespace rotslam
