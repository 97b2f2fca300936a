// Positions and points from known rotations: known_rotation PROBLEM, a COLMAP model, a run's folder
// or known_rotation.txt
#include "krot/known_rotation.h"

#include <cstdio>
#include <exception>

#include "output/export/known_rotation_file.h"

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: known_rotation PROBLEM\n");
    return 2;
  }
  // From anywhere else: cam_from_world by view, and tracks whose observations have a bearing.
  const rotslam::KnownRotationInput input = rotslam::ReadKnownRotation(argv[1]);
  rotslam::KrotOptions options;
  options.num_threads = 2;
  const rotslam::KrotSolution solution = rotslam::SolveKnownRotation(
      input.cam_from_world, input.tracks, input.camera, options, input.sigma_rad);
  std::fprintf(stderr, "%s: %s\n", ToString(solution.status).c_str(), solution.message.c_str());
  if (!solution.Usable()) return 1;
  // The least possible largest residual of the observations that are left, per image axis.
  const double focal_px = input.camera.MeanFocal();
  std::fprintf(stderr,
               "largest residual %.4f px, at least %.4f px; %zu points, %zu observations removed\n",
               focal_px * solution.gamma_high,
               focal_px * solution.gamma_low,
               solution.point_in_world.size(),
               solution.removed.size());

  // Each component has an origin and a scale of its own.
  std::printf("# view component x y z\n");
  for (const auto& [view, center] : solution.center_in_world) {
    std::printf("%s %d %.9f %.9f %.9f\n",
                NameOf(input, view).c_str(),
                solution.component.at(view),
                center.x(),
                center.y(),
                center.z());
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "known_rotation: %s\n", error.what());
  return 1;
}
