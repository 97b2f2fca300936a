#pragma once

#include <map>

#include "krot/structure/minimax_problem.h"
#include "tests/scenes/scene.h"

namespace rotslam {

/// All observations of a scene with the rotations a solver is given.
inline MinimaxProblem ProblemFromScene(const Scene& scene) {
  MinimaxProblem problem;
  std::map<FrameId, int> view_of;
  for (const auto& [frame, rotation] : scene.cam_from_world) {
    view_of.emplace(frame, problem.num_views());
    problem.R_c_w.push_back(rotation.Matrix());
  }
  for (const Track& track : scene.tracks) {
    for (const Observation& observation : track.observations) {
      problem.observations.push_back({view_of.at(observation.frame),
                                      problem.num_points,
                                      observation.bearing.head<2>() / observation.bearing.z()});
    }
    ++problem.num_points;
  }
  return problem;
}

}  // namespace rotslam
