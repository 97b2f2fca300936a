#pragma once

#include <future>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

/// Orientations of all frames in one world, from an odometry with a world of its own and from loops
/// that distribute its drift.
///
/// A loop that contradicts the orientations starts an averaging of all of them, on a thread of its
/// own when there are several. The result is taken over LoopOptions::handover_frames frames later,
/// and the frames since are rotated with the newest frame in it. If the averaging is not finished
/// by then, the odometry waits. The results therefore do not depend on speed.
class LoopedOrientations {
 public:
  LoopedOrientations(const AveragingOptions& averaging,
                     const LoopOptions& loops,
                     bool keep_features,
                     int num_threads);

  /// Transforms the next frame's estimate from the odometry's world into the present one and stores
  /// its orientation, which the search for loops needs.
  void BeginFrame(FrameEstimate& estimate);
  /// Stores the rest of the estimate: edges, older orientations, features.
  void AddFrame(FrameEstimate estimate);

  /// Adds the edges of an accepted loop, the best one first. Where the loop connects two components
  /// of the view-graph, the one that began later is rotated at once.
  void AddLoop(std::vector<EdgeWithMatches> connections);
  /// Adds matches of the same points without a reliable relative rotation.
  void AddMatches(std::vector<EdgeMatches> matches);

  /// Call once per frame, after its loops: starts and finishes averaging.
  /// @return  true when a loop has changed orientations.
  /// Throws exceptions of the averaging.
  bool EndFrame();

  /// Call after the last frame: averages once more when there were loops.
  void Finish();

  void SetCovariance(FrameId frame, const Eigen::Matrix3d& covariance) {
    result_.covariance[frame] = covariance;
  }

  /// Whether an averaging runs whose result is still to be taken over.
  bool is_averaging() const { return averaging_.has_value(); }
  /// Connected components of the view-graph over reliable edges, by frame.
  const DisjointSets& pieces() const { return pieces_; }
  const OdometryResult& result() const { return result_; }
  OdometryResult&& TakeResult() { return std::move(result_); }
  /// Time of the averaging itself, s, whether or not the odometry waited.
  double averaging_seconds() const { return averaging_seconds_; }

 private:
  struct Averaged {
    RotationMap cam_from_world;
    double seconds = 0.0;
  };
  struct Averaging {
    std::future<Averaged> averaged;
    int frames_left = 0;
  };

  void AlignPieces(const RelativeRotation& loop);
  // Changes the odometry's world. From now on its window may change frames after `settled` only.
  void TurnOdometry(const Rotation& old_from_new_world, FrameId settled);
  bool NeedsAveraging() const;
  // The edges without those of few matches between views that better edges connect, since such
  // edges may be wrong by chance.
  std::vector<RelativeRotation> ReliableEdges() const;
  void BeginAveraging();
  void EndAveraging();

  AveragingOptions averaging_options_;
  double min_correction_deg_;
  int handover_frames_;
  bool keep_features_;
  int num_threads_;

  OdometryResult result_;
  DisjointSets pieces_;
  std::set<std::pair<FrameId, FrameId>> weak_edges_;  // edges with few matches
  // Since the start of the last averaging: the best edges of loops, and whether components were
  // connected by one edge.
  std::vector<RelativeRotation> open_loops_;
  bool has_aligned_ = false;
  bool has_loops_ = false;
  bool has_moved_ = false;  // since the last frame
  FrameId newest_;
  // Rotation from the odometry's world to that of the result, once these differ.
  std::optional<Rotation> odometry_from_world_;
  FrameId settled_;  // the odometry does not change frames up to this one
  std::optional<Averaging> averaging_;
  double averaging_seconds_ = 0.0;
};

}  // namespace rotslam
