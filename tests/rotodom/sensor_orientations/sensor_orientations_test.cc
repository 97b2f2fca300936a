#include "rotodom/sensor_orientations/sensor_orientations.h"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "rotodom/sensor_orientations/random_walk.h"

namespace rotslam {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

Eigen::Vector3d Normal(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return {normal(random), normal(random), normal(random)};
}

// A camera in a hand, and a sensor on it.
struct Rig {
  int num_frames = 150;
  double fps = 30.0;
  double image_drift_deg = 0.005;  // a frame
  double sensor_hz = 100.0;
  double noise_deg = 0.05;
  double sensor_drift_deg = 0.0;  // an orientation
  double late_s = 0.04;
  Rotation cam_from_sensor =
      Rotation::Exp(1.7 * kRadFromDeg * Eigen::Vector3d(1.0, -2.0, 0.5).normalized());
  std::uint64_t seed = 1;

  static Rotation CamFromWorld(double s) {
    const Eigen::Vector3d turn(0.12 * std::sin(2.1 * s) + 0.03 * std::sin(9.0 * s + 1.0),
                               0.30 * std::sin(1.3 * s + 0.4) + 0.04 * std::sin(7.0 * s),
                               0.08 * std::sin(1.7 * s + 2.0) + 0.02 * std::sin(8.0 * s));
    return Rotation::Exp(turn);
  }

  double Time(int frame) const { return 1000.0 + frame / fps; }

  ImageOrientations Images() const {
    std::mt19937_64 random(seed);
    ImageOrientations images;
    Rotation error;
    for (int k = 0; k < num_frames; ++k) {
      images.timestamps_s.push_back(Time(k));
      images.cam_from_world.push_back(CamFromWorld(k / fps) * error);
      if (k > 0) images.step_variance.push_back(std::pow(image_drift_deg * kRadFromDeg, 2));
      error = error * Rotation::Exp(image_drift_deg * kRadFromDeg * Normal(random));
    }
    return images;
  }

  // From a part of the frames' time to another one.
  std::vector<StampedRotation> Sensor(double from = 0.0, double to = 1.0) const {
    std::mt19937_64 random(seed + 100);
    std::vector<StampedRotation> given;
    const Rotation world_from_cam_world = Rotation::Exp({0.3, -0.6, 0.9});
    Rotation drift;
    for (double s = from * num_frames / fps; s < to * num_frames / fps; s += 1.0 / sensor_hz) {
      const Rotation noise = Rotation::Exp(noise_deg * kRadFromDeg * Normal(random));
      given.push_back(
          {1000.0 + s + late_s,
           world_from_cam_world * drift * CamFromWorld(s).Inverse() * cam_from_sensor * noise,
           std::nullopt});
      drift = drift * Rotation::Exp(sensor_drift_deg * kRadFromDeg * Normal(random));
    }
    return given;
  }

  double MountingErrorDeg(const SensorAlignment& alignment) const {
    return (alignment.cam_from_sensor * cam_from_sensor.Inverse()).AngleDeg();
  }

  // Root mean square over all pairs of frames of the error of the rotation between them, deg.
  double ErrorDeg(const std::vector<Rotation>& cam_from_world) const {
    double sum = 0.0;
    int number = 0;
    for (int i = 0; i < num_frames; i += 3) {
      for (int j = 0; j < i; j += 3) {
        const Rotation measured = cam_from_world[i] * cam_from_world[j].Inverse();
        const Rotation true_one = CamFromWorld(i / fps) * CamFromWorld(j / fps).Inverse();
        sum += std::pow((measured * true_one.Inverse()).AngleDeg(), 2);
        ++number;
      }
    }
    return std::sqrt(sum / number);
  }
};

SensorFusion Fuse(const Rig& rig, const ImageOrientations& images, bool use_alignment = true) {
  SensorFusionOptions options;
  options.use_alignment = use_alignment;
  const auto fusion = FuseOrientations(images, rig.Sensor(), options);
  EXPECT_TRUE(fusion.has_value());
  return fusion.value_or(SensorFusion());
}

TEST(SensorOrientations, OffsetAndMountingAreFoundWithTheirDeviations) {
  // Images as an odometry and as a map has them.
  for (const double drift_deg : {0.005, 0.001}) {
    for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
      SCOPED_TRACE(std::to_string(drift_deg) + " deg a frame, seed " + std::to_string(seed));
      Rig rig;
      rig.seed = seed;
      rig.image_drift_deg = drift_deg;
      rig.num_frames = 300;
      const ImageOrientations images = rig.Images();
      const SensorFusion fusion = Fuse(rig, images);
      const SensorAlignment& alignment = fusion.alignment;
      EXPECT_TRUE(alignment.has_offset && alignment.has_mounting);
      EXPECT_NEAR(alignment.offset_s, rig.late_s, 0.002);
      EXPECT_LT(rig.MountingErrorDeg(alignment), drift_deg < 0.002 ? 0.05 : 0.15);
      // The deviations are neither too small nor of no use.
      EXPECT_NEAR(alignment.offset_s, rig.late_s, 4.0 * alignment.offset_sigma_s);
      EXPECT_LT(alignment.offset_sigma_s, 0.001);
      const Eigen::Vector3d error =
          (alignment.cam_from_sensor * rig.cam_from_sensor.Inverse()).Log();
      EXPECT_LT(error.dot(alignment.mounting_covariance.inverse() * error), 16.0);
      EXPECT_LT(std::sqrt(alignment.mounting_covariance.trace()) * kDegFromRad, 0.2);
      if (drift_deg > 0.002) {
        EXPECT_LT(rig.ErrorDeg(fusion.cam_from_world), rig.ErrorDeg(images.cam_from_world));
      }
      // Three or four orientations a frame.
      EXPECT_NEAR(fusion.sigma_rad * kDegFromRad, 0.05 / std::sqrt(3.3), 0.01);
      EXPECT_EQ(fusion.num_outliers, 0);
    }
  }
}

TEST(SensorOrientations, AreNeverWorseThanNone) {
  const auto expect_no_worse = [](const Rig& rig, const char* name) {
    SCOPED_TRACE(name);
    const ImageOrientations images = rig.Images();
    const SensorFusion fusion = Fuse(rig, images, false);
    EXPECT_LT(rig.ErrorDeg(fusion.cam_from_world), 1.02 * rig.ErrorDeg(images.cam_from_world));
  };
  for (const double late_s : {0.0, 0.01, 0.04, 0.1, -0.1}) {
    Rig rig;
    rig.late_s = late_s;
    expect_no_worse(rig, "late");
  }
  Rig noisy;
  noisy.noise_deg = 3.0;
  expect_no_worse(noisy, "noisy");
  Rig drifting;
  drifting.sensor_drift_deg = 0.05;
  drifting.late_s = 0.0;
  drifting.cam_from_sensor = Rotation();
  expect_no_worse(drifting, "drifting");
}

TEST(SensorOrientations, HelpWhereTheImagesAreBad) {
  Rig rig;
  rig.image_drift_deg = 0.1;
  const ImageOrientations poor = rig.Images();
  EXPECT_LT(rig.ErrorDeg(Fuse(rig, poor).cam_from_world), 0.3 * rig.ErrorDeg(poor.cam_from_world));
  // A stretch in the dark.
  rig.image_drift_deg = 0.005;
  ImageOrientations dark = rig.Images();
  for (int k = 60; k < 90; ++k) dark.cam_from_world[k] = dark.cam_from_world[59];
  for (int k = 90; k < rig.num_frames; ++k) {
    dark.cam_from_world[k] = dark.cam_from_world[k] * Rotation::Exp({0.2, 0.4, 0.0});
  }
  for (int k = 59; k < 90; ++k) dark.step_variance[k] = kNever;
  dark.is_known.assign(rig.num_frames, true);
  for (int k = 60; k < 90; ++k) dark.is_known[k] = false;
  const SensorFusion fusion = Fuse(rig, dark);
  EXPECT_NEAR(fusion.alignment.offset_s, rig.late_s, 0.002);
  EXPECT_LT(rig.ErrorDeg(fusion.cam_from_world), 0.1);
  EXPECT_EQ(fusion.source[75], OrientationSource::kSensor);
  EXPECT_EQ(fusion.source[20], OrientationSource::kBoth);
}

TEST(SensorOrientations, MayCoverPartsOfTheFramesOrBeFew) {
  Rig rig;
  const ImageOrientations images = rig.Images();
  SensorFusionOptions options;
  options.use_alignment = true;
  const auto half = FuseOrientations(images, rig.Sensor(0.0, 0.5), options);
  ASSERT_TRUE(half);
  EXPECT_EQ(half->source[30], OrientationSource::kBoth);
  EXPECT_EQ(half->source[120], OrientationSource::kImages);
  EXPECT_LT(rig.ErrorDeg(half->cam_from_world), 1.02 * rig.ErrorDeg(images.cam_from_world));
  EXPECT_GT(half->variance[140], half->variance[30]);

  rig.num_frames = 900;
  rig.sensor_hz = 1.0;
  const ImageOrientations many = rig.Images();
  const SensorFusion slow = Fuse(rig, many);
  EXPECT_NEAR(slow.alignment.offset_s, rig.late_s, 0.002);
  EXPECT_LT(rig.MountingErrorDeg(slow.alignment), 0.2);
  EXPECT_LT(rig.ErrorDeg(slow.cam_from_world), rig.ErrorDeg(many.cam_from_world));
  EXPECT_FALSE(FuseOrientations(images, {{0.0, Rotation(), {}}, {1.0, Rotation(), {}}}, options));
}

TEST(SensorOrientations, MayHaveAxesOfTheirOwnAndWrongOnesAmongThem) {
  Rig rig;
  Eigen::Matrix3d cam_from_body;  // a body with x forward, z up
  cam_from_body << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  rig.cam_from_sensor = Rotation::FromMatrix(cam_from_body);
  rig.late_s = -0.3;
  rig.sensor_hz = 30.0;  // each counts
  const ImageOrientations images = rig.Images();
  std::vector<StampedRotation> given = rig.Sensor();
  for (const std::size_t wrong : {40, 77, 120}) {
    given[wrong].world_from_cam = given[wrong].world_from_cam * Rotation::Exp({0.4, 0.0, 0.1});
  }
  SensorFusionOptions options;
  options.use_alignment = true;
  const auto fusion = FuseOrientations(images, given, options);
  ASSERT_TRUE(fusion);
  EXPECT_NEAR(fusion->alignment.offset_s, rig.late_s, 0.002);
  EXPECT_LT(rig.MountingErrorDeg(fusion->alignment), 0.1);
  EXPECT_GE(fusion->num_outliers, 3);
  EXPECT_LT(rig.ErrorDeg(fusion->cam_from_world), rig.ErrorDeg(images.cam_from_world));
}

TEST(SensorOrientations, OfARotationAboutOneAxisTellNothingAboutIt) {
  Rig rig;
  ImageOrientations images = rig.Images();
  std::vector<StampedRotation> given;
  for (int k = 0; k < rig.num_frames; ++k) {
    const Rotation turn = Rotation::Exp({0.0, 0.01 * k + 0.2 * std::sin(0.1 * k), 0.0});
    images.cam_from_world[k] = turn;
    given.push_back({rig.Time(k), turn.Inverse(), std::nullopt});
  }
  const auto fusion = FuseOrientations(images, given, {});
  ASSERT_TRUE(fusion);
  EXPECT_FALSE(fusion->alignment.has_mounting);
  EXPECT_GT(std::sqrt(fusion->alignment.mounting_covariance(1, 1)),
            100.0 * std::sqrt(fusion->alignment.mounting_covariance(0, 0)));
}

TEST(SensorOrientations, ThrowWhatTheContractForbids) {
  Rig rig;
  ImageOrientations images = rig.Images();
  SensorFusionOptions options;
  options.max_gap_s = 0.0;
  EXPECT_THROW(FuseOrientations(images, rig.Sensor(), options), std::invalid_argument);
  EXPECT_THROW(FuseOrientations(images, {}, {}), std::invalid_argument);
  images.step_variance.pop_back();
  EXPECT_THROW(FuseOrientations(images, rig.Sensor(), {}), std::invalid_argument);
}

TEST(RandomWalkSmoother, SolvesWhatADenseSolverSolves) {
  const std::vector<double> weights = {0.0, 2.0, 0.0, 5.0, 1.0, 0.0};
  const std::vector<double> steps = {0.5, 2.0, 1e-6, 0.1, 3.0};
  std::mt19937_64 random(3);
  Eigen::MatrixXd observations(6, 3);
  for (int k = 0; k < 6; ++k) observations.row(k) = Normal(random).transpose();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(6, 6);
  for (int k = 0; k < 6; ++k) normal(k, k) += weights[k];
  for (int k = 0; k < 5; ++k) {
    normal(k, k) += 1.0 / steps[k];
    normal(k + 1, k + 1) += 1.0 / steps[k];
    normal(k, k + 1) -= 1.0 / steps[k];
    normal(k + 1, k) -= 1.0 / steps[k];
  }
  const Eigen::MatrixXd inverse = normal.inverse();
  const RandomWalkSmoother smoother(weights, steps);
  const Eigen::Map<const Eigen::VectorXd> w(weights.data(), 6);
  const Eigen::MatrixXd expected = inverse * (w.asDiagonal() * observations);
  EXPECT_LT((smoother.Smooth(observations) - expected).norm(), 1e-8);
  const std::vector<double> variances = smoother.Variances();
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(variances[k], inverse(k, k), 1e-8);
}

}  // namespace
}  // namespace rotslam
