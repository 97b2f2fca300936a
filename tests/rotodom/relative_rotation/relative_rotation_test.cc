#include "rotodom/relative_rotation/relative_rotation.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/rotodom/relative_rotation/pair_scene.h"

namespace rotslam {
namespace {

double ErrorDeg(const Rotation& estimate, const Rotation& truth) {
  return (estimate * truth.Inverse()).AngleDeg();
}

double MedianErrorDeg(PairSceneOptions scene_options, int num_scenes) {
  std::vector<double> errors;
  for (int k = 0; k < num_scenes; ++k) {
    scene_options.seed = 100 + k;
    const PairScene scene = MakePairScene(scene_options);
    const auto estimate = EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 1);
    errors.push_back(estimate ? ErrorDeg(estimate->j_from_i, scene.j_from_i) : 180.0);
  }
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() / 2];
}

TEST(MinimizeNormalEpipolar, FindsTheTruthFromCleanPairs) {
  const PairScene scene = MakePairScene({.noise_px = 0.0, .rotation_deg = 2.0});
  NormalEpipolarSums sums;
  for (const BearingPair& pair : scene.pairs) sums.Add(pair);
  const NormalEpipolarMinimum minimum = MinimizeNormalEpipolar(sums, Rotation(), 50);
  EXPECT_LT(ErrorDeg(minimum.j_from_i, scene.j_from_i), 1e-6);
  EXPECT_NEAR(std::abs(minimum.translation_direction.dot(scene.translation_direction)), 1.0, 1e-9);
}

TEST(MinimizeNormalEpipolar, SumsEqualTheSlowDefinition) {
  const PairScene scene = MakePairScene({.num_pairs = 50});
  NormalEpipolarSums sums;
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  const NormalEpipolarMinimum minimum = [&] {
    for (const BearingPair& pair : scene.pairs) sums.Add(pair);
    return MinimizeNormalEpipolar(sums, Rotation(), 50);
  }();
  for (const BearingPair& pair : scene.pairs) {
    const Eigen::Vector3d n = (minimum.j_from_i * pair.bearing_i).cross(pair.bearing_j);
    M += n * n.transpose();
  }
  const Eigen::Vector3d& t = minimum.translation_direction;
  EXPECT_NEAR(t.dot(M * t), minimum.smallest_eigenvalue, 1e-12);
}

TEST(AlignBearings, IsExactOnPureRotation) {
  const PairScene scene =
      MakePairScene({.baseline_over_depth = 0.0, .noise_px = 0.0, .rotation_deg = 40.0});
  const auto rotation = AlignBearings(scene.pairs);
  ASSERT_TRUE(rotation);
  EXPECT_LT(ErrorDeg(*rotation, scene.j_from_i), 1e-9);
  EXPECT_FALSE(AlignBearings(std::span(scene.pairs).first(1)));
}

// Medians over 15 scenes, 500 matches, 0.5 px at f = 700. Bands: 1.5 times what was measured when
// the estimator was written (0.0069, 0.036, 0.024, 0.0098, 0.049, 0.072 deg). OpenGV's eigensolver
// reaches 0.008, 0.124 and 0.021 deg on the first three baselines of a comparable scene.
TEST(EstimateRelativeRotation, LadderOfBaselinesAndOutliers) {
  struct Rung {
    double baseline_over_depth;
    double outlier_ratio;
    double max_error_deg;
  };
  for (const Rung rung : {Rung{0.0, 0.0, 0.0105},
                          Rung{0.01, 0.0, 0.055},
                          Rung{0.1, 0.0, 0.036},
                          Rung{0.0, 0.25, 0.015},
                          Rung{0.1, 0.25, 0.073},
                          Rung{0.1, 0.5, 0.11}}) {
    const double error = MedianErrorDeg(
        {.baseline_over_depth = rung.baseline_over_depth, .outlier_ratio = rung.outlier_ratio}, 15);
    EXPECT_LT(error, rung.max_error_deg)
        << "baseline/depth " << rung.baseline_over_depth << ", outliers " << rung.outlier_ratio;
    RecordProperty("error_deg_" + std::to_string(rung.baseline_over_depth) + "_" +
                       std::to_string(rung.outlier_ratio),
                   std::to_string(error));
  }
}

TEST(EstimateRelativeRotation, ChoosesRotationOnlyByEvidence) {
  int chosen_without_baseline = 0;
  int chosen_with_baseline = 0;
  for (int k = 0; k < 20; ++k) {
    const auto choice = [&](double baseline) {
      const PairScene scene =
          MakePairScene({.baseline_over_depth = baseline, .seed = std::uint64_t(10 + k)});
      return EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 1)->rotation_only;
    };
    chosen_without_baseline += choice(0.0);
    chosen_with_baseline += choice(0.03);
  }
  EXPECT_GE(chosen_without_baseline, 19);
  EXPECT_LE(chosen_with_baseline, 1);
}

TEST(EstimateRelativeRotation, TranslationPointsForward) {
  const PairScene scene = MakePairScene({.noise_px = 0.1});
  const auto estimate = EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 1);
  ASSERT_TRUE(estimate);
  EXPECT_GT(estimate->translation_direction.dot(scene.translation_direction), 0.999);
}

TEST(EstimateRelativeRotation, SurvivesABadPrediction) {
  const PairScene scene =
      MakePairScene({.baseline_over_depth = 0.02, .outlier_ratio = 0.2, .rotation_deg = 8.0});
  const Rotation bad = Rotation::Exp({0.3, -0.3, 0.2});
  const auto estimate = EstimateRelativeRotation(scene.pairs, bad, kPairFocalPx, {}, 1);
  ASSERT_TRUE(estimate);
  EXPECT_LT(ErrorDeg(estimate->j_from_i, scene.j_from_i), 0.3);
}

TEST(EstimateRelativeRotation, ReadBackwardsIsTheInverse) {
  const PairScene scene = MakePairScene({.noise_px = 0.2});
  std::vector<BearingPair> backwards;
  for (const BearingPair& pair : scene.pairs) backwards.push_back({pair.bearing_j, pair.bearing_i});
  const auto forward = EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 1);
  const auto backward = EstimateRelativeRotation(backwards, Rotation(), kPairFocalPx, {}, 1);
  ASSERT_TRUE(forward && backward);
  EXPECT_LT((forward->j_from_i * backward->j_from_i).AngleDeg(), 1e-4);
}

TEST(EstimateRelativeRotation, CovarianceIsOfTheRightSize) {
  // Mean squared Mahalanobis distance over three degrees of freedom is one when the covariance is
  // true.
  for (const double baseline : {0.0, 0.1}) {
    double sum = 0.0;
    const int num_scenes = 60;
    for (int k = 0; k < num_scenes; ++k) {
      const PairScene scene =
          MakePairScene({.baseline_over_depth = baseline, .seed = std::uint64_t(200 + k)});
      const auto estimate = EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 1);
      ASSERT_TRUE(estimate);
      const Eigen::Vector3d delta = (scene.j_from_i * estimate->j_from_i.Inverse()).Log();
      sum += delta.dot(estimate->covariance.inverse() * delta) / 3.0;
    }
    EXPECT_GT(sum / num_scenes, 0.5) << baseline;
    EXPECT_LT(sum / num_scenes, 2.5) << baseline;
  }
}

TEST(EstimateRelativeRotation, SameSeedSameBytes) {
  const PairScene scene = MakePairScene({.outlier_ratio = 0.4});
  const auto a = EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 7);
  const auto b = EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 7);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->j_from_i.Quaternion().coeffs(), b->j_from_i.Quaternion().coeffs());
  EXPECT_EQ(a->inliers, b->inliers);
}

TEST(EstimateRelativeRotation, SaysNoToTooFewOrSenselessMatches) {
  EXPECT_FALSE(EstimateRelativeRotation({}, Rotation(), kPairFocalPx, {}, 1));
  RelativeRotationOptions strict;
  strict.min_inliers = 100;
  const PairScene nonsense = MakePairScene({.num_pairs = 200, .outlier_ratio = 1.0});
  EXPECT_FALSE(EstimateRelativeRotation(nonsense.pairs, Rotation(), kPairFocalPx, strict, 1));
}

TEST(EstimateRelativeRotation, RejectsABrokenContract) {
  PairScene scene = MakePairScene({});
  RelativeRotationOptions bad;
  bad.loss_sigmas = -1.0;
  EXPECT_THROW(EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, bad, 1),
               std::invalid_argument);
  scene.pairs[3].bearing_i.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(EstimateRelativeRotation(scene.pairs, Rotation(), kPairFocalPx, {}, 1),
               std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
