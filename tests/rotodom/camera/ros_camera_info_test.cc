#include "rotodom/camera/ros_camera_info.h"

#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/rotodom/camera/calibration_text.h"

namespace rotslam {
namespace {

using testing::HasSubstr;
using enum CameraModel;

RosCameraInfo PlumbBob() {
  RosCameraInfo info;
  info.width = 640;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.D = {-0.28, 0.09, 0.001, -0.0008, -0.01};
  info.K = {530, 0, 320, 0, 531, 240, 0, 0, 1};
  info.P = {500, 0, 321, -60, 0, 501, 241, 0, 0, 0, 1, 0};
  return info;
}

std::string RosComplaint(const RosCameraInfo& info) {
  return RuntimeErrorOf([&] { CameraOf(info, false); });
}

TEST(RosCameraInfo, KAndDOrP) {
  EXPECT_EQ(CameraOf(PlumbBob(), false),
            CameraOfNumbers(
                kRadtan, {640, 480}, {530, 531, 320, 240}, {-0.28, 0.09, 0.001, -0.0008, -0.01}));
  EXPECT_EQ(CameraOf(PlumbBob(), true),
            CameraOfNumbers(kPinhole, {640, 480}, {500, 501, 321, 241}));
}

TEST(RosCameraInfo, Models) {
  RosCameraInfo info = PlumbBob();
  info.distortion_model = "rational_polynomial";
  info.D = {3.1, 1.4, 0, 0, 0.06, 3.4, 2.2, 0.32, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(CameraOf(info, false).model, kRational);
  info.D[13] = 0.1;
  EXPECT_THAT(RosComplaint(info), HasSubstr("D has tau_y = 0.1"));
  info.distortion_model = "equidistant";
  EXPECT_THAT(RosComplaint(info), HasSubstr("D has 14 values, must have 4"));
  info.D = {0.1, 0.2, 0.3, 0.4};
  EXPECT_EQ(CameraOf(info, false).model, kEquidistant);
  info.distortion_model = "double_sphere";
  EXPECT_THAT(RosComplaint(info), HasSubstr("distortion_model is 'double_sphere', must be"));
  info.distortion_model = "";
  EXPECT_THAT(RosComplaint(info), HasSubstr("distortion_model is ''"));
  info.D = {};
  EXPECT_EQ(CameraOf(info, false).model, kPinhole);
  info.K = {};
  EXPECT_THAT(RosComplaint(info), HasSubstr("not calibrated"));
}

// Four pixels become one, whose centre lies between theirs.
TEST(RosCameraInfo, RegionThenBinning) {
  RosCameraInfo info = PlumbBob();
  info.binning_x = info.binning_y = 2;
  EXPECT_EQ(CameraOf(info, true),
            CameraOfNumbers(kPinhole, {320, 240}, {250, 250.5, 160.25, 120.25}));
  info.roi_x = 100;
  info.roi_y = 40;
  info.roi_width = 400;
  info.roi_height = 300;
  EXPECT_EQ(CameraOf(info, true),
            CameraOfNumbers(kPinhole, {200, 150}, {250, 250.5, 110.25, 100.25}));
}

}  // namespace
}  // namespace rotslam
