#pragma once

#include <optional>

#include "krot/minimax_problem.h"

namespace rotslam {

/// Centres and points from linear equations in the centres alone: each point lies on the ray of one
/// of its views at the depth that a second one gives it, so that every other view's ray makes three
/// equations between three centres. Shares nothing with the linear programs but what they kept, and
/// so tells whether a minimum depends on where one starts.
/// @param problem  without gross outliers: one in a hundred spoils it.
/// @return  nullopt when the centres are not determined. First centre at the origin, scale free.
/// Error:   truth to 1e-6 of the scene's size on clean scenes; 0.06 m over a street of 30 m with
///          0.7 px of noise and 0.03 deg of rotation error. What hangs on few points is drawn
///          together.
/// Cost:    linear in the observations plus a sparse Cholesky of 3 unknowns per view.
/// Source:  Cai et al., A Pose-only Solution to Visual Reconstruction and Navigation, PAMI 2023;
///          ours weights by the parallax that a depth comes from. Rounds of reweighting, by
///          distance or by residual, drew more and more together on hand-held sequences.
std::optional<MinimaxStructure> SolveLinearStart(const MinimaxProblem& problem);

}  // namespace rotslam
