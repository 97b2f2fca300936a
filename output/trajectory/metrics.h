#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rotodom/types/trajectory.h"

namespace rotslam {

/// How two trajectories are paired and compared.
struct MetricsOptions {
  // Largest gap between two ground-truth poses to interpolate over, seconds. Motion-capture runs
  // at 100 Hz or more, so 0.2 s spans a short loss of sight and nothing longer.
  double max_gap_s = 0.2;
  // A ground-truth pose this near in time counts as the estimate's own, whatever the gap, seconds.
  double exact_s = 1e-4;
  // Threads for RPE_n, whose cost is quadratic; the result does not depend on it.
  int num_threads = 1;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_gap_s", max_gap_s);
    visit("exact_s", exact_s);
    visit("num_threads", num_threads);
  }
};

/// An estimated pose and the ground truth at the same time. The two world frames are unrelated.
struct PosePair {
  StampedPose ground_truth;
  StampedPose estimate;
};

/// Pairs every estimated pose with the ground truth at its timestamp: rotations by spherical linear
/// interpolation, positions linearly. Interpolating matters: at 2 deg a frame, 5 ms are 0.3 deg.
/// @param ground_truth, estimate  timestamps ascending.
/// @return  the poses that have ground truth, in time order: those within `exact_s` of a
///          ground-truth pose or between two that are at most `max_gap_s` apart.
std::vector<PosePair> AssociatePoses(const Trajectory& ground_truth,
                                     const Trajectory& estimate,
                                     const MetricsOptions& options);

/// How far an estimate is from the truth. Angles in degrees; positions in the ground truth's unit
/// (metres). Rotation errors compare relative rotations, so the choice of world frame does not
/// enter; a rotation error at step d is the angle of (G_k^-1 G_{k+d})^-1 (E_k^-1 E_{k+d}).
struct TrajectoryMetrics {
  int num_poses = 0;  // estimated poses that have ground truth
  // Over all steps of one pose.
  double rpe1_deg = 0.0;  // root mean square
  double rpe1_median_deg = 0.0;
  double rpe1_p90_deg = 0.0;  // 90th percentile, linear between samples
  double rpe1_max_deg = 0.0;
  // Mean over d = 1 .. n - 1 of the root mean square at step d.
  double rpen_deg = 0.0;
  // KITTI's rotation error, deg per 100 m: mean over segments of 100, 200 .. 800 m that start at
  // every tenth pose; nullopt when the path is shorter than 100 m.
  std::optional<double> r_err_deg_per_100m;
  // Root mean square of the position error after the best similarity (Umeyama), and its scale
  // (ground truth = scale * estimate); nullopt when either trajectory stands still.
  std::optional<double> ate_m;
  std::optional<double> scale;
  double path_length_m = 0.0;  // of the ground truth at the paired times
};

/// Error:  agrees with an independent implementation to 1e-6 (EvalCommand.AgreesWithThePythonTool).
/// Cost:   quadratic in the number of pairs, about 30 ns for each two of them.
/// Source: the paper, section V-A; Geiger et al., Are we ready for autonomous driving?, CVPR 2012,
///         whose devkit takes the first pose beyond a length where we take the first at or beyond;
///         Umeyama, PAMI 1991.
/// Throws std::invalid_argument for fewer than three pairs.
TrajectoryMetrics ComputeMetrics(const std::vector<PosePair>& pairs, const MetricsOptions& options);

}  // namespace rotslam
