#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "apps/slam/live/live_slam.h"

namespace rotslam {

/// The poses of a live session as they were emitted, for its curves. The newest ones are all there,
/// of the older ones every n-th, n growing with the session, so that memory has a bound.
class ShownSamples {
 public:
  /// All of so many newest frames are kept, and at most so many older ones.
  static constexpr int kNumNewest = 600;
  static constexpr int kMaxOlder = 4000;

  /// Frames ascend; one that does not is left out.
  void Add(const LiveEstimate& estimate);

  bool empty() const { return samples_.empty(); }
  /// The newest frame; -1 where there is none.
  int NewestFrame() const { return samples_.empty() ? -1 : samples_.back().frame; }
  double FirstTime() const { return first_time_s_; }

  /// The samples after a frame, -1 for all: "stride", and arrays with a row for each frame.
  /// Who holds the samples itself may drop those that are not among the newest and whose frame is
  /// no multiple of the stride.
  nlohmann::ordered_json After(int frame) const;

 private:
  struct Sample {
    int frame = 0;
    float time_s = 0.0F;  // since the first
    Eigen::Vector4f quaternion;
    Eigen::Vector3f position;
    bool has_position = false;
    LiveState state = LiveState::kStarting;
    Eigen::Vector3f angle_deg;  // roll, pitch, yaw
    Eigen::Vector3f sigma_deg;  // of these; -1 where unknown
  };

  void Thin();

  std::deque<Sample> samples_;  // by frame
  int stride_ = 1;
  double first_time_s_ = 0.0;
  std::optional<Eigen::Vector3d> last_angle_deg_;
};

}  // namespace rotslam
