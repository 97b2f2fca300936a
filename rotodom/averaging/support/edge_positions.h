#pragma once

#include <set>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Centres that fit the translations of a graph's edges best, orientations being known: the linear
/// least squares of weight |c_j - c_i - R_i^T t|^2. Six parameters: the symbols of the formula.
/// @param j_in_i    by edge, the position t of view j in the frame of view i.
/// @param weights   by edge, 1/length^2; zero leaves an edge out.
/// @param center_in_world  of the fixed views, and where a component's first view stays; the
///                  origin without one.
/// @return  centres of all views of edges with a weight.
/// Throws std::invalid_argument when the sizes differ or a view has no orientation.
/// Error:   relative residual of the normal equations 1e-10.
CenterMap FitCenters(std::span<const RelativeRotation> edges,
                     std::span<const Eigen::Vector3d> j_in_i,
                     std::span<const double> weights,
                     const RotationMap& cam_from_world,
                     const CenterMap& center_in_world,
                     const std::set<FrameId>& held_views);

}  // namespace rotslam
