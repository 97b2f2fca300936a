#include "apps/slam/focal_length.h"

#include <gtest/gtest.h>

#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

// Notes the focal length that every pass begins with.
class PassObserver : public SlamObserver {
 public:
  explicit PassObserver(bool stops) : stops_(stops) {}
  void OnFocalPass(int pass, double focal_px) override {
    focals_px.push_back(focal_px);
    EXPECT_EQ(pass, static_cast<int>(focals_px.size()));
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

TEST(FreeFocalLength, LetsBundleAdjustmentMoveIt) {
  LensOptions lens;
  lens.refine_focal = false;
  FreeFocalLength(lens);
  EXPECT_TRUE(lens.refine_focal);
  EXPECT_GE(lens.focal_sigma, 0.5) << "a guess must not hold it";
}

TEST(FindFocalLength, ImprovesAGuess) {
  const SimulatedSequence walk = RenderWalk(24);
  ImageSource frames(walk);
  const double guess_px = 1.2 * walk.camera.fx;
  PassObserver observer(false);
  SlamOptions options;
  options.num_threads = 2;
  options.rotodom.features.max_features = 500;
  const FocalLengthEstimate estimate =
      FindFocalLength(frames, UncalibratedCamera({320, 240}, guess_px), options, observer);
  EXPECT_TRUE(estimate.is_found);
  EXPECT_FALSE(estimate.interrupted);
  EXPECT_NEAR(estimate.camera.fx / walk.camera.fx, 1.0, 0.08);
  EXPECT_EQ(estimate.camera.width, 320);
  ASSERT_GE(observer.focals_px.size(), 2U);
  EXPECT_EQ(observer.focals_px[0], guess_px);
  EXPECT_EQ(frames.next(), 0) << "the source is at its beginning again";
}

TEST(FindFocalLength, StopsWhenTheObserverAsks) {
  ImageSource frames(RenderWalk(4));
  PassObserver observer(true);
  const FocalLengthEstimate estimate =
      FindFocalLength(frames, UncalibratedCamera({320, 240}, 300.0), SlamOptions(), observer);
  EXPECT_TRUE(estimate.interrupted);
  EXPECT_FALSE(estimate.is_found);
  EXPECT_EQ(estimate.camera.fx, 300.0);
  EXPECT_EQ(frames.next(), 0);
}

}  // namespace
}  // namespace rotslam
