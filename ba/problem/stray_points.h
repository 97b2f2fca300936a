#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "ba/cost/reprojection_cost.h"
#include "ba/problem/bundle_state.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {

/// Keeps a few points from blocking the solver. A step that is right for nearly all points can
/// throw a few far away, mostly points of little parallax behind the cameras. The solver would
/// reject it for their cost, and the short steps that spare them make little progress. So such
/// points are put where the cameras' new poses see them, before the step is judged.
///
/// A stray point gets a shift, which is added to the solver's point; if no position is found, the
/// point is lost until it is seen again. Both belong to a step of the solver: if the step is
/// rejected, so are they.
class StrayPoints {
 public:
  /// The pose of a frame's camera in an evaluation.
  struct Pose {
    Eigen::Matrix3d R_c_w;
    Eigen::Vector3d center;
  };

  /// @param state          whose used observations count, and whose positions are the solver's
  ///                       numbers; must outlive this.
  /// @param min_angle_rad  between rays that make a point.
  StrayPoints(const BundleState& state, double min_angle_rad, int num_threads);

  /// The solver starts from here.
  void Start(const std::vector<Pose>& poses);
  /// The solver tries the state's positions and these poses: shifts the points that see much worse
  /// than at the last accepted ones, where that helps.
  void Try(const std::vector<Pose>& poses);
  /// The solver has accepted the step that was evaluated last.
  void Accept();

  /// Of a track; stays where it is in memory.
  const PointShift& Shift(std::size_t track) const { return shifts_[track]; }
  /// Of a track, as last accepted.
  const PointShift& AcceptedShift(std::size_t track) const { return accepted_shifts_[track]; }

 private:
  double ErrorPx(const TrackState& track, const Eigen::Vector3d& position) const;
  bool CheaperSeen(std::size_t track) const;
  void Follow(std::size_t track);
  void Offer(std::size_t track, const Eigen::Vector3d& position);
  Eigen::Vector3d CarriedAlong(std::size_t track) const;
  std::vector<PosedRay> RaysOf(const TrackState& track) const;
  void ForEachPoint(const std::function<void(std::size_t)>& work) const;

  const BundleState& state_;
  double min_angle_rad_;
  int num_threads_;
  // By track; errors summed over its observations. Those of lost ones are as last seen.
  std::vector<PointShift> shifts_;
  std::vector<PointShift> accepted_shifts_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Eigen::Vector3d> accepted_positions_;
  std::vector<double> errors_px_;
  std::vector<double> accepted_errors_px_;
  // By frame.
  std::vector<Pose> poses_;
  std::vector<Pose> accepted_poses_;
};

}  // namespace rotslam
