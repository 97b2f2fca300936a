#pragma once

#include <map>
#include <set>

#include <Eigen/Core>

#include "rotodom/averaging/averaging.h"

namespace rotslam {

/// Orientations after some have been refined: `refined` as they are, all others turned as the
/// nearest of those before and after them have, between two in proportion to the frame numbers, and
/// then averaged. Averaging alone would leave a start that is far off.
/// @param cam_from_world  before, of all views.
/// @param refined         after; views of `cam_from_world`.
/// Throws std::invalid_argument when none is refined or an option is out of range.
RotationMap FollowAnchors(const ViewGraph& graph,
                          const RotationMap& cam_from_world,
                          const RotationMap& refined,
                          const AveragingOptions& options);

/// How well orientations are known against those of the nearest `anchors`, which count as exact:
/// the covariance along the path of edges from an anchor on which its trace grows least. An edge
/// counts with options.edge_error_factor, and with what it contradicts `cam_from_world` by, so that
/// paths avoid wrong edges. Other paths, which would add information, do not: errors of edges over
/// the same frames have much in common.
/// @param anchors  those without an orientation are ignored.
/// @return  of every view that a path reaches and that is no anchor: covariance of the error delta
///          in `Exp(delta) * cam_from_world`, rad^2, in the camera's frame.
/// Throws std::invalid_argument when an option is out of range.
/// Cost:    O(E log V), Dijkstra from all anchors at once.
std::map<FrameId, Eigen::Matrix3d> AnchorCovariances(const ViewGraph& graph,
                                                     const RotationMap& cam_from_world,
                                                     const std::set<FrameId>& anchors,
                                                     const AveragingOptions& options);

}  // namespace rotslam
