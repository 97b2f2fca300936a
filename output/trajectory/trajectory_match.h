#pragma once

#include <optional>
#include <string>
#include <vector>

#include "output/trajectory/metrics.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {

/// How two trajectories of unknown conventions are brought together.
struct MatchOptions {
  MetricsOptions metrics;
  // Takes out a constant rotation between the axes of the two, found by hand-eye calibration.
  bool align_axes = false;
  // Takes both as they stand: nothing is inverted or put in another order.
  bool as_is = false;
  double time_offset_s = 0.0;  // added to the times of the estimate
  // The estimate is of this program: only the truth's direction, order and times are in doubt.
  bool is_estimate_known = false;
};

/// A trajectory and what messages call it.
struct NamedTrajectory {
  TrajectoryFile file;
  std::string name;
};

/// Two trajectories at the same times.
struct MatchedTrajectories {
  Trajectory ground_truth;  // as it was taken: times, order of quaternions, direction, axes
  Trajectory estimate;      // likewise
  std::vector<PosePair> pairs;
  std::vector<std::string> notes;  // of the files first, then what was found here
};

/// Pairs an estimate with the ground truth, as AssociatePoses does, and looks for the conventions
/// in which they fit.
///
/// - Poses that are numbered and not timed are paired in their order where both have as many.
/// - Where relative rotations disagree, other readings are tried: qw first where a file does not
///   say, world->camera for one of the two. One that fits five times better than the files as they
///   stand is taken, and a note says so.
/// - Otherwise a constant rotation X between body and camera is looked for, A_k X = X B_k for the
///   relative rotations A_k of the truth and B_k of the estimate. It is told in a note, and taken
///   out with `align_axes`.
///
/// Source: Park & Martin, Robot sensor calibration: solving AX = XB on the Euclidean group, IEEE
///         T-RA 1994; here with weights that bound outliers.
/// Throws std::runtime_error in one line when fewer than three poses have ground truth.
MatchedTrajectories MatchTrajectories(const NamedTrajectory& ground_truth,
                                      const NamedTrajectory& estimate,
                                      const MatchOptions& options);

/// The constant rotation between the axes of two trajectories.
struct AxesFit {
  Rotation truth_axes_from_estimate_axes;
  double residual_deg = 0.0;  // median of what is left
};

/// Hand-eye calibration of relative rotations over `step` poses; nullopt where the rotations have
/// one axis alone, about which nothing is known.
std::optional<AxesFit> FitAxes(const std::vector<PosePair>& pairs, std::size_t step);

}  // namespace rotslam
