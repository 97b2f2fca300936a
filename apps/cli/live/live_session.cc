#include "apps/cli/live/live_session.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "output/trajectory/trajectory.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

std::string Fixed(double value) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

std::string SizeOf(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

double Share(std::vector<double>& values, double share) {
  if (values.empty()) return 0.0;
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// A stream that is broken for long is not told about for every frame.
constexpr int kMaxWarnings = 5;

// A source is told to stall when it has given nothing for so long, s.
constexpr double kStallTime = 3.0;

// Whether it worked. A reader that has gone ends the poses, not the session.
bool WritePose(PoseOutput& poses, const LiveEstimate& estimate, Progress& progress) {
  try {
    poses.Write(PoseLine(estimate));
    return true;
  } catch (const std::runtime_error& problem) {
    progress.Warn(problem.what());
    return false;
  }
}

}  // namespace

LiveSummary RunLiveSession(FramePump& frames,
                           LiveSlam& slam,
                           const cv::Size& size,
                           const LiveOutputs& outputs,
                           const std::function<bool()>& should_stop,
                           Progress& progress) {
  LiveSummary summary;
  int num_problems = 0;
  bool writes_poses = outputs.poses != nullptr;
  auto newest = std::chrono::steady_clock::now();
  bool is_stalled = false;
  const auto should_stop_waiting = [&] {
    if (!is_stalled && SecondsSince(newest) > kStallTime) {
      is_stalled = true;
      progress.Warn("no frame for " + Fixed(kStallTime) +
                    " s: the source stalls and is waited for");
    }
    return should_stop();
  };
  progress.StartStage("live", -1);
  while (std::optional<Frame> frame = frames.Next(should_stop_waiting)) {
    if (!frame->image.empty() && frame->image.size() != size) {
      frame->problem = frame->name + ": is " + SizeOf(frame->image.size()) +
                       ", the camera's images are " + SizeOf(size) + "; left out";
      frame->image.release();
    }
    if (!frame->problem.empty() && ++num_problems <= kMaxWarnings) progress.Warn(frame->problem);
    const auto begin = std::chrono::steady_clock::now();
    const LiveEstimate estimate = slam.AddFrame(frame->timestamp_s, frame->image, frame->name);
    const double latency_ms = 1e3 * SecondsSince(begin);
    if (writes_poses) writes_poses = WritePose(*outputs.poses, estimate, progress);
    summary.num_dropped = frames.num_dropped();
    if (outputs.show) {
      outputs.show({estimate,
                    frame->image,
                    slam.SeenPointsPx(),
                    slam.Map(),
                    latency_ms,
                    summary.num_dropped});
    }
    summary.latencies_ms.push_back(latency_ms);
    summary.poses.push_back(estimate);
    ++summary.num_frames;
    summary.num_read = frame->id.value + 1;
    progress.Step(summary.num_frames, {ToString(estimate.state)});
    newest = std::chrono::steady_clock::now();
    is_stalled = false;
  }
  summary.num_dropped = frames.num_dropped();
  progress.EndStage(Describe(summary));
  if (summary.num_dropped > 0) {
    progress.Warn(std::to_string(summary.num_dropped) +
                  " frames came faster than they could be taken and were left out; --wait takes "
                  "them all, more --threads or smaller images take less time");
  }
  return summary;
}

std::string Describe(const LiveSummary& summary) {
  std::vector<double> latencies_ms = summary.latencies_ms;
  const auto num_placed =
      std::count_if(summary.poses.begin(), summary.poses.end(), [](const LiveEstimate& pose) {
        return pose.center_in_world.has_value();
      });
  return std::to_string(summary.num_frames) + " frames, " + std::to_string(num_placed) +
         " with a position at once, " + std::to_string(summary.num_dropped) +
         " left out, latency median " + Fixed(Share(latencies_ms, 0.5)) + " ms, 99 % within " +
         Fixed(Share(latencies_ms, 0.99)) + " ms";
}

void WriteEmitted(const std::filesystem::path& file, const LiveSummary& summary) {
  Trajectory trajectory;
  for (const LiveEstimate& pose : summary.poses) {
    if (!pose.center_in_world) continue;
    trajectory.push_back({pose.timestamp_s, pose.cam_from_world.Inverse(), *pose.center_in_world});
  }
  WriteTumTrajectory(file,
                     trajectory,
                     {"poses as they were given out frame by frame; each belongs to the map of its "
                      "time"});
}

}  // namespace rotslam
