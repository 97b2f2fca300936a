#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/cli/live/frame_pump.h"
#include "apps/cli/live/pose_output.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/live/live_slam.h"

namespace rotslam {

/// The outputs of a live session while it runs.
struct LiveOutputs {
  std::unique_ptr<PoseOutput> poses;  // null: nobody
  // Called after every frame with its image; empty: nobody.
  struct Shown {
    const LiveEstimate& estimate;
    const cv::Mat& image;
    std::vector<Eigen::Vector2d> points_px;  // in the image, of the map
    std::shared_ptr<const LiveMap> map;
    double latency_ms;
    int num_dropped;
  };
  std::function<void(const Shown& shown)> show;
};

/// Figures of a session.
struct LiveSummary {
  int num_frames = 0;
  int num_dropped = 0;
  int num_read = 0;  // of the source, up to the last one taken
  std::vector<double> latencies_ms;
  std::vector<LiveEstimate> poses;  // as emitted
};

/// Gives frames to `slam` until they end or `should_stop` says so. A frame that cannot be read, or
/// is of another size, is told once and counts as an unreadable one.
/// Six parameters: the objects that it connects, which have different owners.
LiveSummary RunLiveSession(FramePump& frames,
                           LiveSlam& slam,
                           const cv::Size& size,
                           const LiveOutputs& outputs,
                           const std::function<bool()>& should_stop,
                           Progress& progress);

/// One line for people: frames, those left out, latency, how many have a position.
std::string Describe(const LiveSummary& summary);

/// Writes the poses that have a position as they were emitted, in TUM's format.
void WriteEmitted(const std::filesystem::path& file, const LiveSummary& summary);

}  // namespace rotslam
