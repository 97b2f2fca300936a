#include "apps/map_views.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Images 0.png to 5.png, each of one grey value: ten times its number.
class MapViewsTest : public testing::Test {
 protected:
  void SetUp() override {
    for (int k = 0; k < 6; ++k) {
      cv::imwrite((folder_.path() / (std::to_string(k) + ".png")).string(),
                  cv::Mat(20, 30, CV_8U, cv::Scalar(10.0 * k)));
    }
  }

  const TemporaryFolder folder_;
};

TEST_F(MapViewsTest, AreTheImagesOfTheFramesAskedFor) {
  std::string problem;
  const MapViews views = ReadMapViews(
      folder_.path().string(), {.first = 1, .stride = 2}, {FrameId{0}, FrameId{2}}, problem);
  EXPECT_EQ(problem, "");
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views.at(FrameId{0}).image.at<std::uint8_t>(3, 4), 10);
  EXPECT_EQ(views.at(FrameId{2}).image.at<std::uint8_t>(3, 4), 50);
  EXPECT_EQ(views.at(FrameId{2}).half.size(), cv::Size(15, 10));
}

TEST_F(MapViewsTest, SayWhatCannotBeReadAgain) {
  const std::string path = folder_.path().string();
  const fs::path gone = folder_.path() / "3.png";
  fs::resize_file(gone, 10);
  std::string problem;
  EXPECT_EQ(ReadMapViews(path, {}, {FrameId{2}, FrameId{3}, FrameId{4}}, problem).size(), 2U);
  EXPECT_THAT(problem, testing::HasSubstr("3.png"));
  problem.clear();
  EXPECT_EQ(ReadMapViews(path, {}, {FrameId{2}, FrameId{9}}, problem).size(), 1U);
  EXPECT_THAT(problem, testing::HasSubstr("frame 9"));
  problem.clear();
  EXPECT_TRUE(ReadMapViews(path + "/nowhere", {}, {FrameId{2}}, problem).empty());
  EXPECT_THAT(problem, testing::HasSubstr("nowhere"));
}

TEST(SetMotions, TakesThemFromTheFramesAround) {
  Orientations orientations;
  Reconstruction map;
  MapViews views;
  const Eigen::Vector3d rate(0.1, -0.2, 0.3);
  const Eigen::Vector3d velocity(1.0, 2.0, -3.0);
  for (int k = 0; k <= 4; ++k) {
    orientations.timestamps_s.push_back(0.1 * k);
    orientations.cam_from_world[FrameId{k}] = Rotation::Exp(0.1 * k * rate);
    if (k % 2 != 0) continue;
    map.center_in_world[FrameId{k}] = 0.1 * k * velocity;
    views[FrameId{k}] = {};
  }
  views[FrameId{3}] = {};  // without a place
  SetMotions(orientations, map, views);
  for (const auto& [frame, view] : views) {
    EXPECT_LT((view.rate - rate).norm(), 1e-9) << frame.value;
    const bool has_place = frame != FrameId{3};
    EXPECT_LT((view.velocity - (has_place ? velocity : Eigen::Vector3d::Zero())).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace rotslam
