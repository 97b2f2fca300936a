#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "rotodom/averaging/averaging.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Options of averaging over a whole view-graph that has wrong edges.
struct GlobalAveragingOptions {
  // Standard deviation added to every edge's covariance, so that no edge is believed without limit.
  double edge_floor_deg = 0.001;
  // Edges are wrong by this many times their deviations.
  double error_factor = 1.0;
  // Edge error, in standard deviations, beyond which the robust (Geman-McClure) cost goes flat.
  // Right edges have 1.7 on average and 4 once in a thousand.
  double loss_sigmas = 6.0;
  // Cycles whose error is within this many deviations are taken for right ones; so are edges that
  // close a path with it. 4 lets one right cycle in a thousand go.
  double trust_sigmas = 4.0;
  // Errors along paths are this many times what independent errors of their edges add up to: above
  // one where neighbouring edges err alike.
  double drift_factor = 1.0;
  // Trusted edges that disagree with the start, as loops do with drift, begin with a loss that lets
  // them pull, which shrinks by this factor at every iteration down to loss_sigmas.
  double loss_decay = 0.3;
  // Steps of the convex L1 cost before that, where the start contradicts most edges of one view
  // in 20.
  int l1_iterations = 5;
  // Stop when no orientation but those of one view in 200 moves by more than this, and after
  // max_iterations in any case.
  double min_step_deg = 1e-3;
  int max_iterations = 100;
  // Of the trees that are tried at random where cycles leave edges unconfirmed.
  std::uint64_t seed = 1;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("edge_floor_deg", edge_floor_deg);
    visit("error_factor", error_factor);
    visit("loss_sigmas", loss_sigmas);
    visit("trust_sigmas", trust_sigmas);
    visit("drift_factor", drift_factor);
    visit("loss_decay", loss_decay);
    visit("l1_iterations", l1_iterations);
    visit("min_step_deg", min_step_deg);
    visit("max_iterations", max_iterations);
    visit("seed", seed);
  }
};

struct GlobalAveragingProblem {
  // In any order and direction; several edges of one pair are allowed.
  std::span<const RelativeRotation> edges;
  // Orientations of the fixed views; with `use_start` also start values of the others, if it names
  // every view of the edges.
  RotationMap cam_from_world;
  bool use_start = true;
  // Views with fixed orientations; a component may have several.
  std::set<FrameId> held_views;
};

struct GlobalAveragingResult {
  RotationMap cam_from_world;
  // Connected components of the graph, numbered by their first views, and their numbers of views.
  // Orientations of different components are not related.
  std::map<FrameId, int> component;
  std::vector<int> component_sizes;
  // By edge, as given.
  std::vector<double> angle_rad;  // between measured and averaged
  std::vector<double> sigmas;     // the same in standard deviations, a norm over three axes
  // Sum over the edges of the robust cost s^2 c^2 / (s^2 + c^2), s the sigmas, c the loss_sigmas.
  double cost = 0.0;
  int num_inliers = 0;  // edges within loss_sigmas
  int iterations = 0;
  bool has_converged = false;
};

/// Finds the orientations that agree best with relative rotations, of which many may be wrong: a
/// start along a tree that cycles confirm (FindConsensusStart), then iteratively re-weighted least
/// squares in the tangent space with edges weighted by their covariances.
/// @return  orientations of all views of edges and held_views. In a component without a fixed view
///          the first view has its orientation of `cam_from_world`, else the identity.
/// Throws std::invalid_argument when an option is out of range, a fixed view has no orientation, an
/// edge joins a view with itself or its covariance is not positive definite.
/// Error:   the robust cost's minimum nearest to the start, to min_step_deg.
/// Cost:    tests/bench/global_averaging_bench.cc.
/// Source:  Chatterjee & Govindu, Robust Relative Rotation Averaging, PAMI 2018; the start and the
///          preconditioned equations are ours.
GlobalAveragingResult AverageGlobally(const GlobalAveragingProblem& problem,
                                      const GlobalAveragingOptions& options,
                                      int num_threads);

/// Fills what a result says of its edges (angle_rad, sigmas, cost, num_inliers) anew for its
/// cam_from_world, which may have been changed.
void ReportEdges(std::span<const RelativeRotation> edges,
                 const GlobalAveragingOptions& options,
                 GlobalAveragingResult& result);

/// The covariance that averaging takes an edge to have.
Eigen::Matrix3d ErrorCovariance(const RelativeRotation& edge,
                                const GlobalAveragingOptions& options);

/// The same for the drifted orientations of an odometry and a view-graph with loops: all views are
/// averaged with the first one fixed. A loop is accepted when it disagrees by no more than the
/// drift expected from the edges between its ends, however many of its own standard deviations that
/// is.
/// @param edges           of the view-graph.
/// @param cam_from_world  start, of all views of the edges.
/// Cost:    tens of milliseconds for some thousand views.
GlobalAveragingResult CloseLoops(std::span<const RelativeRotation> edges,
                                 const RotationMap& cam_from_world,
                                 const AveragingOptions& options,
                                 int num_threads);

}  // namespace rotslam
