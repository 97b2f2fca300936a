#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Geometry>

namespace rotslam {

/// A relative rotation between two positions in a list of views.
struct ConsensusEdge {
  int i = 0;
  int j = 0;
  Eigen::Quaterniond j_from_i = Eigen::Quaterniond::Identity();
  double variance = 0.0;  // of the error, per axis, rad^2
};

struct ConsensusProblem {
  int num_views = 0;
  std::span<const ConsensusEdge> edges;
  // Orientations to keep, by view; views that are not `is_held` ignore theirs. With `has_start` all
  // orientations are a start: then nothing but the trust in edges is found.
  std::vector<Eigen::Quaterniond> cam_from_world;
  std::vector<char> is_held;
  bool has_start = false;
  // Edges agree when they differ by no more than this many standard deviations.
  double trust_sigmas = 4.0;
  // Errors along paths are this many times what independent errors of their edges add up to.
  double drift_factor = 1.0;
  std::uint64_t seed = 1;  // of the trees tried at random
};

}  // namespace rotslam
