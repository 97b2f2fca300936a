#pragma once

#include <map>
#include <set>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Covariances of averaged orientations.
struct OrientationDeviations {
  // Of the error delta in Exp(delta) * cam_from_world, rad^2, in the camera's frame. Relative to
  // the fixed views; in a component without one, to the mean of its views. Views that no edge with
  // a weight ties to another one have none.
  std::map<FrameId, Eigen::Matrix3d> covariance;
  // False: the factorisation would be too large, and each view has the covariance from its own
  // edges alone, with its neighbours taken for exact: the true one is larger.
  bool is_complete = true;
};

/// The inverse of the normal equations of averaging, its diagonal blocks.
/// @param weights  by edge, of its information; zero leaves an edge out.
/// Error:   first order; edges are taken for independent and their covariances for true.
/// Cost:    a Cholesky factorisation of 3 n unknowns and about twice that for the blocks of the
///          inverse (Erisman & Tinney, On computing certain elements of the inverse of a sparse
///          matrix, 1975).
OrientationDeviations DeviationsOfViews(std::span<const RelativeRotation> edges,
                                        const std::vector<double>& weights,
                                        const RotationMap& cam_from_world,
                                        const std::set<FrameId>& held_views);

}  // namespace rotslam
