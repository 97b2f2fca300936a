#pragma once

#include <vector>

namespace rotslam {

// Torr's geometric information criterion for matches, which are points in four dimensions (two
// images): the truncated residuals, in variances of the noise, plus the cost of the model. The
// smaller value denotes the better model; sums over pairs of views can be compared as well.
// Source:  Torr, Geometric motion segmentation and model selection, 1998.

/// The criterion for rotation and direction of translation.
/// @param squared_distances  of all matches, see SquaredDistances.
/// @param noise              standard deviation of one view's bearings, rad.
double EpipolarCriterion(const std::vector<double>& squared_distances, double noise);

/// The criterion for rotation alone.
/// @param squared_flows  of all matches, see SquaredFlows.
double RotationCriterion(const std::vector<double>& squared_flows, double noise);

}  // namespace rotslam
