#include "rotodom/rolling_shutter/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/types/rotation.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

AngularMotion Steady(const Eigen::Vector3d& rate) {
  AngularMotion motion;
  motion.coefficients.col(0) = rate;
  return motion;
}

// rad, in a second: sways to and fro.
Eigen::Vector3d Sway(double time_s) {
  return {0.10 * std::sin(9.0 * time_s), -0.15 * std::cos(7.0 * time_s), 0.05 * time_s};
}

RotationMap SwayingFrames(int count, double step_s) {
  RotationMap cam_from_world;
  for (int k = 0; k < count; ++k) cam_from_world[FrameId{k}] = Rotation::Exp(Sway(step_s * k));
  return cam_from_world;
}

double LargestErrorRad(FrameId frame, int num_others) {
  constexpr double kStepS = 1.0 / 30.0;
  const RotationMap cam_from_world = SwayingFrames(9, kStepS);
  const AngularMotion motion = MotionAt(
      frame, cam_from_world, [](FrameId at) { return kStepS * at.value; }, num_others);
  double largest = 0.0;
  for (const double after_s : {-0.012, 0.012}) {
    const Rotation truth =
        Rotation::Exp(Sway(kStepS * frame.value + after_s)) * cam_from_world.at(frame).Inverse();
    largest = std::max(largest, (motion.After(after_s) * truth.Inverse()).Angle());
  }
  return largest;
}

TEST(PolynomialThrough, GoesThroughAllOfThem) {
  const PowerCoefficients truth = PowerCoefficients::Random();
  std::vector<TimedOffset> offsets;
  for (const double after_s : {-0.5, 0.3, 0.8, 2.0}) {
    const double squared = after_s * after_s;
    const Eigen::Vector4d powers(after_s, squared, squared * after_s, squared * squared);
    offsets.push_back({after_s, truth * powers});
  }
  EXPECT_LT((PolynomialThrough(offsets) - truth).norm(), 1e-12);
  EXPECT_EQ(PolynomialThrough({}), PowerCoefficients::Zero());
  offsets.push_back({3.0, Eigen::Vector3d::Zero()});
  EXPECT_THROW(PolynomialThrough(offsets), std::invalid_argument);
}

TEST(MotionAt, IsBetterTheMoreFramesItGoesThrough) {
  for (const int frame : {0, 4, 8}) {
    double before = 1.0;
    for (const int num_others : {0, 1, 2, 3, 4}) {
      const double error = LargestErrorRad(FrameId{frame}, num_others);
      EXPECT_LT(error, (num_others < 2 ? 0.7 : 0.4) * before) << frame << ", " << num_others;
      before = error;
    }
    EXPECT_LT(before, 2e-4) << frame;
  }
  EXPECT_LT(LargestErrorRad(FrameId{4}, 2), 0.5 * LargestErrorRad(FrameId{8}, 2));
  EXPECT_THROW(LargestErrorRad(FrameId{9}, 2), std::invalid_argument);
}

TEST(AngularMotion, ToMidFrameUndoesAfter) {
  AngularMotion motion;
  motion.coefficients << 0.9, -0.2, 3.0, 1.0, -2.0, 0.5, 0.1, -4.0, 0.3, 1.1, -0.7, 2.0;
  const Eigen::Vector3d vector(0.3, -0.5, 0.8);
  for (const double seconds : {-0.4, -0.02, -1e-3, 0.0, 1e-9, 4e-3, 5e-3, 0.05, 1.5}) {
    const Eigen::Vector3d back = motion.ToMidFrame(seconds, motion.After(seconds) * vector);
    EXPECT_LT((back - vector).norm(), 1e-11) << seconds;
  }
}

TEST(EstimateMotionAt, TellsHowFarItIsOff) {
  const auto time_s = [](FrameId at) { return at.value / 30.0; };
  const RotationMap cam_from_world = SwayingFrames(9, 1.0 / 30.0);
  for (const int frame : {0, 4, 8}) {
    const MotionEstimate believed = EstimateMotionAt(FrameId{frame}, cam_from_world, time_s, 0.024);
    const double error_rad = LargestErrorRad(FrameId{frame}, 2);
    EXPECT_GT(believed.error_rad, 0.5 * error_rad) << frame;
    EXPECT_LT(believed.error_rad, 2.0 * error_rad) << frame;
  }
}

TEST(BearingInMidFrame, NeedsNoExactMotionWhereThePointIsSeenAround) {
  const Eigen::Vector3d point(0.3, -0.2, 1.0);
  const auto seen_at = [&](double after_s) {
    // The camera turns and moves on.
    const Eigen::Vector3d from_camera = point - after_s * Eigen::Vector3d(0.4, 0.1, 0.2);
    return TimedBearing{after_s, (Rotation::Exp(Sway(after_s)) * from_camera).normalized()};
  };
  const Eigen::Vector3d truth = seen_at(0.0).bearing;
  const AngularMotion right = Steady((Sway(1e-4) - Sway(-1e-4)) / 2e-4);
  const AngularMotion wrong = Steady({0.5, 0.5, -0.5});
  const auto error_rad = [&](const AngularMotion& motion, const std::vector<double>& times_s) {
    std::vector<TimedBearing> seen;
    for (const double after_s : times_s) seen.push_back(seen_at(after_s));
    return (BearingInMidFrame(motion, seen) - truth).norm();
  };
  const double alone = error_rad(wrong, {0.012});
  EXPECT_GT(alone, 5e-3);
  EXPECT_LT(error_rad(wrong, {0.012, 0.045}), 0.3 * alone);
  // What is left is of third order, 1e-4 rad here.
  EXPECT_LT(error_rad(wrong, {0.012, 0.045, -0.021}), 0.03 * alone);
  EXPECT_LT(error_rad(right, {0.012, 0.045, -0.021}), 0.03 * alone);
  EXPECT_LT(error_rad(right, {0.012}), alone);
}

TEST(CorrectRollingShutter, LeavesOutWhatIsSeenAtNearlyTheSameTime) {
  Camera camera = BaCamera();
  camera.readout_s = 0.03;
  const AngularMotion motion = Steady({0.0, 0.4, 0.0});
  const auto view_at = [](double time_s, const Eigen::Vector2d& keypoint_px) {
    View view;
    view.timestamp_s = time_s;
    view.features.keypoints_px = {keypoint_px};
    view.features.bearings = {Eigen::Vector3d::UnitZ()};
    view.features.tracks = {TrackId{7}};
    return view;
  };
  const auto bearing_with = [&](const View& other) {
    View view = view_at(0.0, {150.0, 40.0});
    const View* others[] = {&other};
    CorrectRollingShutter(camera, motion, others, 1, view);
    return view.features.bearings[0];
  };
  View alone = view_at(0.0, {150.0, 40.0});
  CorrectRollingShutter(camera, motion, {}, 1, alone);
  // The same pixel a thousandth of a second later, a match that is off by a pixel.
  EXPECT_EQ(bearing_with(view_at(0.001, {151.0, 40.0})), alone.features.bearings[0]);
  EXPECT_NE(bearing_with(view_at(0.033, {151.0, 40.0})), alone.features.bearings[0]);
}

class MoveToMidFrameTest : public testing::TestWithParam<ReadoutStart> {};
INSTANTIATE_TEST_SUITE_P(ReadoutStarts,
                         MoveToMidFrameTest,
                         testing::Values(ReadoutStart::kTop, ReadoutStart::kRight),
                         [](const auto& start) { return Name(start.param); });

TEST_P(MoveToMidFrameTest, PutsCornersWhereAGlobalShutterSeesThem) {
  Camera camera = BaCamera();
  camera.readout_s = 0.03;
  camera.readout_from = GetParam();
  const Eigen::Vector3d rate(0.4, -0.8, 0.5);
  Features corners;
  std::vector<Eigen::Vector3d> bearings;
  for (const double y : {40.0, 200.0, 330.0}) {
    // What the pixel sees as it is exposed.
    const Eigen::Vector2d px(150.0, y);
    corners.keypoints_px.push_back(px);
    corners.bearings.push_back(*camera.Unproject(px));
    bearings.emplace_back(Rotation::Exp(-camera.ExposureTime(px) * rate) * corners.bearings.back());
  }
  const Features seen = corners;
  MoveToMidFrame(camera, Steady(rate), corners);
  for (int n = 0; n < corners.size(); ++n) {
    EXPECT_LT((corners.bearings[n] - bearings[n]).norm(), 1e-12);
    EXPECT_LT((corners.keypoints_px[n] - *camera.Project(bearings[n])).norm(), 1e-9);
  }
  EXPECT_GT((corners.keypoints_px[0] - seen.keypoints_px[0]).norm(), 1.0);

  camera.readout_s = 0.0;
  corners = seen;
  MoveToMidFrame(camera, Steady(rate), corners);
  EXPECT_EQ(corners.keypoints_px, seen.keypoints_px);
}

}  // namespace
}  // namespace rotslam
