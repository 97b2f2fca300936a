#include "apps/slam/map/calibration_check.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

constexpr double kNoisePx = 0.3;

// A map as bundle adjustment leaves it with a calibration whose focal length is `share` of the true
// one.
Reconstruction MapOf(const BaScene& scene, const Camera& calibrated) {
  BundleProblem problem;
  problem.camera = calibrated;
  problem.start = scene.truth;
  for (Track& track : problem.start.tracks) {
    for (Observation& observation : track.observations) {
      observation.bearing = *calibrated.Unproject(observation.keypoint_px);
    }
  }
  return RefineBundle(problem, BundleOptions{}).reconstruction;
}

CalibrationCheck CheckOf(const BaScene& scene, double share) {
  Camera calibrated = scene.camera;
  calibrated.fx *= share;
  calibrated.fy *= share;
  const Reconstruction map = MapOf(scene, calibrated);
  return CheckCalibration(map, map.tracks, calibrated, BundleOptions{});
}

// Moves observations as lenses, shutters and matching do: alike where they are near one another in
// the image, and more than their deviations say. Waves of 150 to 400 px, each of a direction of its
// own.
BaScene WithCommonErrors(BaScene scene, double amplitude_px, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  struct Wave {
    Eigen::Vector2d frequency;
    Eigen::Vector2d shift_px;
    double phase;
  };
  std::vector<Wave> waves;
  for (int k = 0; k < 6; ++k) {
    const double direction = uniform(0.0, 2.0 * std::numbers::pi);
    const double shift = uniform(0.0, 2.0 * std::numbers::pi);
    const double frequency = 2.0 * std::numbers::pi / uniform(150.0, 400.0);
    waves.push_back({frequency * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
                     amplitude_px / 2.0 * Eigen::Vector2d(std::cos(shift), std::sin(shift)),
                     uniform(0.0, 2.0 * std::numbers::pi)});
  }
  for (Track& track : scene.truth.tracks) {
    for (Observation& observation : track.observations) {
      const Eigen::Vector2d at = observation.keypoint_px;
      for (const Wave& wave : waves) {
        observation.keypoint_px += std::sin(wave.frequency.dot(at) + wave.phase) * wave.shift_px;
      }
      observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
      observation.sigma_px = kNoisePx;
    }
  }
  return scene;
}

TEST(CalibrationCheck, NoticesAFocalLengthThatIsFivePercentOff) {
  BaSceneOptions options;
  options.noise_px = kNoisePx;
  options.num_frames = 80;
  options.num_points = 3000;
  const BaScene scene = MakeBaScene(options);
  for (const double share : {0.95, 1.05}) {
    const CalibrationCheck check = CheckOf(scene, share);
    EXPECT_TRUE(check.Contradicts()) << share << ": found " << check.share << " +- " << check.sigma;
    EXPECT_NEAR(check.share, 1.0 / share, 0.02) << share;
  }
}

TEST(CalibrationCheck, ErrorsThatNeighboursHaveInCommonAreNoEvidence) {
  BaSceneOptions options;
  options.noise_px = kNoisePx;
  options.num_frames = 12;
  options.spacing = 0.2;
  for (std::uint32_t seed = 1; seed <= 8; ++seed) {
    options.seed = seed;
    const BaScene scene = WithCommonErrors(MakeBaScene(options), 1.5, seed);
    const CalibrationCheck check = CheckOf(scene, 1.0);
    ASSERT_TRUE(check.is_known) << seed;
    EXPECT_FALSE(check.Contradicts()) << seed << ": " << check.share << " +- " << check.sigma;
  }
}

}  // namespace
}  // namespace rotslam
