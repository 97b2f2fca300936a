#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <malloc.h>
#include <opencv2/imgproc.hpp>

#include "rotodom/odometry.h"

namespace rotslam {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr int kPeriod = 50;  // frames

cv::Mat Wall() {
  cv::RNG random(1);
  cv::Mat wall(240, 400, CV_8U, cv::Scalar(128));
  for (int k = 0; k < 1500; ++k) {
    const cv::Rect box(random.uniform(-10, wall.cols),
                       random.uniform(-10, wall.rows),
                       random.uniform(4, 24),
                       random.uniform(4, 24));
    cv::rectangle(wall, box, cv::Scalar(random.uniform(0, 256)), cv::FILLED);
  }
  cv::GaussianBlur(wall, wall, cv::Size(), 0.8);
  return wall;
}

// A look at the wall that goes to and fro, further than the image is wide.
cv::Mat Look(const cv::Mat& wall, int frame) {
  const double phase = 2.0 * std::numbers::pi * frame / kPeriod;
  const cv::Point2d corner(110.0 + 95.0 * std::sin(phase), 60.0 + 30.0 * std::sin(2.0 * phase));
  const cv::Matx23d image_from_wall(1, 0, -corner.x, 0, 1, -corner.y);
  cv::Mat image;
  cv::warpAffine(wall, image, image_from_wall, cv::Size(kWidth, kHeight));
  return image;
}

std::size_t BytesInUse() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

// Three of the last periods: 500, 1,000 and 1,500 frames.
TEST(RotationalOdometry, MemoryDoesNotGrow) {
  if (BytesInUse() == 0) GTEST_SKIP() << "the allocator keeps no count";
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fx = camera.fy = 150.0;
  camera.cx = 79.5;
  camera.cy = 59.5;
  RotationalOdometry odometry(camera, {}, 1, 1);
  const cv::Mat wall = Wall();
  const std::size_t at_start = BytesInUse();
  // Old views go every few dozen frames: the most of a whole period counts.
  std::size_t most = 0;
  std::size_t after_500 = 0;
  std::size_t after_1000 = 0;
  int num_connected = 0;
  for (int k = 0; k < 1500; ++k) {
    const FrameEstimate estimate = odometry.AddFrame(FrameId{k}, 0.1 * k, Look(wall, k));
    num_connected += !estimate.connections.empty();
    if (k % 500 >= 500 - 2 * kPeriod) most = std::max(most, BytesInUse());
    if (k == 499) after_500 = std::exchange(most, 0);
    if (k == 999) after_1000 = std::exchange(most, 0);
  }
  EXPECT_GT(num_connected, 1400);
  RecordProperty("after_500", std::to_string(after_500 - at_start));
  RecordProperty("after_1000", std::to_string(after_1000 - at_start));
  RecordProperty("after_1500", std::to_string(most - at_start));
  constexpr std::size_t kSlack = 200'000;
  EXPECT_LT(after_1000, after_500 + kSlack);
  EXPECT_LT(most, after_500 + kSlack);
  EXPECT_LT(most, after_1000 + kSlack);
}

}  // namespace
}  // namespace rotslam
