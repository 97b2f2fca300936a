#pragma once

#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// The orientations that are averaged after a new frame.
enum class AveragingMode {
  kOff,     // none: every orientation is chained to its best edge
  kWindow,  // the newest `window`, older ones are fixed: constant time
  kGlobal,  // all: time grows with the sequence
};
/// The words for them in option files: "off", "window", "global".
std::span<const char* const> OptionWords(AveragingMode);

/// Options of averaging over a window or a small view-graph.
struct AveragingOptions {
  // The orientations that are averaged at every frame.
  AveragingMode mode = AveragingMode::kWindow;
  // Newest orientations that stay free in the incremental solve; the paper's |R|.
  int window = 10;
  // Standard deviation added to every edge's covariance, so that no edge is believed without limit.
  double edge_floor_deg = 0.0005;
  // Edges are wrong by this many times the deviation that the scatter of their matches shows, as
  // reported in the orientations' covariances; it does not change the orientations. On rendered
  // streets, rooms and gimbals (tests/bench/odometry_accuracy) the ratio of variances was 2.3 to
  // 5.5, at any reach from one frame to four and at noise from 0.025 to 0.2 px; worlds of points
  // have 1. 1.75 squared is 3.1.
  double edge_error_factor = 1.75;
  // Part of that variance which comes from errors that last: a patch slides along its surface as
  // the view changes, and goes on doing so. Such errors do not average out over edges across the
  // same frames, and they add up along chains. Without them (0) the variances of rendered streets
  // are some 30 times too small over 160 frames and 10 times over 10. With 0.7 windowed
  // orientations have mean squared Mahalanobis distances / 3 of 0.5 to 2.2, newest, settled and
  // over turns of 1, 5 and 10 frames; chained ones 0.4 to 2.2.
  double lasting_share = 0.7;
  // How long they last: views until their correlation has fallen to 1/e. 1 to 12 do, longer ones
  // with smaller shares, and cost time.
  double lasting_views = 2.0;
  // How far two edges that rest on the same keypoints of a frame have the rest, that frame's noise,
  // in common, 0 to 1, as reported in the covariances. Not all: baselines and sub-pixel positions
  // differ from edge to edge. 1 makes chains over short baselines look twice as good as they are, 0
  // makes them look worse and windows better (orientation_covariance_test.cc).
  double shared_noise = 0.9;
  // Edge error, in standard deviations, beyond which the robust (Geman-McClure) cost goes flat.
  // Calibration, shutter and patches that deform make edges wrong by some ten of the deviations
  // that the scatter of their matches shows: a tight limit would drop the good ones with the bad.
  // At 30, 100 and 300: RPE_1 of TUM fr1_rpy 0.41, 0.34 and 0.35 deg, RPE_n of 7-Scenes kitchen
  // 3.8, 3.3 and 3.4 deg.
  double loss_sigmas = 100.0;
  // Steps of the convex L1 start, taken only when most edges of some free view contradict its
  // start. From a right start it does not change the answer up to 30 % wrong edges (at 40 %: 0.057
  // instead of 0.046 deg a step), so it is left out there; a start from a wrong edge the robust
  // cost alone never leaves (6 to 13 deg a step at 10 to 40 %), with it the steps are 0.04 to 0.15
  // deg (the L1 tests of averaging_test.cc).
  int l1_iterations = 20;
  // Stop when no orientation moves by more than this, and after max_iterations in any case.
  double min_step_deg = 1e-4;
  int max_iterations = 30;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("mode", mode);
    visit("window", window);
    visit("loss_sigmas", loss_sigmas);
  }
};

/// The views that `options.mode` leaves free once the newest one has its start; never the first
/// one, which defines the world. Throws std::invalid_argument when an option is out of range.
std::set<FrameId> ViewsToAverage(const RotationMap& cam_from_world,
                                 const AveragingOptions& options);

/// Averages the orientations in `free_views` so that they agree best with the edges, all others
/// being fixed: iteratively re-weighted least squares in the tangent space, edges weighted by their
/// covariances.
/// @param cam_from_world  start values, and the anchors: every view that is not free. Edges to
///                        views without an orientation are ignored.
/// @param free_views      views to average. Without an edge to an anchor, the oldest one is fixed.
/// @return  the new orientations of `free_views` only.
/// Error:   the cost's minimum nearest to the start, to min_step_deg.
/// Cost:    one solution for 3 |free_views| unknowns per iteration (EdgeSystem); 10 free views with
///          50 edges take about 0.02 ms in all (tests/bench/averaging_bench.cc).
/// Source:  Chatterjee & Govindu, Robust Relative Rotation Averaging, PAMI 2018; Chng et al.,
///          Monocular Rotational Odometry with Incremental Rotation Averaging and Loop Closure,
///          sec. IV-E, for the many anchors.
RotationMap AverageRotations(const ViewGraph& graph,
                             const RotationMap& cam_from_world,
                             const std::set<FrameId>& free_views,
                             const AveragingOptions& options);

/// Number of edges of every view that agree with the orientations: those within options.loss_sigmas
/// standard deviations, edge_floor_deg included. Views without an agreeing edge have 0; edges to
/// views without an orientation are ignored.
std::map<FrameId, int> CountInlierEdges(const ViewGraph& graph,
                                        const RotationMap& cam_from_world,
                                        const AveragingOptions& options);

}  // namespace rotslam
