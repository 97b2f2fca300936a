#include "rotodom/motion_blur/keypoint_blur.h"

#include <cmath>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

Camera PinholeOf500() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500.0;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

double ThirtiethOfASecond(FrameId frame) { return frame.value / 30.0; }

// Turns at a constant rate, thirty frames a second.
RotationMap SteadyTurn(const Eigen::Vector3d& rate, int num_frames) {
  RotationMap cam_from_world;
  for (int k = 0; k < num_frames; ++k) {
    cam_from_world[FrameId{k}] = Rotation::Exp(k / 30.0 * rate) * Rotation::Exp({0.1, 0.4, -0.2});
  }
  return cam_from_world;
}

Track OneTrack(const Camera& camera, const Eigen::Vector2d& keypoint_px, int num_frames) {
  Track track;
  for (int k = 0; k < num_frames; ++k) {
    track.observations.push_back({FrameId{k}, keypoint_px, *camera.Unproject(keypoint_px)});
  }
  return track;
}

TEST(RatesOf, AreThoseOfASteadyTurnAlsoAtTheEnds) {
  const Eigen::Vector3d rate(0.5, -2.0, 1.0);
  const RotationRates rates = RatesOf(SteadyTurn(rate, 4), ThirtiethOfASecond);
  ASSERT_EQ(rates.size(), 4U);
  for (const auto& [frame, found] : rates) EXPECT_LT((found - rate).norm(), 1e-9);
}

TEST(RatesOf, AreNotKnownBetweenStills) {
  const RotationMap turn = SteadyTurn({0.5, -2.0, 1.0}, 4);
  EXPECT_TRUE(RatesOf(turn, [](FrameId frame) { return frame.value * 1.0; }).empty());
  EXPECT_TRUE(RatesOf({{FrameId{3}, Rotation()}}, ThirtiethOfASecond).empty());
  // Two seconds lost in the middle: each of the four has a neighbour left.
  const auto with_gap = [](FrameId frame) {
    return ThirtiethOfASecond(frame) + (frame.value > 1 ? 2.0 : 0.0);
  };
  EXPECT_EQ(RatesOf(turn, with_gap).size(), 4U);
}

TEST(RateThrough, TakesTheTwoNearest) {
  const auto at = [](double time_s) {
    return TimedOrientation{time_s, Rotation::Exp({0.0, 0.5 * 6.0 * time_s * time_s, 0.0})};
  };
  // A parabola goes through three; what is far away in time, and the frame itself, do not count.
  const auto rate = RateThrough(
      at(0.1), std::vector<TimedOrientation>{at(0.1), at(0.06), at(0.02), at(0.0), at(0.5)});
  ASSERT_TRUE(rate);
  EXPECT_NEAR(rate->y(), 0.6, 1e-9);
  EXPECT_FALSE(RateThrough(at(0.1), std::vector<TimedOrientation>{at(0.1), at(0.5)}));
}

TEST(BlurVectorOf, GrowsWithTheTurnWithoutBound) {
  const Camera camera = PinholeOf500();
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitZ();
  const Eigen::Vector2d slow = BlurVectorOf(camera, ahead, {0.0, 1.0, 0.0}, 0.004);
  EXPECT_NEAR(slow.x(), 2.0, 1e-3);
  EXPECT_NEAR(slow.y(), 0.0, 1e-9);
  EXPECT_NEAR(BlurVectorOf(camera, ahead, {0.0, 10.0, 0.0}, 0.004).x(), 20.0, 1e-2);
  EXPECT_EQ(BlurVectorOf(camera, -ahead, {0.0, 1.0, 0.0}, 0.004), Eigen::Vector2d::Zero());
}

TEST(SetMotionBlur, FollowsWhatTheImageDoes) {
  const Camera camera = PinholeOf500();
  const Eigen::Vector3d rate(0.0, 0.9, 0.5);
  std::vector<Track> tracks = {OneTrack(camera, {500.0, 100.0}, 3)};
  const RotationMap turn = SteadyTurn(rate, 3);
  SetMotionBlur(camera, RatesOf(turn, ThirtiethOfASecond), 0.002, tracks);
  // Where the same direction is seen a hundredth of a second before and after, by its centre.
  const Eigen::Vector3d& bearing = tracks[0].observations[1].bearing;
  const Eigen::Vector2d speed_px_per_s = (*camera.Project(Rotation::Exp(0.01 * rate) * bearing) -
                                          *camera.Project(Rotation::Exp(-0.01 * rate) * bearing)) /
                                         0.02;
  for (const Observation& observation : tracks[0].observations) {
    EXPECT_LT((observation.blur.cast<double>() - 0.002 * speed_px_per_s).norm(), 2e-3);
  }
  EXPECT_GT(tracks[0].observations[1].blur.norm(), 0.7F);
  SetMotionBlur(camera, RatesOf(turn, ThirtiethOfASecond), 0.02, tracks);
  EXPECT_NEAR(tracks[0].observations[1].blur.norm(), 1.4F, 1e-5F);
  SetMotionBlur(camera, {}, 0.002, tracks);
  EXPECT_EQ(tracks[0].observations[1].blur, Eigen::Vector2f::Zero());
}

TEST(Deblurring, WhitensTheCovarianceOfABlur) {
  EXPECT_EQ(Deblurring(Eigen::Vector2f::Zero()), Eigen::Matrix2d::Identity());
  for (const float length : {1e-4F, 0.3F, 40.0F}) {
    const Eigen::Vector2f blur = length * Eigen::Vector2f(0.6F, -0.8F);
    const Eigen::Vector2d s = blur.cast<double>();
    const Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity() + s * s.transpose();
    const Eigen::Matrix2d white = Deblurring(blur) * covariance * Deblurring(blur).transpose();
    EXPECT_LT((white - Eigen::Matrix2d::Identity()).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace rotslam
