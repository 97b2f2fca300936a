#include "rotodom/matching/patch_alignment.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "rotodom/simd/simd_level.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr int kSize = 240;
constexpr double kReachPx = 3.0;

// Smooth grey values known at every point of the plane, with structure in all directions.
class Texture {
 public:
  Texture() {
    SceneRandom random(7);
    for (int k = 0; k < 24; ++k) {
      const double wavelength_px = random.Uniform(9.0, 30.0);
      const double direction = random.Uniform(0.0, std::numbers::pi);
      waves_.push_back({2.0 * std::numbers::pi / wavelength_px *
                            Eigen::Vector2d(std::cos(direction), std::sin(direction)),
                        random.Uniform(0.0, 2.0 * std::numbers::pi)});
    }
  }

  double At(const Eigen::Vector2d& px) const {
    double sum = 0.0;
    for (const auto& [wave, phase] : waves_) sum += std::sin(wave.dot(px) + phase);
    return 128.0 + 10.0 * sum;  // standard deviation 35
  }

 private:
  struct Wave {
    Eigen::Vector2d wave;
    double phase;
  };
  std::vector<Wave> waves_;
};

struct Appearance {
  // A point x of the texture shows at turn * (x - middle) + middle + shift.
  Eigen::Matrix2d turn = Eigen::Matrix2d::Identity();
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  double gain = 1.0;
  double offset = 0.0;
  double noise = 0.0;
  std::uint64_t seed = 1;

  static Eigen::Vector2d Middle() { return Eigen::Vector2d::Constant(0.5 * kSize); }
  Eigen::Vector2d Move(const Eigen::Vector2d& px) const {
    return turn * (px - Middle()) + Middle() + shift_px;
  }
};

cv::Mat Draw(const Appearance& appearance) {
  static const Texture texture;
  // Streams of neighbouring seeds overlap.
  SceneRandom random(appearance.seed * 1'000'003);
  const Eigen::Matrix2d turn_back = appearance.turn.inverse();
  cv::Mat image(kSize, kSize, CV_8U);
  for (int row = 0; row < kSize; ++row) {
    for (int column = 0; column < kSize; ++column) {
      const Eigen::Vector2d from =
          turn_back * (Eigen::Vector2d(column, row) - Appearance::Middle() - appearance.shift_px) +
          Appearance::Middle();
      const double grey =
          appearance.gain * texture.At(from) + appearance.offset + random.Normal(appearance.noise);
      image.at<std::uint8_t>(row, column) =
          static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
    }
  }
  return image;
}

// Places all over the image, at all fractions of a pixel.
std::vector<Eigen::Vector2d> Places() {
  std::vector<Eigen::Vector2d> places;
  SceneRandom random(3);
  for (int row = 0; row < 14; ++row) {
    for (int column = 0; column < 14; ++column) {
      places.emplace_back(25.0 + 14.0 * column + random.Uniform(0.0, 1.0),
                          25.0 + 14.0 * row + random.Uniform(0.0, 1.0));
    }
  }
  return places;
}

Eigen::Matrix2d Turn(double angle_deg) {
  return Eigen::Rotation2Dd(angle_deg * std::numbers::pi / 180.0).toRotationMatrix();
}

struct Outcome {
  int num_sought = 0;
  int num_found = 0;
  double rms_px = 0.0;  // per image axis
  double mean_correlation = 0.0;
  double mahalanobis = 0.0;  // mean squared, over its two degrees of freedom
};

// Aligns patches of `first` with `second`, from about a pixel beside the truth.
Outcome AlignAll(const Appearance& first,
                 const Appearance& second,
                 const Eigen::Matrix2d& patch_from_view = Eigen::Matrix2d::Identity(),
                 double reach_px = kReachPx) {
  const cv::Mat image_first = Draw(first);
  const cv::Mat image_second = Draw(second);
  SceneRandom random(5);
  Outcome outcome;
  for (const Eigen::Vector2d& place : Places()) {
    ++outcome.num_sought;
    const auto patch = PatchTemplate::Sample(image_first, first.Move(place), patch_from_view);
    if (!patch) continue;
    const Eigen::Vector2d truth_px = second.Move(place);
    const Eigen::Vector2d start_px =
        truth_px + Eigen::Vector2d(random.Uniform(-1.0, 1.0), random.Uniform(-1.0, 1.0));
    const auto found = AlignPatch(*patch, image_second, start_px, reach_px);
    if (!found) continue;
    const Eigen::Vector2d error_px = found->center_px - truth_px;
    ++outcome.num_found;
    outcome.rms_px += error_px.squaredNorm();
    outcome.mean_correlation += found->correlation;
    outcome.mahalanobis += error_px.dot(found->covariance.inverse() * error_px);
  }
  outcome.rms_px = std::sqrt(outcome.rms_px / (2.0 * outcome.num_found));
  outcome.mean_correlation /= outcome.num_found;
  outcome.mahalanobis /= 2.0 * outcome.num_found;
  return outcome;
}

void Record(const std::string& name, const Outcome& outcome) {
  testing::Test::RecordProperty(name,
                                "rms " + std::to_string(outcome.rms_px) + " px, correlation " +
                                    std::to_string(outcome.mean_correlation) + ", mahalanobis " +
                                    std::to_string(outcome.mahalanobis) + ", found " +
                                    std::to_string(outcome.num_found) + " of " +
                                    std::to_string(outcome.num_sought));
}

TEST(AlignPatch, FindsShiftsToAFractionOfAPixel) {
  struct Rung {
    double noise;
    double max_rms_px;
  };
  for (const auto& [noise, max_rms_px] : {Rung{0.0, 0.02}, Rung{2.0, 0.06}, Rung{5.0, 0.14}}) {
    Appearance first;
    Appearance second;
    first.noise = second.noise = noise;
    second.seed = 2;
    second.shift_px = {3.37, -5.81};
    const Outcome outcome = AlignAll(first, second);
    Record("noise_" + std::to_string(static_cast<int>(noise)), outcome);
    EXPECT_GT(outcome.num_found, 0.97 * outcome.num_sought) << noise << " grey levels";
    EXPECT_LT(outcome.rms_px, max_rms_px) << noise << " grey levels";
  }
}

TEST(AlignPatch, APatchIsWhereItWasTaken) {
  const cv::Mat image = Draw({});
  for (const Eigen::Vector2d& place : Places()) {
    const auto patch = PatchTemplate::Sample(image, place, Eigen::Matrix2d::Identity());
    ASSERT_TRUE(patch);
    const auto found = AlignPatch(*patch, image, place, kReachPx);
    ASSERT_TRUE(found);
    EXPECT_LT((found->center_px - place).norm(), 1e-3);
    EXPECT_NEAR(found->correlation, 1.0, 1e-4);
  }
}

TEST(AlignPatch, DoesNotMindBrightnessAndContrast) {
  const cv::Mat first = Draw({});
  Appearance plain;
  plain.shift_px = {0.4, -0.7};
  Appearance changed = plain;
  changed.gain = 0.6;
  changed.offset = 35.0;
  const cv::Mat second = Draw(plain);
  const cv::Mat second_changed = Draw(changed);
  double sum = 0.0;
  for (const Eigen::Vector2d& place : Places()) {
    const auto patch = PatchTemplate::Sample(first, place, Eigen::Matrix2d::Identity());
    ASSERT_TRUE(patch);
    const auto found = AlignPatch(*patch, second, place, kReachPx);
    const auto found_changed = AlignPatch(*patch, second_changed, place, kReachPx);
    ASSERT_TRUE(found && found_changed);
    // What is left is the rounding of fewer grey levels.
    const double moved_px = (found->center_px - found_changed->center_px).norm();
    EXPECT_LT(moved_px, 0.1);
    EXPECT_NEAR(found->correlation, found_changed->correlation, 0.01);
    sum += moved_px;
  }
  EXPECT_LT(sum / static_cast<double>(Places().size()), 0.015);
}

TEST(AlignPatch, TurnsThePatchAsAsked) {
  struct Rung {
    double turn_deg;
    double min_gain;  // error without the turn over that with it
  };
  for (const auto& [turn_deg, min_gain] : {Rung{5.0, 1.5}, Rung{10.0, 3.0}, Rung{20.0, 5.0}}) {
    Appearance second;
    second.turn = Turn(turn_deg);
    second.shift_px = {1.7, 2.2};
    const Outcome turned = AlignAll({}, second, second.turn);
    const Outcome plain = AlignAll({}, second);
    Record("turned_" + std::to_string(static_cast<int>(turn_deg)), turned);
    Record("plain_" + std::to_string(static_cast<int>(turn_deg)), plain);
    EXPECT_GT(turned.num_found, 0.97 * turned.num_sought) << turn_deg << " deg";
    EXPECT_LT(turned.rms_px, 0.02) << turn_deg << " deg";
    EXPECT_GT(turned.mean_correlation, 0.999) << turn_deg << " deg";
    EXPECT_GT(plain.rms_px, min_gain * turned.rms_px) << turn_deg << " deg";
    EXPECT_LT(plain.mean_correlation, turned.mean_correlation) << turn_deg << " deg";
  }
}

TEST(AlignPatch, StretchesThePatchAsAsked) {
  Appearance second;
  second.turn << 1.15, 0.1, -0.05, 0.9;
  const Outcome stretched = AlignAll({}, second, second.turn);
  Record("stretched", stretched);
  EXPECT_GT(stretched.num_found, 0.95 * stretched.num_sought);
  EXPECT_LT(stretched.rms_px, 0.025);
  EXPECT_GT(stretched.mean_correlation, 0.998);
}

TEST(AlignPatch, KnowsItsOwnError) {
  // 392 squared errors scatter by 7 %. Gradients as noisy as at 10 grey levels are believed too
  // much.
  for (const double noise : {2.0, 5.0, 10.0}) {
    Appearance first;
    Appearance second;
    first.noise = second.noise = noise;
    second.seed = 2;
    second.shift_px = {0.3, 0.6};
    second.gain = 0.8;  // the covariance follows the contrast of the image
    second.offset = 25.0;
    const Outcome outcome = AlignAll(first, second);
    Record("noise_" + std::to_string(static_cast<int>(noise)), outcome);
    EXPECT_GT(outcome.mahalanobis, 0.5) << noise << " grey levels";
    EXPECT_LT(outcome.mahalanobis, noise < 10.0 ? 1.6 : 2.6) << noise << " grey levels";
  }
}

TEST(AlignPatch, EveryLevelOfInstructionsGivesTheSame) {
  const cv::Mat from = Draw({});
  const auto results = [&](SimdLevel level) {
    LimitSimdLevel(level);
    std::vector<double> all;
    for (const double angle_deg : {0.0, 20.0}) {
      Appearance appearance;
      appearance.turn = Turn(angle_deg);
      appearance.shift_px = {0.3, -0.6};
      appearance.noise = 2.0;
      const cv::Mat in = Draw(appearance);
      for (const Eigen::Vector2d& px : Places()) {
        const auto patch = PatchTemplate::Sample(from, px, appearance.turn);
        if (!patch) continue;
        const Eigen::Vector2d start_px = appearance.Move(px) + Eigen::Vector2d(0.7, 0.4);
        const auto found = AlignPatch(*patch, in, start_px, kReachPx);
        if (!found) continue;
        const auto corrected = CorrectForParallax(*patch, in, *found, {{5.0, 2.0}, 0.05});
        for (const PatchAlignment& one : {*found, corrected.value_or(*found)}) {
          all.insert(all.end(), {one.center_px.x(), one.center_px.y(), one.correlation});
          all.insert(all.end(), one.covariance.data(), one.covariance.data() + 4);
        }
      }
    }
    return all;
  };
  const std::vector<double> baseline = results(SimdLevel::kBaseline);
  EXPECT_GT(baseline.size(), 14u * Places().size());
  EXPECT_EQ(results(SimdLevel::kAvx2), baseline);
  EXPECT_EQ(results(SimdLevel::kAvx512), baseline);
}

TEST(PatchLoops, MemoryBeyondTheLoadedRowsDoesNotCount) {
  std::vector<const PatchLoops*> levels = {&kPatchLoopsBaseline};
#if defined(__x86_64__)
  LimitSimdLevel(SimdLevel::kAvx512);
  if (UsedSimdLevel() >= SimdLevel::kAvx2) levels.push_back(&kPatchLoopsAvx2);
  if (UsedSimdLevel() >= SimdLevel::kAvx512) levels.push_back(&kPatchLoopsAvx512);
#endif
  const cv::Mat image = Draw({});
  const PixelWeights weights{0.1F, 0.2F, 0.3F, 0.4F};
  std::vector<float> of_baseline;
  for (const PatchLoops* loops : levels) {
    PatchWindow window;
    PatchWindow sampled = {};
    std::fill(std::begin(window.values), std::end(window.values), NAN);
    loops->load(image.ptr<std::uint8_t>(50) + 60, image.step, kSampledSide + 1, &window);
    loops->shift(&window, &weights, &sampled);
    PatchPlanes planes;
    PatchMoments moments;
    loops->prepare(&sampled, &planes, &moments);
    std::fill(std::begin(window.values), std::end(window.values), NAN);
    loops->load(image.ptr<std::uint8_t>(51) + 61, image.step, kPatchSide + 1, &window);
    PatchSums sums;
    loops->compare(&planes, &window, &weights, &sums);
    DeformationSums deformation;
    const DeformationInputs inputs{0.1F, 0.2F, 0.3F, 0.4F, 0.6F, 0.8F};
    loops->deform(&planes, &window, &weights, &inputs, &deformation);
    const std::vector<float> all = {moments.energy,
                                    moments.xy,
                                    sums.gradient_x,
                                    sums.gradient_y,
                                    sums.values,
                                    sums.sum,
                                    sums.squares,
                                    deformation.products[14],
                                    deformation.image_squares};
    for (const float value : all) EXPECT_TRUE(std::isfinite(value));
    if (of_baseline.empty()) of_baseline = all;
    EXPECT_EQ(all, of_baseline);
  }
}

TEST(AlignPatch, StopsAtItsReach) {
  Appearance second;
  second.shift_px = {2.0, 0.0};
  const cv::Mat image_first = Draw({});
  const cv::Mat image_second = Draw(second);
  int num_found = 0;
  for (const Eigen::Vector2d& place : Places()) {
    const auto patch = PatchTemplate::Sample(image_first, place, Eigen::Matrix2d::Identity());
    ASSERT_TRUE(patch);
    EXPECT_FALSE(AlignPatch(*patch, image_second, place, 1.0));
    num_found += AlignPatch(*patch, image_second, place, kReachPx).has_value();
  }
  EXPECT_GT(num_found, 0.95 * static_cast<double>(Places().size()));
}

TEST(AlignPatch, SaysNothingBeyondTheImage) {
  const cv::Mat image = Draw({});
  const auto patch = PatchTemplate::Sample(image, {100.3, 100.7}, Eigen::Matrix2d::Identity());
  ASSERT_TRUE(patch);
  for (const Eigen::Vector2d& start_px : {Eigen::Vector2d(-50.0, 100.0),
                                          Eigen::Vector2d(3.0, 100.0),
                                          Eigen::Vector2d(100.0, 4.9),
                                          Eigen::Vector2d(kSize - 5.5, 100.0),
                                          Eigen::Vector2d(100.0, kSize - 5.5),
                                          Eigen::Vector2d(1e4, 1e4)}) {
    EXPECT_FALSE(AlignPatch(*patch, image, start_px, kReachPx)) << start_px.transpose();
  }
}

// Up to the last pixel that the patch fits in, on all sides.
TEST(AlignPatch, IsAsExactAtTheBorder) {
  const cv::Mat image = Draw({});
  Appearance shifted;
  shifted.shift_px = {-0.45, 0.35};
  const cv::Mat second = Draw(shifted);
  constexpr double kFirst = 7.2;
  constexpr double kLast = kSize - 8.2;
  for (double along = 20.3; along < kSize - 20; along += 10.0) {
    for (const Eigen::Vector2d& place : {Eigen::Vector2d(kFirst, along),
                                         Eigen::Vector2d(kLast, along),
                                         Eigen::Vector2d(along, kFirst),
                                         Eigen::Vector2d(along, kLast)}) {
      const auto patch = PatchTemplate::Sample(image, place, Eigen::Matrix2d::Identity());
      ASSERT_TRUE(patch) << place.transpose();
      const auto found = AlignPatch(*patch, second, place, kReachPx);
      ASSERT_TRUE(found) << place.transpose();
      EXPECT_LT((found->center_px - shifted.Move(place)).norm(), 0.1) << place.transpose();
    }
  }
}

TEST(PatchTemplate, StaysInsideTheImage) {
  const cv::Mat image = Draw({});
  for (const Eigen::Matrix2d& warp : {Turn(0.0), Turn(20.0)}) {
    for (const Eigen::Vector2d& center_px : {Eigen::Vector2d(4.0, 100.0),
                                             Eigen::Vector2d(100.0, 4.0),
                                             Eigen::Vector2d(kSize - 5.0, 100.0),
                                             Eigen::Vector2d(100.0, kSize - 5.0),
                                             Eigen::Vector2d(-300.0, 100.0),
                                             Eigen::Vector2d(100.0, 1e5)}) {
      EXPECT_FALSE(PatchTemplate::Sample(image, center_px, warp)) << center_px.transpose();
    }
    EXPECT_TRUE(PatchTemplate::Sample(image, {12.0, 12.0}, warp));
    EXPECT_TRUE(PatchTemplate::Sample(image, {kSize - 13.0, kSize - 13.0}, warp));
  }
}

TEST(PatchTemplate, NeedsStructureInBothDirections) {
  const auto sample = [](const cv::Mat& image) {
    return PatchTemplate::Sample(image, {30.4, 30.2}, Eigen::Matrix2d::Identity()).has_value();
  };
  cv::Mat image(60, 60, CV_8U, cv::Scalar(90));
  EXPECT_FALSE(sample(image));
  const auto paint = [&](auto grey) {
    for (int row = 0; row < image.rows; ++row) {
      for (int column = 0; column < image.cols; ++column) {
        image.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(grey(column, row));
      }
    }
  };
  paint([](int x, int) { return x < 30 ? 40 : 200; });
  EXPECT_FALSE(sample(image)) << "an upright edge";
  paint([](int, int y) { return y < 30 ? 40 : 200; });
  EXPECT_FALSE(sample(image)) << "a level edge";
  paint([](int x, int y) { return std::clamp(128 + 20 * (x - y), 30, 220); });
  EXPECT_FALSE(sample(image)) << "a slanted edge";
  paint([](int x, int y) { return 3 * x + y; });
  EXPECT_FALSE(sample(image)) << "a slope, which a change of brightness looks like";
  paint([](int x, int y) { return x < 30 && y < 30 ? 40 : 200; });
  EXPECT_TRUE(sample(image)) << "a corner";
}

TEST(AlignPatch, SaysNothingAboutABlankImage) {
  const cv::Mat image = Draw({});
  const auto patch = PatchTemplate::Sample(image, {100.0, 100.0}, Eigen::Matrix2d::Identity());
  ASSERT_TRUE(patch);
  const cv::Mat blank(kSize, kSize, CV_8U, cv::Scalar(77));
  EXPECT_FALSE(AlignPatch(*patch, blank, {100.0, 100.0}, kReachPx));
  // The negative is the opposite of the patch, however well its edges fit.
  const cv::Mat negative = 255 - image;
  const auto found = AlignPatch(*patch, negative, {100.0, 100.0}, kReachPx);
  EXPECT_FALSE(found && found->correlation > 0.7);
}

// Level ground under a camera that looks ahead; what it shows is as fine near as it is far away.
class Ground {
 public:
  static constexpr double kFocal = 300.0;
  static constexpr double kHorizonRow = 20.0;
  static constexpr double kHeight_m = 1.65;

  Ground() {
    SceneRandom random(11);
    for (int k = 0; k < 60; ++k) {
      const double wavelength_m = std::exp(random.Uniform(std::log(0.05), std::log(3.0)));
      const double direction = random.Uniform(0.0, 2.0 * std::numbers::pi);
      waves_.push_back({2.0 * std::numbers::pi / wavelength_m *
                            Eigen::Vector2d(std::cos(direction), std::sin(direction)),
                        random.Uniform(0.0, 2.0 * std::numbers::pi)});
    }
  }

  static double Depth(double row) { return kFocal * kHeight_m / (row - kHorizonRow); }

  static Eigen::Vector2d MoveAhead(const Eigen::Vector2d& px, double way_m) {
    const double scale = Depth(px.y()) / (Depth(px.y()) - way_m);
    return {Middle() + scale * (px.x() - Middle()), kHorizonRow + scale * (px.y() - kHorizonRow)};
  }

  // From `way_m` further ahead.
  cv::Mat Draw(double way_m, std::uint64_t seed) const {
    SceneRandom random(seed * 1'000'003);
    cv::Mat image(kSize, kSize, CV_8U);
    for (int row = 0; row < kSize; ++row) {
      for (int column = 0; column < kSize; ++column) {
        const double grey = row < kHorizonRow + 8 ? 128.0 : Shade(row, column, way_m);
        image.at<std::uint8_t>(row, column) =
            static_cast<std::uint8_t>(std::clamp(std::lround(grey + random.Normal(2.0)), 0L, 255L));
      }
    }
    return image;
  }

 private:
  static double Middle() { return 0.5 * kSize; }

  // Mean over the pixel, without waves too fine for it.
  double Shade(int row, int column, double way_m) const {
    constexpr int kSamples = 3;
    double sum = 0.0;
    for (int k = 0; k < kSamples * kSamples; ++k) {
      const double y = row + (k / kSamples + 0.5) / kSamples - 0.5;
      const double x = column + (k % kSamples + 0.5) / kSamples - 0.5;
      const double z = Depth(y);
      const Eigen::Vector2d place_m((x - Middle()) / kFocal * z, z + way_m);
      for (const auto& [wave, phase] : waves_) {
        if (wave.norm() * z / kFocal < 2.0) sum += std::sin(wave.dot(place_m) + phase);
      }
    }
    return 128.0 + 9.0 * sum / (kSamples * kSamples);
  }

  struct Wave {
    Eigen::Vector2d wave;  // per metre
    double phase;
  };
  std::vector<Wave> waves_;
};

struct GroundOutcome {
  int count = 0;
  double mean_y_px = 0.0;
  double rms_px = 0.0;
};

TEST(CorrectForParallax, TakesOutWhatGroundAddsToAllPatches) {
  constexpr double kWay_m = 0.8;
  const Ground ground;
  const cv::Mat first = ground.Draw(0.0, 1);
  const cv::Mat second = ground.Draw(kWay_m, 2);
  GroundOutcome plain;
  GroundOutcome corrected;
  const auto add = [](const Eigen::Vector2d& error_px, GroundOutcome& outcome) {
    ++outcome.count;
    outcome.mean_y_px += error_px.y();
    outcome.rms_px += error_px.squaredNorm();
  };
  SceneRandom random(3);
  for (int k = 0; k < 4000; ++k) {
    const Eigen::Vector2d place(random.Uniform(20.0, 220.0), random.Uniform(40.0, 65.0));
    const Eigen::Vector2d truth_px = Ground::MoveAhead(place, kWay_m);
    const auto patch = PatchTemplate::Sample(first, place, Eigen::Matrix2d::Identity());
    if (!patch) continue;
    const auto found = AlignPatch(*patch, second, truth_px, kReachPx);
    if (!found || found->correlation < 0.8) continue;
    const Eigen::Vector2d flow_px = found->center_px - place;
    const auto better = CorrectForParallax(
        *patch, second, *found, {flow_px, flow_px.norm() / (0.15 * Ground::kFocal)});
    ASSERT_TRUE(better);
    add(found->center_px - truth_px, plain);
    add(better->center_px - truth_px, corrected);
  }
  for (GroundOutcome* outcome : {&plain, &corrected}) {
    outcome->mean_y_px /= outcome->count;
    outcome->rms_px = std::sqrt(outcome->rms_px / (2.0 * outcome->count));
    RecordProperty(outcome == &plain ? "plain" : "corrected",
                   std::to_string(outcome->count) + " patches, mean " +
                       std::to_string(outcome->mean_y_px) + " px, rms " +
                       std::to_string(outcome->rms_px) + " px");
  }
  EXPECT_GT(plain.count, 1000);
  EXPECT_GT(plain.mean_y_px, 0.02);
  EXPECT_LT(std::abs(corrected.mean_y_px), 0.35 * plain.mean_y_px);
  EXPECT_LT(corrected.rms_px, 0.8 * plain.rms_px);
}

TEST(CorrectForParallax, LeavesAPatchThatOnlyMoves) {
  Appearance moved;
  moved.shift_px = {2.3, -1.4};
  Appearance noisy = moved;
  noisy.noise = 2.0;
  const cv::Mat first = Draw({});
  const cv::Mat second = Draw(noisy);
  double plain = 0.0;
  double corrected = 0.0;
  double mahalanobis = 0.0;
  int count = 0;
  for (const Eigen::Vector2d& place : Places()) {
    const auto patch = PatchTemplate::Sample(first, place, Eigen::Matrix2d::Identity());
    if (!patch) continue;
    const Eigen::Vector2d truth_px = moved.Move(place);
    const auto found = AlignPatch(*patch, second, truth_px, kReachPx);
    if (!found) continue;
    const auto same = CorrectForParallax(*patch, second, *found, {moved.shift_px, 0.05});
    ASSERT_TRUE(same);
    const Eigen::Vector2d error_px = same->center_px - truth_px;
    plain += (found->center_px - truth_px).squaredNorm();
    corrected += error_px.squaredNorm();
    mahalanobis += error_px.dot(same->covariance.inverse() * error_px);
    ++count;
  }
  ASSERT_GT(count, 150);
  EXPECT_LT(std::sqrt(corrected / plain), 1.3);
  EXPECT_LT(mahalanobis / (2.0 * count), 1.6);
}

TEST(CorrectForParallax, SaysNothingBeyondTheImage) {
  const cv::Mat image = Draw({});
  const auto patch = PatchTemplate::Sample(image, {100.0, 100.0}, Eigen::Matrix2d::Identity());
  ASSERT_TRUE(patch);
  PatchAlignment beyond;
  beyond.center_px = {2.0, 100.0};
  beyond.covariance.setIdentity();
  EXPECT_FALSE(CorrectForParallax(*patch, image, beyond, {{1.0, 0.0}, 0.05}));
}

}  // namespace
}  // namespace rotslam
