#include "apps/map_views.h"

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Images 0.png to 5.png, each of one grey value: ten times its number.
class MapViewsTest : public testing::Test {
 protected:
  void SetUp() override {
    for (int k = 0; k < 6; ++k) {
      cv::imwrite((folder_.path() / (std::to_string(k) + ".png")).string(),
                  cv::Mat(20, 30, CV_8U, cv::Scalar(10.0 * k)));
    }
  }

  MapViews Read(const std::string& path,
                const SequenceOptions& options,
                const std::set<FrameId>& frames) {
    problems_.clear();
    return ReadMapViews(
        path, options, frames, [&](const std::string& problem) { problems_.push_back(problem); });
  }

  const TemporaryFolder folder_;
  std::vector<std::string> problems_;
};

TEST_F(MapViewsTest, AreTheImagesOfTheFramesAskedFor) {
  const MapViews views =
      Read(folder_.path().string(), {.first = 1, .stride = 2}, {FrameId{0}, FrameId{2}});
  EXPECT_THAT(problems_, IsEmpty());
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views.at(FrameId{0}).image.at<std::uint8_t>(3, 4), 10);
  EXPECT_EQ(views.at(FrameId{2}).image.at<std::uint8_t>(3, 4), 50);
  EXPECT_EQ(views.at(FrameId{2}).half.size(), cv::Size(15, 10));
}

TEST_F(MapViewsTest, SayWhatCannotBeReadAgain) {
  const std::string path = folder_.path().string();
  fs::resize_file(folder_.path() / "3.png", 10);
  fs::resize_file(folder_.path() / "4.png", 0);
  EXPECT_EQ(Read(path, {}, {FrameId{2}, FrameId{3}, FrameId{4}, FrameId{5}}).size(), 2U);
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("3.png"), HasSubstr("4.png")));
  EXPECT_EQ(Read(path, {}, {FrameId{2}, FrameId{9}}).size(), 1U);
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("frame 9")));
  EXPECT_TRUE(Read(path + "/nowhere", {}, {FrameId{2}}).empty());
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("nowhere")));
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
