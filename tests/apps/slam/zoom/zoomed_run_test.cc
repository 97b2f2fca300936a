// The whole system on a walk filmed with a lens that zooms.

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "apps/slam/slam.h"
#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

constexpr int kWalkFrames = 70;

// From 1 to 1.4 in the frames 30 to 45.
double ScaleAt(int frame) { return 1.0 + 0.4 * std::clamp((frame - 30) / 15.0, 0.0, 1.0); }

SimulatedSequence WithZoom(SimulatedSequence walk) {
  const Camera& camera = walk.camera;
  for (int k = 0; k < kWalkFrames; ++k) {
    const double scale = ScaleAt(k);
    if (scale == 1.0) continue;
    const cv::Matx23d zoom(
        scale, 0.0, (1.0 - scale) * camera.cx, 0.0, scale, (1.0 - scale) * camera.cy);
    cv::Mat zoomed;
    cv::warpAffine(walk.images[k], zoomed, zoom, walk.images[k].size(), cv::INTER_CUBIC);
    walk.images[k] = zoomed;
  }
  return walk;
}

SlamResult ResultOf(const SimulatedSequence& walk, bool follow_zooms = true) {
  ImageSource frames(walk);
  SlamInputs inputs;
  inputs.follow_zooms = follow_zooms;
  SlamObserver nobody;
  SlamOptions options;
  options.num_threads = 2;
  options.rotodom.features.max_features = 800;
  return RunSlam(frames, walk.camera, options, nobody, inputs);
}

// Root mean square distance from the true path, metres, after alignment by a similarity.
double ErrorOf(const SlamResult& result, const SimulatedSequence& walk) {
  Eigen::Matrix3Xd found(3, kWalkFrames);
  Eigen::Matrix3Xd truth(3, kWalkFrames);
  for (int k = 0; k < kWalkFrames; ++k) {
    found.col(k) = result.map.center_in_world.at(FrameId{k});
    truth.col(k) = walk.truth[k].center_in_world;
  }
  const Eigen::Matrix4d aligned = Eigen::umeyama(found, truth, true);
  const Eigen::Matrix3Xd errors =
      (aligned.topLeftCorner<3, 3>() * found).colwise() + aligned.topRightCorner<3, 1>() - truth;
  return std::sqrt(errors.squaredNorm() / kWalkFrames);
}

TEST(ZoomedRun, FollowsTheZoom) {
  const SimulatedSequence walk = RenderWalk(kWalkFrames);
  const SlamResult plain = ResultOf(walk);
  EXPECT_TRUE(plain.orientations.zooms.empty());
  EXPECT_TRUE(plain.orientations.focal_scales.empty());

  const SlamResult zoomed = ResultOf(WithZoom(walk));
  ASSERT_FALSE(zoomed.orientations.focal_scales.empty());
  ASSERT_EQ(zoomed.orientations.zooms.size(), 1U);
  const Zoom& zoom = zoomed.orientations.zooms.front();
  EXPECT_NEAR(zoom.first.value, 30, 3);
  EXPECT_NEAR(zoom.last.value, 45, 3);
  EXPECT_NEAR(zoom.factor, 1.4, 0.014);
  for (int k = 0; k < kWalkFrames; ++k) {
    EXPECT_NEAR(ScaleOf(zoomed.orientations.focal_scales, FrameId{k}) / ScaleAt(k), 1.0, 0.015)
        << "frame " << k;
  }
  ASSERT_TRUE(zoomed.map.failure.empty()) << zoomed.map.failure;
  // The zoomed pictures are enlarged ones, and show less. Tracked through the focal length of
  // before, they end up 2.7 times as far off as the plain ones.
  EXPECT_LT(ErrorOf(zoomed, walk), 4.0 * ErrorOf(plain, walk));
  const SlamResult not_followed = ResultOf(WithZoom(walk), false);
  EXPECT_EQ(not_followed.orientations.zooms.size(), 1U);
  EXPECT_TRUE(not_followed.orientations.focal_scales.empty());
  EXPECT_LT(ErrorOf(zoomed, walk), 0.5 * ErrorOf(not_followed, walk));
}

}  // namespace
}  // namespace rotslam
