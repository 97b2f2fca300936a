#pragma once

#include <memory>
#include <string>

#include "apps/slam/live/live_slam.h"

namespace rotslam {

/// One line per frame, for programs that use the poses at once: `timestamp tx ty tz qx qy qz qw
/// state revision`, camera->world; `nan nan nan` where there is no position.
std::string PoseLine(const LiveEstimate& estimate);

/// A receiver of the lines of a live session, which are sent one by one.
class PoseOutput {
 public:
  virtual ~PoseOutput() = default;
  virtual void Write(const std::string& line) = 0;
};

/// @param place  "-": standard output; udp://HOST:PORT: a datagram each; else a file, which is
///               replaced.
/// Throws std::runtime_error in one line where that cannot be had.
std::unique_ptr<PoseOutput> OpenPoseOutput(const std::string& place);

}  // namespace rotslam
