#include "apps/paper_method/spread_orb.h"

#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "apps/simulation/simulation.h"
#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// A hundred corners in one small patch, stronger than the few others.
std::vector<FastCorner> CrowdedCorners() {
  std::vector<FastCorner> corners;
  for (int k = 0; k < 100; ++k) corners.push_back({20 + k % 10, 20 + k / 10, 100 + k});
  for (int k = 0; k < 12; ++k) corners.push_back({100 + 80 * (k % 4), 40 + 60 * (k / 4), 30});
  return corners;
}

const cv::Rect kArea(16, 16, 400, 200);

TEST(SpreadCorners, SpreadsOverTheAreaAndKeepsTheStrongest) {
  const std::vector<FastCorner> spread = SpreadCorners(CrowdedCorners(), kArea, 13);
  EXPECT_GE(spread.size(), 13U);
  EXPECT_LE(spread.size(), 16U);
  int num_crowded = 0;
  bool has_strongest = false;
  for (const FastCorner& corner : spread) {
    num_crowded += corner.score >= 100;
    has_strongest |= corner.score == 199;
  }
  EXPECT_LE(num_crowded, 6);
  EXPECT_TRUE(has_strongest);
}

TEST(SpreadCorners, GivesAllWhereThereAreFew) {
  EXPECT_EQ(SpreadCorners(CrowdedCorners(), kArea, 1000).size(), 112U);
  EXPECT_TRUE(SpreadCorners({}, kArea, 10).empty());
  EXPECT_TRUE(SpreadCorners(CrowdedCorners(), kArea, 0).empty());
  EXPECT_EQ(SpreadCorners({{50, 50, 9}}, kArea, 10).size(), 1U);
}

TEST(SpreadCorners, DoesNotDependOnTheOrder) {
  std::vector<FastCorner> corners = CrowdedCorners();
  const std::vector<FastCorner> spread = SpreadCorners(corners, kArea, 40);
  SplitMix64 random(3);
  for (int k = static_cast<int>(corners.size()) - 1; k > 0; --k) {
    std::swap(corners[k], corners[random.Index(k + 1)]);
  }
  const std::vector<FastCorner> again = SpreadCorners(corners, kArea, 40);
  ASSERT_EQ(again.size(), spread.size());
  for (std::size_t k = 0; k < spread.size(); ++k) {
    EXPECT_EQ(std::pair(again[k].x, again[k].y), std::pair(spread[k].x, spread[k].y));
  }
}

cv::Mat StreetImage(Camera& camera) {
  SimulationOptions options;
  options.kind = SimulationKind::kStreet;
  options.frames = 1;
  options.camera = CameraWithView(620, 188, 80.0);
  const Simulation simulation(options);
  camera = simulation.GetCamera();
  return simulation.Render(0);
}

TEST(ExtractSpreadOrb, FindsAsManyAsAskedForOnAllLevels) {
  Camera camera;
  const cv::Mat image = StreetImage(camera);
  FeatureOptions options;
  options.max_features = 800;
  const Features features = ExtractSpreadOrb(image, FrameId{3}, camera, options, 1);
  EXPECT_EQ(features.frame, FrameId{3});
  EXPECT_GT(features.size(), 700);
  EXPECT_LE(features.size(), 800 + 3 * options.num_levels);
  EXPECT_EQ(features.descriptors.rows, features.size());
  EXPECT_EQ(std::set<int>(features.levels.begin(), features.levels.end()).size(), 8U);
  for (int k = 0; k < features.size(); ++k) {
    const auto pixel = camera.Project(features.bearings[k]);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - features.keypoints_px[k]).norm(), 1e-6);
  }
}

TEST(ExtractSpreadOrb, GivesTheSameAtAnyNumberOfThreads) {
  Camera camera;
  const cv::Mat image = StreetImage(camera);
  const Features one = ExtractSpreadOrb(image, FrameId{0}, camera, {}, 1);
  const Features four = ExtractSpreadOrb(image, FrameId{0}, camera, {}, 4);
  ASSERT_EQ(one.size(), four.size());
  EXPECT_EQ(one.keypoints_px, four.keypoints_px);
  EXPECT_EQ(cv::norm(one.descriptors, four.descriptors, cv::NORM_HAMMING), 0.0);
}

TEST(ExtractSpreadOrb, TakesNothingFromWhatIsMaskedAndFromTinyImages) {
  Camera camera;
  const cv::Mat image = StreetImage(camera);
  cv::Mat mask(image.size(), CV_8U, cv::Scalar(255));
  mask.colRange(0, 310).setTo(0);
  const Features features = ExtractSpreadOrb({image, Mask(mask)}, FrameId{0}, camera, {}, 1);
  EXPECT_GT(features.size(), 100);
  for (const Eigen::Vector2d& keypoint : features.keypoints_px) EXPECT_GE(keypoint.x(), 310.0);
  EXPECT_EQ(
      ExtractSpreadOrb(cv::Mat(30, 30, CV_8U, cv::Scalar(0)), FrameId{0}, camera, {}, 1).size(), 0);
}

}  // namespace
}  // namespace rotslam
