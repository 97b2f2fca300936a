#pragma once

#include "rotodom/types/view_graph.h"

namespace rotslam {

/// How much larger the errors of the edges are than their covariances say, as a ratio of variances:
/// the mean squared Mahalanobis distance / 3 from the identity of the rotations around the
/// triangles of the view-graph. A triangle closes but for the errors of its edges, whatever causes
/// them: blur, a rolling shutter, things that move. What its three edges have in common remains
/// unseen. A few wrong edges do not count.
/// Only what is told to people and other programs counts with it: the stages weight edges against
/// one another.
/// @return  at least 1; 1 where there are fewer than 10 triangles.
/// Error:   1.05 to 1.35 for 400 edges whose errors are independent, normal and as they say
///          (closure_test.cc).
/// Cost:    about 1 us per triangle.
double ClosureVariance(const ViewGraph& graph);

}  // namespace rotslam
