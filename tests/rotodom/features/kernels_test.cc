// The fast loops below the features against OpenCV's and against slow, obvious versions.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/features/fast_corners.h"
#include "rotodom/features/features.h"
#include "rotodom/features/orb_descriptor.h"
#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

// Texture and noise, so that there are corners of all scores next to one another.
cv::Mat NoisyImage() {
  const cv::Mat image = TexturedWorld().View(SmallCamera(), Rotation());
  cv::Mat noise(image.size(), CV_16S);
  cv::RNG random(3);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 12.0);
  cv::Mat sum;
  cv::add(image, noise, sum, cv::noArray(), CV_8U);
  return sum;
}

TEST(FindFastCorners, FindsWhatCvFastFinds) {
  const cv::Mat image = NoisyImage();
  // Widths around multiples of a vector register, and areas that touch the last column.
  for (const int width : {7, 38, 39, 70, 71, 102, 320}) {
    for (const int threshold : {1, 7, 20, 60}) {
      const cv::Mat part = image(cv::Rect(320 - width, 20, width, 150));
      std::vector<cv::KeyPoint> expected;
      cv::FAST(part, expected, threshold, true);
      const cv::Rect inside(3, 3, part.cols - 6, part.rows - 6);
      const std::vector<FastCorner> corners = FindFastCorners(part, inside, threshold);
      ASSERT_EQ(corners.size(), expected.size()) << "width " << width << " at " << threshold;
      for (std::size_t k = 0; k < corners.size(); ++k) {
        EXPECT_EQ(corners[k].x, expected[k].pt.x);
        EXPECT_EQ(corners[k].y, expected[k].pt.y);
        EXPECT_EQ(corners[k].score, expected[k].response);
      }
    }
  }
  EXPECT_GT(FindFastCorners(image, cv::Rect(3, 3, 314, 234), 7).size(), 500u);
}

TEST(FindFastCorners, LooksOnlyIntoTheArea) {
  const cv::Mat image = NoisyImage();
  const cv::Rect area(50, 40, 61, 33);
  const std::vector<FastCorner> corners = FindFastCorners(image, area, 7);
  ASSERT_GT(corners.size(), 20u);
  for (const FastCorner& corner : corners) {
    EXPECT_TRUE(area.contains(cv::Point(corner.x, corner.y)));
  }
  EXPECT_TRUE(FindFastCorners(image, cv::Rect(50, 40, 0, 10), 7).empty());
  EXPECT_TRUE(FindFastCorners(image, area, 255).empty());
}

TEST(BlurBlock, GivesTheBytesOfCvGaussianBlur) {
  const cv::Mat image = NoisyImage();
  cv::Mat extreme = image > 128;  // only 0 and 255
  for (const cv::Mat& source : {image, extreme}) {
    cv::Mat expected;
    cv::GaussianBlur(source, expected, cv::Size(7, 7), 2.0, 2.0, cv::BORDER_REFLECT_101);
    for (const cv::Point& corner : {cv::Point(3, 3), cv::Point(100, 50), cv::Point(283, 205)}) {
      cv::Mat block(kBlurBlock, kBlurBlock, CV_8U);
      BlurBlock(source.ptr<std::uint8_t>(corner.y) + corner.x,
                static_cast<std::ptrdiff_t>(source.step),
                block.data,
                static_cast<std::ptrdiff_t>(block.step));
      const cv::Mat there = expected(cv::Rect(corner, block.size()));
      EXPECT_EQ(cv::norm(block, there, cv::NORM_INF), 0.0) << corner;
    }
  }
}

TEST(CentroidAngleDeg, IsThatOfCvOrb) {
  const cv::Mat image = NoisyImage();
  const auto orb = cv::ORB::create(500, 1.2F, 1, 31, 0, 2, cv::ORB::FAST_SCORE, 31);
  std::vector<cv::KeyPoint> keypoints;
  orb->detect(image, keypoints);
  ASSERT_GT(keypoints.size(), 200u);
  for (const cv::KeyPoint& keypoint : keypoints) {
    const int x = cvRound(keypoint.pt.x);
    const int y = cvRound(keypoint.pt.y);
    const float angle_deg =
        CentroidAngleDeg(image.ptr<std::uint8_t>(y) + x, static_cast<std::ptrdiff_t>(image.step));
    // cv::fastAtan2 promises 0.3 deg.
    EXPECT_LT(std::abs(std::remainder(angle_deg - keypoint.angle, 360.0F)), 0.3F);
  }
}

TEST(CentroidAngleDeg, FollowsTheGrey) {
  cv::Mat image(64, 64, CV_8U);
  for (const double angle_deg : {0.0, 37.0, 90.0, 151.0, -90.0, -123.0}) {
    const double angle = angle_deg * CV_PI / 180.0;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const double along = (x - 32) * std::cos(angle) + (y - 32) * std::sin(angle);
        image.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(128.0 + 4.0 * along);
      }
    }
    const float found = CentroidAngleDeg(image.ptr<std::uint8_t>(32) + 32, 64);
    EXPECT_LT(std::abs(std::remainder(found - angle_deg, 360.0)), 0.2) << angle_deg;
  }
}

// OpenCV blurs parts of larger images, as cv::ORB's levels are, in floating point.
cv::Mat BlurredAsInOrb(const cv::Mat& image) {
  cv::Mat larger;
  cv::copyMakeBorder(image, larger, 8, 8, 8, 8, cv::BORDER_REFLECT_101);
  cv::Mat blurred;
  cv::GaussianBlur(larger(cv::Rect(cv::Point(8, 8), image.size())),
                   blurred,
                   cv::Size(7, 7),
                   2.0,
                   2.0,
                   cv::BORDER_REFLECT_101);
  return blurred;
}

TEST(ComputeOrbDescriptor, GivesTheBytesOfCvOrbAtAnyAngle) {
  const cv::Mat image = NoisyImage();
  const cv::Mat blurred = BlurredAsInOrb(image);
  const auto orb = cv::ORB::create(500, 1.2F, 1, 31, 0, 2, cv::ORB::FAST_SCORE, 31);
  cv::RNG random(5);
  std::vector<cv::KeyPoint> keypoints;
  for (int k = 0; k < 3000; ++k) {
    keypoints.emplace_back(static_cast<float>(random.uniform(40, 280)),
                           static_cast<float>(random.uniform(40, 200)),
                           31.0F,
                           random.uniform(-180.0F, 360.0F),
                           1.0F,
                           0);
  }
  // Where a turned point falls onto half a pixel.
  for (std::size_t k = 0; k < 24; ++k) keypoints[k].angle = 15.0F * static_cast<float>(k);
  cv::Mat expected;
  orb->compute(image, keypoints, expected);
  ASSERT_EQ(keypoints.size(), 3000u);
  cv::Mat descriptor(1, 32, CV_8U);
  for (int k = 0; k < expected.rows; ++k) {
    const int x = cvRound(keypoints[k].pt.x);
    const int y = cvRound(keypoints[k].pt.y);
    ComputeOrbDescriptor(blurred.ptr<std::uint8_t>(y) + x,
                         static_cast<std::ptrdiff_t>(blurred.step),
                         keypoints[k].angle,
                         descriptor.data);
    EXPECT_EQ(cv::norm(descriptor, expected.row(k), cv::NORM_HAMMING), 0.0)
        << keypoints[k].angle << " deg";
  }
}

FeatureOptions WithLevels(int num_levels, double scale_factor) {
  FeatureOptions options;
  options.num_levels = num_levels;
  options.scale_factor = scale_factor;
  return options;
}

TEST(BuildPyramid, EachLevelInterpolatesTheOneBefore) {
  const cv::Mat image = NoisyImage();
  for (const double scale_factor : {1.03, 1.2, 1.5, 1.99, 2.0}) {
    const ImagePyramid pyramid = BuildPyramid(image, WithLevels(5, scale_factor));
    ASSERT_EQ(pyramid.levels.size(), 5u);
    EXPECT_EQ(cv::norm(pyramid.levels[0], image, cv::NORM_INF), 0.0);
    for (std::size_t level = 1; level < pyramid.levels.size(); ++level) {
      const cv::Mat& above = pyramid.levels[level - 1];
      const cv::Mat& here = pyramid.levels[level];
      EXPECT_NEAR(here.cols * std::pow(scale_factor, level),
                  image.cols,
                  0.51 * std::pow(scale_factor, level));
      const double scale_x = double(above.cols) / here.cols;
      const double scale_y = double(above.rows) / here.rows;
      for (int y = 0; y < here.rows; ++y) {
        for (int x = 0; x < here.cols; ++x) {
          const double u = (x + 0.5) * scale_x - 0.5;
          const double v = (y + 0.5) * scale_y - 0.5;
          const int u0 = std::min(static_cast<int>(u), above.cols - 2);
          const int v0 = std::min(static_cast<int>(v), above.rows - 2);
          const auto grey = [&](int dx, int dy) {
            return double(above.at<std::uint8_t>(v0 + dy, u0 + dx));
          };
          const double upper = (1.0 - (u - u0)) * grey(0, 0) + (u - u0) * grey(1, 0);
          const double lower = (1.0 - (u - u0)) * grey(0, 1) + (u - u0) * grey(1, 1);
          const double expected = (1.0 - (v - v0)) * upper + (v - v0) * lower;
          ASSERT_NEAR(here.at<std::uint8_t>(y, x), expected, 0.53)
              << scale_factor << " level " << level << " at " << x << " " << y;
        }
      }
    }
  }
}

TEST(BuildPyramid, PositionsMapThereAndBack) {
  const ImagePyramid pyramid = BuildPyramid(NoisyImage(), FeatureOptions{});
  for (int level = 0; level < 8; ++level) {
    const cv::Mat& image = pyramid.levels[level];
    const Eigen::Vector2d corner = pyramid.ToImage(Eigen::Vector2d(-0.5, -0.5), level);
    EXPECT_LT((corner - Eigen::Vector2d(-0.5, -0.5)).norm(), 1e-12);
    const Eigen::Vector2d end =
        pyramid.ToImage(Eigen::Vector2d(image.cols - 0.5, image.rows - 0.5), level);
    EXPECT_LT((end - Eigen::Vector2d(319.5, 239.5)).norm(), 1e-9);
    const Eigen::Vector2d position(12.3, 45.6);
    EXPECT_LT((pyramid.ToLevel(pyramid.ToImage(position, level), level) - position).norm(), 1e-12);
  }
}

TEST(BuildPyramid, TinyImagesHaveAllLevels) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 5), cv::Size(17, 1), cv::Size(1, 40)}) {
    const cv::Mat image(size, CV_8U, cv::Scalar(100));
    const ImagePyramid pyramid = BuildPyramid(image, FeatureOptions{});
    ASSERT_EQ(pyramid.levels.size(), 8u);
    for (const cv::Mat& level : pyramid.levels) {
      ASSERT_FALSE(level.empty());
      EXPECT_EQ(cv::norm(level, cv::Mat(level.size(), CV_8U, cv::Scalar(100)), cv::NORM_INF), 0.0);
    }
  }
}

TEST(BuildPyramid, RejectsABrokenContract) {
  EXPECT_THROW(BuildPyramid(cv::Mat(), {}), std::invalid_argument);
  EXPECT_THROW(BuildPyramid(cv::Mat::zeros(40, 40, CV_8UC3), {}), std::invalid_argument);
  EXPECT_THROW(BuildPyramid(cv::Mat::zeros(40, 40, CV_32F), {}), std::invalid_argument);
  EXPECT_THROW(BuildPyramid(cv::Mat::zeros(40, 40, CV_8U), WithLevels(0, 1.2)),
               std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
