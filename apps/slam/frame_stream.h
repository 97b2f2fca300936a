#pragma once

#include <optional>

#include "apps/slam/frame_log.h"
#include "apps/slam/frame_source.h"
#include "rotodom/loop/looped_odometry.h"

namespace rotslam {

/// Takes frames through the odometry: first those that the log has, as they were found then, and
/// from there on the images, which are recorded in turn.
class FrameStream {
 public:
  /// @param log  null: the images from the first one on, nothing is recorded.
  FrameStream(FrameSource& frames, LoopedOdometry& odometry, FrameLog* log);

  struct Step {
    Frame frame;  // without the image
    LoopedEstimate estimate;
  };
  /// The next frame; nullopt after the last.
  /// @param needs_points  of its estimate; else they may be missing.
  std::optional<Step> Next(bool needs_points);

  /// Keeps all frames so far. To be called after the last one, too.
  void Commit();

 private:
  FrameSource& frames_;
  LoopedOdometry& odometry_;
  FrameLog* log_;
  int num_recorded_ = 0;
  bool is_replaying_;
};

}  // namespace rotslam
