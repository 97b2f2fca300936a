// Bundle adjustment against orientations that are known to some hundredths of a degree:
// adjust PROBLEM SIGMA_DEG
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "ba/bundle_adjustment.h"
#include "krot/known_rotation.h"
#include "output/export/known_rotation_file.h"

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fprintf(stderr, "usage: adjust PROBLEM SIGMA_DEG\n");
    return 2;
  }
  const rotslam::KnownRotationInput input = rotslam::ReadKnownRotation(argv[1]);
  const rotslam::KrotSolution start =
      rotslam::SolveKnownRotation(input.cam_from_world, input.tracks, input.camera, {});
  if (!start.Usable()) {
    std::fprintf(stderr, "adjust: no start: %s\n", start.message.c_str());
    return 1;
  }
  rotslam::BundleProblem problem;
  problem.camera = input.camera;
  problem.start.tracks = input.tracks;
  for (const auto& [view, center] : start.center_in_world) {
    if (start.component.at(view) != 0) continue;  // of another scale
    problem.start.cam_from_world[view] = input.cam_from_world.at(view);
    problem.start.center_in_world[view] = center;
    const double sigma_rad = std::atof(argv[2]) * rotslam::kRadFromDeg;
    if (sigma_rad > 0.0) problem.rotation_sigma_rad[view] = sigma_rad;  // else they are free
  }
  rotslam::BundleOptions options;
  options.num_threads = 2;
  const rotslam::BundleResult result = rotslam::RefineBundle(problem, options);
  std::fprintf(stderr, "%s: %s\n", Name(result.status), result.message.c_str());
  if (!result.Usable()) return 1;
  std::printf("%d observations of %d points, median error %.3f px, f = %.2f px\n",
              result.summary.num_observations,
              result.summary.num_points,
              result.summary.after.median_px,
              result.camera.MeanFocal());
} catch (const std::exception& error) {
  std::fprintf(stderr, "adjust: %s\n", error.what());
  return 1;
}
