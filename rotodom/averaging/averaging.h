#pragma once

#include <optional>
#include <set>
#include <string>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

struct AveragingOptions {
  // Newest orientations that stay free in the incremental solve; the paper's |R|.
  int window = 10;
  // Standard deviation added to every edge's covariance: what the edges' own covariances do not
  // know of, calibration and rolling shutter first. Larger values make the edges' weights more
  // equal.
  double edge_floor_deg = 0.2;
  // Edge error, in standard deviations, beyond which the robust (Geman-McClure) cost goes flat.
  double loss_sigmas = 3.0;
  // Stop when no orientation moves by more than this, and after max_iterations in any case.
  double min_step_deg = 1e-5;
  int max_iterations = 30;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("window", window);
    visit("edge_floor_deg", edge_floor_deg);
    visit("loss_sigmas", loss_sigmas);
    visit("min_step_deg", min_step_deg);
    visit("max_iterations", max_iterations);
  }
};

/// Moves the orientations in `free_views` so that the edges' relative rotations agree best, all
/// other orientations held: iteratively re-weighted least squares in the tangent space, edges
/// weighted by their covariances.
/// @param cam_from_world  start, and the anchors: every view that is not free. Edges to views it
/// does not
///                        name are ignored.
/// @param free_views      views to move. When no edge ties them to an anchor, the oldest one is
/// held.
/// @return  `cam_from_world` with the free views' new orientations.
/// Cost:    one sparse Cholesky factorisation of 3 |free_views| unknowns per iteration.
/// Source:  Chatterjee & Govindu, Robust Relative Rotation Averaging, PAMI 2018; Chng et al.,
/// Monocular
///          Rotational Odometry with Incremental Rotation Averaging and Loop Closure, sec. IV-E,
///          for the many anchors.
RotationMap AverageRotations(const ViewGraph& graph,
                             RotationMap cam_from_world,
                             const std::set<FrameId>& free_views,
                             const AveragingOptions& options);

}  // namespace rotslam
