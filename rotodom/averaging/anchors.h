#pragma once

#include <map>
#include <set>

#include <Eigen/Core>

#include "rotodom/averaging/averaging.h"

namespace rotslam {

/// Updates all orientations after some of them have been refined. Refined ones are kept as they
/// are. The others are rotated as the nearest refined frames before and after them were,
/// interpolated by frame number, and then averaged; averaging alone would keep a start that is far
/// off.
/// @param cam_from_world  orientations of all views before.
/// @param refined         refined orientations of some of these views.
/// Throws std::invalid_argument when none is refined or an option is out of range.
RotationMap FollowAnchors(const ViewGraph& graph,
                          const RotationMap& cam_from_world,
                          const RotationMap& refined,
                          const AveragingOptions& options);

/// Covariances of orientations relative to the nearest `anchors`, which count as exact: the
/// covariance along the path of edges from an anchor with the smallest trace. The covariance of an
/// edge includes options.edge_error_factor and its disagreement with `cam_from_world`, so that
/// paths avoid wrong edges. Other paths add no information here, since errors of edges over the
/// same frames are correlated.
/// @param anchors  those without an orientation are ignored.
/// @return  for every view on a path that is no anchor: covariance of the error delta in
///          `Exp(delta) * cam_from_world`, rad^2, in the camera's frame.
/// Throws std::invalid_argument when an option is out of range.
/// Cost:    O(E log V), Dijkstra from all anchors at once.
std::map<FrameId, Eigen::Matrix3d> AnchorCovariances(const ViewGraph& graph,
                                                     const RotationMap& cam_from_world,
                                                     const std::set<FrameId>& anchors,
                                                     const AveragingOptions& options);

}  // namespace rotslam
