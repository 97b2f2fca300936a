#pragma once

#include <optional>

#include "krot/structure/minimax_problem.h"

namespace rotslam {

/// Centres and points whose rays are nearest to what was seen, whatever their depths: the least sum
/// of |v - s (X - c)|^2 over the observations, v the ray and s > 0 one over the depth, each squared
/// distance d^2 counted as d^2 / (1 + d^2 / loss_rad^2). Starts from all depths equal, so it needs
/// no first structure, and shares nothing with the linear programs.
/// @param problem   may hold outliers, a tenth and more, and nothing fixed.
/// @param loss_rad  angle off its ray from which on an observation is an outlier; above 0.
/// @return  nullopt for fewer than two views, or where no system can be solved. First centre at the
///          origin, scale free. Throws std::invalid_argument for what is fixed or a loss of 0.
/// Error:   truth to 1e-6 of the scene's size on clean scenes; 0.02 m over a street of 30 m with
///          0.7 px of noise, 0.03 deg of rotation error and one outlier in three. Along ways that
///          do not close on themselves the scale shrinks with the rotations' error: at 0.1 deg to
///          half over 150 views.
/// Cost:    30 to 200 factorisations of the centres' system (StructureSystem).
/// Source:  Zhuang, Cheong & Lee, Baseline Desensitizing in Translation Averaging, CVPR 2018; Pan
///          et al., Global Structure-from-Motion Revisited, ECCV 2024. Ours has no random start,
///          eliminates the depths, and damps nothing but them: then each step lies between the
///          answer for depths as they are and Gauss and Newton's, neither of which sees the scale.
std::optional<MinimaxStructure> SolveGlobalPositioning(const MinimaxProblem& problem,
                                                       double loss_rad);

}  // namespace rotslam
