#include "rotodom/relative_rotation/pair_arrays.h"

#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/simd/simd_level.h"
#include "tests/rotodom/relative_rotation/pair_scene.h"

namespace rotslam {
namespace {

constexpr double kFloor = 1e-3;  // near the epipole

// An uneven number of pairs, so that there is padding; wrong ones among them.
PairScene Scene(double noise_ratio) {
  return MakePairScene(
      {.num_pairs = 101, .outlier_ratio = 0.2, .noise_ratio = noise_ratio, .seed = 5});
}

EpipolarModel NearTruth(const PairScene& scene) {
  return {Rotation::Exp({0.002, -0.001, 0.003}) * scene.j_from_i,
          (scene.translation_direction + Eigen::Vector3d(0.05, -0.1, 0.02)).normalized()};
}

double SlowSquaredDistance(const BearingPair& pair, const EpipolarModel& model) {
  const Eigen::Vector3d& t = model.direction;
  const Eigen::Vector3d& f = pair.bearing_j;
  const Eigen::Vector3d g = model.j_from_i * pair.bearing_i;
  const MatchNoise noise = pair.noise.value_or(MatchNoise{});
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(f);
  const Eigen::Matrix3d C = basis * noise.covariance_j * basis.transpose() + f * f.transpose();
  const Eigen::Vector3d moved = t.cross(g);
  const double D = noise.variance_i * t.cross(f).squaredNorm() + moved.dot(C * moved) + kFloor;
  const double e = t.dot(g.cross(f));
  return e * e / D;
}

// Half the gradient by central differences of the cost.
Eigen::Matrix<double, 5, 1> NumericGradient(const PairArrays& pairs,
                                            const EpipolarModel& model,
                                            double loss) {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 5, 1> gradient;
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(model.direction);
  for (int k = 0; k < 5; ++k) {
    const auto cost = [&](double step) {
      EpipolarModel moved = model;
      if (k < 3) {
        moved.j_from_i = Rotation::Exp(step * Eigen::Vector3d::Unit(k)) * model.j_from_i;
      } else {
        moved.direction = (model.direction + step * basis.col(k - 3)).normalized();
      }
      return LinearizeEpipolar(pairs, moved, loss).cost;
    };
    gradient[k] = 0.25 * (cost(kStep) - cost(-kStep)) / kStep;
  }
  return gradient;
}

TEST(PairArrays, DistancesAndCostEqualTheSlowDefinition) {
  for (const double noise_ratio : {1.0, 4.0}) {
    const PairScene scene = Scene(noise_ratio);
    const PairArrays pairs(scene.pairs);
    EXPECT_EQ(pairs.weighted(), noise_ratio != 1.0);
    const EpipolarModel model = NearTruth(scene);
    const double loss = 0.003;
    const std::vector<double> squared = SquaredDistances(pairs, model);
    ASSERT_EQ(squared.size(), scene.pairs.size());
    double cost = 0.0;
    for (std::size_t k = 0; k < squared.size(); ++k) {
      const double expected = SlowSquaredDistance(scene.pairs[k], model);
      EXPECT_NEAR(squared[k], expected, 1e-12 + 1e-9 * expected) << k;
      cost += loss * loss * expected / (loss * loss + expected);
    }
    EXPECT_NEAR(LinearizeEpipolar(pairs, model, loss).cost, cost, 1e-9 * cost);
  }
}

TEST(PairArrays, GradientEqualsCentralDifferences) {
  for (const double noise_ratio : {1.0, 4.0}) {
    const PairScene scene = Scene(noise_ratio);
    const PairArrays pairs(scene.pairs);
    const EpipolarModel model = NearTruth(scene);
    const double loss = 0.003;
    const EpipolarNormal normal = LinearizeEpipolar(pairs, model, loss);
    const auto numeric = NumericGradient(pairs, model, loss);
    EXPECT_LT((normal.gradient - numeric).norm(), 1e-5 * numeric.norm()) << noise_ratio;
  }
}

TEST(PairArrays, HessianIsTheOneOfLeastSquaresWithoutLoss) {
  // Clean pairs at the truth: residuals vanish, so the Gauss-Newton Hessian is the exact one.
  const PairScene scene = MakePairScene({.num_pairs = 50, .noise_px = 0.0});
  const PairArrays pairs(scene.pairs);
  const EpipolarModel truth{scene.j_from_i, scene.translation_direction};
  const Eigen::Matrix<double, 5, 5> H = LinearizeEpipolar(pairs, truth, 1.0).H;
  constexpr double kStep = 1e-5;
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(truth.direction);
  for (int k = 0; k < 5; ++k) {
    EpipolarModel moved = truth;
    if (k < 3) {
      moved.j_from_i = Rotation::Exp(kStep * Eigen::Vector3d::Unit(k)) * truth.j_from_i;
    } else {
      moved.direction = (truth.direction + kStep * basis.col(k - 3)).normalized();
    }
    const double cost = LinearizeEpipolar(pairs, moved, 1.0).cost;
    EXPECT_NEAR(cost, H(k, k) * kStep * kStep, 1e-3 * cost) << k;
  }
}

TEST(PairArrays, RotationStepSolvesCleanPairs) {
  for (const double noise_ratio : {1.0, 4.0}) {
    PairScene scene = MakePairScene(
        {.num_pairs = 51, .baseline_over_depth = 0.0, .noise_px = 0.0, .noise_ratio = noise_ratio});
    const PairArrays pairs(scene.pairs);
    const Rotation start = Rotation::Exp({1e-4, -2e-4, 1e-4}) * scene.j_from_i;
    const RotationNormal normal = LinearizeRotation(pairs, start, 1.0);
    const Eigen::Vector3d step = -normal.H.inverse() * normal.gradient;
    EXPECT_LT((Rotation::Exp(step) * start * scene.j_from_i.Inverse()).Angle(), 1e-7);
  }
}

TEST(PairArrays, NominalNoiseSpeltOutChangesNothing) {
  const PairScene scene = Scene(1.0);
  std::vector<BearingPair> spelt_out = scene.pairs;
  for (BearingPair& pair : spelt_out) pair.noise = MatchNoise{};
  const PairArrays plain(scene.pairs);
  const PairArrays weighted(spelt_out);
  const EpipolarModel model = NearTruth(scene);
  const EpipolarNormal a = LinearizeEpipolar(plain, model, 0.003);
  const EpipolarNormal b = LinearizeEpipolar(weighted, model, 0.003);
  EXPECT_LT((a.H - b.H).norm(), 1e-9 * a.H.norm());
  EXPECT_LT((a.gradient - b.gradient).norm(), 1e-9 * a.gradient.norm());
  const RotationNormal c = LinearizeRotation(plain, model.j_from_i, 0.003);
  const RotationNormal d = LinearizeRotation(weighted, model.j_from_i, 0.003);
  // The information is bounded by a part of 1e-6.
  EXPECT_LT((c.H - d.H).norm(), 1e-5 * c.H.norm());
}

TEST(PairArrays, ScoreEqualsTheSlowDefinitionAndGivesUpAtTheLimit) {
  const PairScene scene = Scene(1.0);
  const PairArrays pairs(scene.pairs);
  const EpipolarModel model{scene.j_from_i, scene.translation_direction};
  const double threshold = 1.5 / kPairFocalPx;
  // A fine scale makes factors so large that a block of them must be short.
  for (const double finest : {0.1 / kPairFocalPx, 1e-30}) {
    double score = 0.0;
    int num_inliers = 0;
    for (const BearingPair& pair : scene.pairs) {
      const double squared = SlowSquaredDistance(pair, model);
      const bool inlier = squared < threshold * threshold &&
                          pair.bearing_j.dot(model.j_from_i * pair.bearing_i) > 0.0;
      num_inliers += inlier;
      const double counted = inlier ? squared : threshold * threshold;
      score += std::log1p(counted / (finest * finest));
    }
    const double infinity = std::numeric_limits<double>::infinity();
    const HypothesisScore whole = ScoreEpipolar(pairs, model, {threshold, finest}, infinity);
    EXPECT_NEAR(whole.score, score, 1e-9 * score);
    EXPECT_EQ(whole.num_inliers, num_inliers);
    EXPECT_GE(ScoreEpipolar(pairs, model, {threshold, finest}, 0.3 * score).score, 0.3 * score);
  }
}

// All that the loops compute of some pairs.
std::vector<double> AllResults(const PairArrays& pairs, const EpipolarModel& model) {
  const double loss = 0.5 / kPairFocalPx;
  const ScoreBounds bounds{1.5 / kPairFocalPx, 0.1 / kPairFocalPx};
  const EpipolarNormal normal = LinearizeEpipolar(pairs, model, loss);
  const RotationNormal rotation = LinearizeRotation(pairs, model.j_from_i, loss);
  const std::vector<double> distances = SquaredDistances(pairs, model);
  const std::vector<double> flows = SquaredFlows(pairs, model.j_from_i);
  const HypothesisScore lines =
      ScoreEpipolar(pairs, model, bounds, std::numeric_limits<double>::infinity());
  const HypothesisScore half_lines = ScoreHalfLines(pairs, model, distances, bounds, loss);
  std::vector<double> all = {normal.cost,
                             lines.score,
                             double(lines.num_inliers),
                             half_lines.score,
                             double(half_lines.num_inliers),
                             double(CountBelow(distances, loss * loss))};
  all.insert(all.end(), normal.H.data(), normal.H.data() + normal.H.size());
  all.insert(all.end(), normal.gradient.data(), normal.gradient.data() + 5);
  all.insert(all.end(), rotation.H.data(), rotation.H.data() + rotation.H.size());
  all.insert(all.end(), rotation.gradient.data(), rotation.gradient.data() + 3);
  all.insert(all.end(), distances.begin(), distances.end());
  all.insert(all.end(), flows.begin(), flows.end());
  return all;
}

TEST(PairArrays, EveryLevelOfInstructionsGivesTheSame) {
  for (const double noise_ratio : {1.0, 3.0}) {
    const PairScene scene = Scene(noise_ratio);
    const PairArrays pairs(scene.pairs);
    std::vector<std::vector<double>> results;
    for (const SimdLevel level : {SimdLevel::kBaseline, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
      LimitSimdLevel(level);
      results.push_back(AllResults(pairs, NearTruth(scene)));
    }
    EXPECT_EQ(results[1], results[0]) << "AVX2, noise ratio " << noise_ratio;
    EXPECT_EQ(results[2], results[0]) << "AVX-512, noise ratio " << noise_ratio;
  }
}

TEST(PairArrays, HalfLinesEndAtInfinity) {
  // Points before both cameras, then the same with some of them behind.
  const PairScene scene = MakePairScene({.num_pairs = 101, .seed = 5});
  const EpipolarModel model{scene.j_from_i, scene.translation_direction};
  const ScoreBounds bounds{1.5 / kPairFocalPx, 0.1 / kPairFocalPx};
  const double infinity = std::numeric_limits<double>::infinity();
  std::vector<BearingPair> pairs = scene.pairs;
  const auto scores = [&] {
    const PairArrays arrays(pairs);
    return std::pair(ScoreEpipolar(arrays, model, bounds, infinity),
                     ScoreHalfLines(arrays, model, SquaredDistances(arrays, model), bounds, 0.0));
  };
  const auto [lines, half_lines] = scores();
  EXPECT_NEAR(half_lines.score, lines.score, 0.02 * lines.score);
  // Moved to the other side of the point at infinity, along the line.
  for (std::size_t k = 0; k < 20; ++k) {
    const Eigen::Vector3d g = model.j_from_i * pairs[k].bearing_i;
    pairs[k].bearing_j = (2.0 * g - pairs[k].bearing_j).normalized();
  }
  const auto [moved_lines, moved_half_lines] = scores();
  EXPECT_GT(moved_half_lines.score, moved_lines.score + 20.0);
  EXPECT_LT(moved_half_lines.num_inliers, moved_lines.num_inliers - 15);
}

TEST(PairArrays, ThinnedTakesPairsInOrder) {
  const PairArrays pairs(MakePairScene({.num_pairs = 103}).pairs);
  const PairArrays thinned = pairs.Thinned(10);
  ASSERT_EQ(thinned.size(), 10);
  EXPECT_EQ(thinned.BearingI(0), pairs.BearingI(0));
  EXPECT_EQ(thinned.BearingJ(9), pairs.BearingJ(92));
  EXPECT_EQ(pairs.Thinned(1000).size(), pairs.size());
}

TEST(TangentCovariance, IsTheOneOfNoisyPositions) {
  const Eigen::Vector3d bearing = Eigen::Vector3d(0.4, -0.2, 1.0).normalized();
  Eigen::Matrix2d image_covariance;
  image_covariance << 2.0, 0.5, 0.5, 0.3;
  const Eigen::Matrix2d L = image_covariance.llt().matrixL();
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(bearing);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  constexpr int kDraws = 20000;
  constexpr double kSigma = 1e-4;
  for (int k = 0; k < kDraws; ++k) {
    const Eigen::Vector2d offset = kSigma * L * Eigen::Vector2d(normal(random), normal(random));
    const Eigen::Vector3d moved =
        (bearing / bearing.z() + Eigen::Vector3d(offset.x(), offset.y(), 0.0)).normalized();
    const Eigen::Vector2d tangential = basis.transpose() * moved / kSigma;
    sum += tangential * tangential.transpose();
  }
  const Eigen::Matrix2d expected = TangentCovariance(bearing, image_covariance);
  EXPECT_LT((sum / kDraws - expected).norm(), 0.05 * expected.norm());
}

TEST(DifferenceCovariance, IsTheOneOfNoisyPositionsInBothImages) {
  const Eigen::Vector3d f_i = Eigen::Vector3d(0.4, -0.2, 1.0).normalized();
  const Rotation j_from_i = Rotation::Exp({0.1, -0.2, 0.8});
  const Eigen::Vector3d f_j = j_from_i * f_i;
  Eigen::Matrix2d C_i;
  C_i << 2.0, 0.5, 0.5, 0.3;
  Eigen::Matrix2d C_j;
  C_j << 0.4, -0.2, -0.2, 1.0;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 20000;
  constexpr double kSigma = 1e-4;
  const auto noisy = [&](const Eigen::Vector3d& bearing, const Eigen::Matrix2d& covariance) {
    const Eigen::Matrix2d L = covariance.llt().matrixL();
    const Eigen::Vector2d offset = kSigma * L * Eigen::Vector2d(normal(random), normal(random));
    const Eigen::Vector3d point =
        bearing / bearing.z() + Eigen::Vector3d(offset.x(), offset.y(), 0.0);
    return Eigen::Vector3d(point.normalized());
  };
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(f_j);
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  for (int k = 0; k < kDraws; ++k) {
    const Eigen::Vector2d difference =
        basis.transpose() * (j_from_i * noisy(f_i, C_i) - noisy(f_j, C_j)) / kSigma;
    sum += difference * difference.transpose();
  }
  const Eigen::Matrix2d expected =
      DifferenceCovariance(f_i, C_i, f_j, C_j, j_from_i.Matrix(), TangentBasis(f_j));
  EXPECT_LT((sum / kDraws - expected).norm(), 0.05 * expected.norm());
}

}  // namespace
}  // namespace rotslam
