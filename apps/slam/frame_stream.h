#pragma once

#include <optional>

#include "apps/slam/frame_log.h"
#include "apps/slam/frame_source.h"
#include "rotodom/loop/looped_odometry.h"

namespace rotslam {

/// Passes frames through the odometry. Frames that the log has are replayed from it; the others are
/// read as images, tracked and recorded.
class FrameStream {
 public:
  /// @param log  null: all frames are read as images, and nothing is recorded.
  FrameStream(FrameSource& frames, LoopedOdometry& odometry, FrameLog* log);

  struct Step {
    Frame frame;  // without the image
    LoopedEstimate estimate;
  };
  /// The next frame; nullopt after the last.
  /// @param needs_points  whether the estimate must have its points.
  std::optional<Step> Next(bool needs_points);

  /// Writes all frames so far to the log. Call it after the last frame, too.
  void Commit();

 private:
  FrameSource& frames_;
  LoopedOdometry& odometry_;
  FrameLog* log_;
  int num_recorded_ = 0;
  bool is_replaying_;
};

}  // namespace rotslam
