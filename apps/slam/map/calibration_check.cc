#include "apps/slam/map/calibration_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/slam/map/refinement.h"
#include "apps/slam/map/some_tracks.h"

namespace rotslam {
namespace {

// Enough for a focal length to a few tenths of a percent, at a hundredth of a run's time.
constexpr int kObservationsPerFrame = 120;
constexpr int kLeastFrames = 5;

}  // namespace

bool CalibrationCheck::Contradicts() const {
  // Good calibrations of real cameras are up to 1.6 % from what the images say of them.
  constexpr double kLeast = 0.02;
  constexpr double kSigmas = 2.5;
  // A camera that moves too little to tell the focal length better than this is wrong about it by
  // more than its deviation: up to 3.3 of them in 120 frames of a room.
  constexpr double kTold = 0.015;
  constexpr double kSigmasInDoubt = 5.0;
  const double error = std::abs(share - 1.0);
  return is_known && error > std::max(kLeast, (sigma < kTold ? kSigmas : kSigmasInDoubt) * sigma);
}

CalibrationCheck CheckCalibration(const Reconstruction& map,
                                  const std::vector<Track>& tracks,
                                  const Camera& refined,
                                  const BundleOptions& options) {
  // A focal length that is found farther off than this is sought again from there, with the
  // observations that fit by then.
  constexpr double kDoubtful = 0.006;
  constexpr int kMaxPasses = 6;
  CalibrationCheck check;
  if (map.center_in_world.size() < kLeastFrames) return check;
  BundleOptions freed = options;
  freed.fixed_rotation.enabled = false;
  freed.fine.enabled = false;
  freed.preparing_observations = 0;
  freed.find_lens_covariance = true;
  // A map that was bent to a wrong focal length is led back by many small steps.
  freed.coarse.max_iterations = 100;
  freed.coarse.function_tolerance = 1e-6;
  freed.lens = {};
  freed.lens.refine_focal = true;
  freed.lens.focal_sigma = 0.5;
  freed.lens.min_gain = 0.0;
  freed.lens.weighs_by_residuals = true;
  // Where all that was tracked leaves something open, what fits the map does not.
  for (const std::vector<Track>* seen : {&tracks, &map.tracks}) {
    BundleProblem problem;
    problem.camera = refined;
    problem.start = map;
    problem.start.tracks = SomeTracks(*seen, kObservationsPerFrame);
    for (int pass = 0; pass < kMaxPasses; ++pass) {
      const BundleResult result = RefineBundle(problem, freed);
      if (!result.Usable() || !result.summary.lens_sigmas) break;
      const double before = check.share;
      check.is_known = true;
      check.share = result.camera.fx / refined.fx;
      check.sigma = result.summary.lens_sigmas->focal_px / refined.fx;
      if (std::abs(check.share - before) < kDoubtful) break;
      problem.camera = result.camera;
      problem.start.cam_from_world = result.reconstruction.cam_from_world;
      problem.start.center_in_world = result.reconstruction.center_in_world;
      problem.start.point_in_world = result.reconstruction.point_in_world;
      problem.start.tracks = WithBearingsOf(result.camera, std::move(problem.start.tracks));
    }
    if (check.is_known) break;
  }
  return check;
}

}  // namespace rotslam
