#pragma once

#include <optional>

#include "apps/slam/input/frame_log.h"
#include "apps/slam/input/frame_source.h"
#include "apps/slam/masks/frame_masks.h"
#include "apps/slam/masks/static_content_decision.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/sequence/frame_thumbnail.h"

namespace rotslam {

/// One frame after the odometry.
struct TrackedFrame {
  Frame frame;  // without the image
  FrameThumbnail thumbnail;
  LoopedEstimate estimate;
};

/// The stages through which every frame passes.
struct TrackingTools {
  LoopedOdometry& odometry;
  StaticContentDecision& static_content;  // receives the images
};

/// Passes one frame through the odometry.
/// @param masks   what the odometry ignores.
/// @param record  null, or what receives the input of LoopedOdometry::Replay.
TrackedFrame TrackFrame(Frame frame,
                        const FrameMasks& masks,
                        const TrackingTools& tools,
                        FrameRecord* record);

/// Passes the frames of a source through the odometry. Frames that the log has are replayed from
/// it; the others are read as images, tracked and recorded.
class FrameStream {
 public:
  /// @param log  null: all frames are read as images, and nothing is recorded.
  FrameStream(FrameSource& frames,
              const FrameMasks& masks,
              const TrackingTools& tools,
              FrameLog* log)
      : frames_(frames), masks_(masks), tools_(tools), log_(log), is_replaying_(log != nullptr) {}

  /// The next frame; nullopt after the last.
  /// @param needs_points  whether the estimate must have its points.
  std::optional<TrackedFrame> Next(bool needs_points);

  /// Writes all frames so far to the log. Call it after the last frame, too.
  void Commit();

 private:
  FrameSource& frames_;
  const FrameMasks& masks_;
  TrackingTools tools_;
  FrameLog* log_;
  int num_recorded_ = 0;
  bool is_replaying_;
};

}  // namespace rotslam
