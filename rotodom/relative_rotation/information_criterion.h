#pragma once

#include <vector>

namespace rotslam {

// Torr's geometric information criterion for matches, points in four dimensions (two images): what
// a model leaves unexplained, in variances of the noise and cut off where a match is wrong, and
// what the model costs. The smaller one is the better model; sums over pairs of views compare, too.
// Source:  Torr, Geometric motion segmentation and model selection, 1998.

/// Of rotation and direction of translation.
/// @param squared_distances  of all matches, see SquaredDistances.
/// @param noise              standard deviation of one view's bearings, rad.
double EpipolarCriterion(const std::vector<double>& squared_distances, double noise);

/// Of rotation alone.
/// @param squared_flows  of all matches, see SquaredFlows.
double RotationCriterion(const std::vector<double>& squared_flows, double noise);

}  // namespace rotslam
