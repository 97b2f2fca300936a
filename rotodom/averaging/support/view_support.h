#pragma once

#include <map>
#include <set>
#include <span>
#include <vector>

#include "rotodom/types/view_graph.h"

namespace rotslam {

/// How well the edges that agree with averaged orientations hold each view.
///
/// The support of a view is the largest k for which it belongs to a set of views that have k edges
/// each within the set (its core number in the graph of the inliers). Where a single edge ties a
/// group of views to the rest, the smaller side, or the one without a fixed view, has support one:
/// nothing confirms that edge. A view without an inlier has none.
/// @param is_inlier   by edge.
/// @param held_views  with fixed orientations.
/// @return  by view of the edges.
std::map<FrameId, int> SupportOfViews(std::span<const RelativeRotation> edges,
                                      const std::vector<char>& is_inlier,
                                      const std::set<FrameId>& held_views);

}  // namespace rotslam
