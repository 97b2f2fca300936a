#pragma once

#include <optional>

#include "apps/cli/run_directory/checkpoint.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// A sequence's frames on their way through the odometry: first those that the checkpoint has, as
/// they were found then, and from there on the images, which are recorded in turn.
class FrameStream {
 public:
  /// @param checkpoint  null: the images from the first one on, nothing is recorded.
  FrameStream(Sequence& sequence, LoopedOdometry& odometry, Checkpoint* checkpoint);

  struct Step {
    Frame frame;  // without the image, which has done its work
    LoopedEstimate estimate;
  };
  /// The next frame; nullopt after the last.
  /// @param needs_points  of its estimate; else they may be missing.
  std::optional<Step> Next(bool needs_points);

  /// Keeps all frames so far. To be called after the last one, too.
  void Commit();

 private:
  Sequence& sequence_;
  LoopedOdometry& odometry_;
  Checkpoint* checkpoint_;
  int num_recorded_ = 0;
  bool is_replaying_;
};

}  // namespace rotslam
