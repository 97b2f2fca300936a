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

/// Orientations of all frames in one world, from an odometry that goes on in its own and from loops
/// that spread its drift over all of them.
///
/// A loop that disagrees with the orientations has all of them averaged, on a thread of its own
/// when there are several. LoopOptions::handover_frames frames later the result is taken over, and
/// what came since is turned with the newest frame that it knows; who is early waits. So nothing
/// depends on how fast anything runs.
class LoopedOrientations {
 public:
  LoopedOrientations(const AveragingOptions& averaging,
                     const LoopOptions& loops,
                     bool keep_features,
                     int num_threads);

  /// Turns the next frame's estimate from the odometry's world into the present one and takes its
  /// orientation, which is all that the search for loops needs.
  void BeginFrame(FrameEstimate& estimate);
  /// Takes the rest of it: edges, older orientations, features.
  void AddFrame(FrameEstimate estimate);

  /// Takes the edges of an accepted loop, the best one first, or none. Where no way was known
  /// between their ends, the piece of the view-graph that began later is turned at once.
  void AddLoop(std::vector<EdgeWithMatches> connections);
  /// Takes matches that are known to be of the same points, and say nothing of orientations.
  void AddMatches(std::vector<EdgeMatches> matches);

  /// To be called once per frame, after its loops: begins and ends averaging.
  /// @return  true when orientations have moved as a loop says.
  /// Throws what the averaging threw.
  bool EndFrame();

  /// To be called after the last frame: averages once more when there were loops.
  void Finish();

  void SetCovariance(FrameId frame, const Eigen::Matrix3d& covariance) {
    result_.covariance[frame] = covariance;
  }

  /// Pieces of the view-graph, by frame: inside one orientations are linked by edges that more than
  /// a handful of matches speak for.
  const DisjointSets& pieces() const { return pieces_; }
  const OdometryResult& result() const { return result_; }
  OdometryResult&& TakeResult() { return std::move(result_); }
  /// Of the averaging itself, whoever waited for it.
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
  // Turns the odometry's world; its window may from now on move frames after `settled` only.
  void TurnOdometry(const Rotation& old_from_new_world, FrameId settled);
  bool NeedsAveraging() const;
  // Without the weak edges whose views are joined by better ones: chance may have made them.
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
  std::set<std::pair<FrameId, FrameId>> weak_edges_;  // that a handful of matches speaks for
  // Since the last averaging began: best edges of loops, and whether pieces were joined by one
  // edge.
  std::vector<RelativeRotation> open_loops_;
  bool has_aligned_ = false;
  bool has_loops_ = false;
  bool has_moved_ = false;  // since the last frame
  FrameId newest_;
  // Turns the odometry's world into that of the result, once these are two.
  std::optional<Rotation> odometry_from_world_;
  FrameId settled_;  // what loops say of frames up to here the odometry does not know
  std::optional<Averaging> averaging_;
  double averaging_seconds_ = 0.0;
};

}  // namespace rotslam
