#pragma once

#include <optional>
#include <string>

#include "krot/minimax_problem.h"

namespace rotslam {

struct LinearStartOptions {
  // Rounds of reweighting: by the points' distance, and less for what is off its point.
  int max_rounds = 4;
  // Angle, rad, at which an observation has half its weight; 4 px at f = 700.
  double scale_rad = 0.0057;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_rounds", max_rounds);
    visit("scale_rad", scale_rad);
  }
};

/// Centres and points from linear equations in the centres alone: each point lies on the ray of one
/// of its views at the depth that a second one gives it, so that every other view's ray makes three
/// equations between three centres. Shares nothing with the linear programs but what they kept, and
/// so tells whether a minimum depends on where one starts.
/// @param problem  without gross outliers: one in a hundred spoils the first round.
/// @return  nullopt when the centres are not determined. First centre at the origin, scale free.
/// Error:   truth to 1e-6 of the scene's size on clean scenes; 0.06 m over a street of 30 m with
/// 0.7
///          px of noise and 0.03 deg of rotation error.
/// Cost:    per round linear in the observations plus a sparse Cholesky of 3 unknowns per view.
/// Source:  Cai et al., A Pose-only Solution to Visual Reconstruction and Navigation, PAMI 2023;
///          ours divides each equation by the point's distance, so that all count alike, and
///          reweights.
std::optional<MinimaxStructure> SolveLinearStart(const MinimaxProblem& problem,
                                                 const LinearStartOptions& options = {});

}  // namespace rotslam
