#include "apps/slam/lens_estimation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

// Notes the focal length that every round starts from.
class RoundObserver : public SlamObserver {
 public:
  explicit RoundObserver(bool stops) : stops_(stops) {}
  void OnLensRound(int round, const Camera& camera) override {
    EXPECT_EQ(round, static_cast<int>(focals_px.size()));
    focals_px.push_back(camera.fx);
  }
  bool ShouldStop() override { return stops_; }

  std::vector<double> focals_px;

 private:
  bool stops_;
};

TEST(GuessFocalLength, GoesWithTheLongerSide) {
  EXPECT_DOUBLE_EQ(GuessFocalLength({1920, 1080}), 2304.0);
  EXPECT_DOUBLE_EQ(GuessFocalLength({1080, 1920}), 2304.0);
}

TEST(UncalibratedCamera, HasItsPrincipalPointInTheMiddle) {
  const Camera camera = UncalibratedCamera({641, 480}, 500.0);
  EXPECT_FALSE(camera.Problem().has_value());
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_EQ(camera.fx, 500.0);
  EXPECT_EQ(camera.fy, 500.0);
  const auto ahead = camera.Unproject({320.0, 239.5});
  ASSERT_TRUE(ahead.has_value());
  EXPECT_LT((*ahead - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

TEST(FreeLens, LetsBundleAdjustmentMoveAllParameters) {
  LensOptions lens;
  FreeLens(UncalibratedCamera({640, 480}, 500.0), lens);
  EXPECT_FALSE(lens.Problem());
  for (const CameraModel model : {CameraModel::kRadtan, CameraModel::kEquidistant}) {
    const LensParameters sigmas = lens.Sigmas(model);
    EXPECT_GE(sigmas[kLensFocal], 0.3) << "a guess must not hold it";
    EXPECT_EQ(sigmas[kLensAspect], 0.0);
    EXPECT_GT(sigmas[kLensCenter], 0.0);
    EXPECT_GT(sigmas[kLensDistortion + NumLensCoefficients(model) - 1], 0.0);
  }
  EXPECT_EQ(lens.NumBlocks(), 2);
}

TEST(EstimateLens, ImprovesAGuess) {
  const SimulatedSequence walk = RenderWalk(24);
  ImageSource frames(walk);
  const double guess_px = 1.4 * walk.camera.fx;
  RoundObserver observer(false);
  SlamOptions options;
  options.num_threads = 2;
  options.rotodom.features.max_features = 500;
  const LensEstimate estimate =
      EstimateLens(frames, {UncalibratedCamera({320, 240}, guess_px)}, options, observer);
  EXPECT_TRUE(estimate.is_found);
  EXPECT_FALSE(estimate.interrupted);
  EXPECT_NEAR(estimate.camera.fx / walk.camera.fx, 1.0, 0.05);
  EXPECT_EQ(estimate.camera.width, 320);
  EXPECT_LT(std::abs(estimate.camera.fx - walk.camera.fx), 2.5 * estimate.sigmas.focal_px);
  EXPECT_LT(estimate.sigmas.focal_px, 0.4 * walk.camera.fx) << "the images have told something";
  EXPECT_GT(estimate.sigmas.distortion[0], 0.0);
  ASSERT_GE(observer.focals_px.size(), 2U);
  EXPECT_EQ(observer.focals_px[0], guess_px);
  EXPECT_EQ(frames.next(), 0) << "the source is at its beginning again";
}

TEST(EstimateLens, StopsWhenTheObserverAsks) {
  ImageSource frames(RenderWalk(4));
  RoundObserver observer(true);
  const LensEstimate estimate =
      EstimateLens(frames, {UncalibratedCamera({320, 240}, 300.0)}, SlamOptions(), observer);
  EXPECT_TRUE(estimate.interrupted);
  EXPECT_FALSE(estimate.is_found);
  EXPECT_EQ(estimate.camera.fx, 300.0);
  EXPECT_EQ(frames.next(), 0);
}

}  // namespace
}  // namespace rotslam
