#pragma once

#include <string>
#include <vector>

#include "rotodom/types/trajectory.h"

namespace rotslam {

/// The poses of a file.
struct TrajectoryFile {
  Trajectory poses;                // ascending in time, no time twice
  std::string form;                // the form that it was taken for: "TUM"
  std::vector<std::string> notes;  // what was assumed or left out, one line each
  bool has_times = true;           // else a pose has its number for a time
  // Nothing in the file says that qw is last, or first: other files may tell, see
  // output/trajectory_match.h.
  bool is_order_assumed = false;
  int first_scaled_line = 0;  // of a quaternion whose length is not 1 to a per cent; 0: none
};

}  // namespace rotslam
