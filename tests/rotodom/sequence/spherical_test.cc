#include "rotodom/sequence/spherical.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace rotslam {
namespace {

constexpr int kHeight = 128;

// A spherical picture of a coloured world, turned by `turn_rad` about the vertical axis.
cv::Mat Sphere(double turn_rad) {
  cv::Mat image(kHeight, 2 * kHeight, CV_8UC3);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double azimuth = 2.0 * std::numbers::pi * (x + 0.5) / image.cols + turn_rad;
      const double polar = std::numbers::pi * (y + 0.5) / image.rows;
      const double a = std::sin(polar) * std::cos(azimuth);
      const double b = std::sin(polar) * std::sin(azimuth);
      const double c = std::cos(polar);
      const double wave =
          std::sin(7.0 * a + 3.0 * c) + std::cos(9.0 * b + 1.0) + std::sin(5.0 * a * b);
      image.at<cv::Vec3b>(y, x) = cv::Vec3b::all(cv::saturate_cast<unsigned char>(128 + 40 * wave));
    }
  }
  cv::Mat noise(image.size(), CV_8UC3);
  cv::theRNG().state = 7;
  cv::randn(noise, cv::Scalar::all(8), cv::Scalar::all(2));
  return image + noise;
}

TEST(Spherical, KnowsSpheresByTheirEdges) {
  EXPECT_TRUE(AreSpherical({Sphere(0.0), cv::Mat(), Sphere(0.4), Sphere(2.0)}));
  cv::Mat grey;
  cv::cvtColor(Sphere(1.0), grey, cv::COLOR_BGR2GRAY);
  EXPECT_TRUE(AreSpherical({grey}));
  EXPECT_FALSE(AreSpherical({}));
}

TEST(Spherical, RefusesNoImageOfALens) {
  const cv::Mat sphere = Sphere(0.0);
  cv::Mat crop;  // twice as wide as high, from the middle
  cv::resize(sphere(cv::Rect(64, 32, 128, 64)), crop, sphere.size());
  EXPECT_FALSE(AreSpherical({crop}));
  EXPECT_FALSE(AreSpherical({sphere, crop}));  // the images must agree
  // Another size, and black borders, whose edges are alike because they show nothing.
  EXPECT_FALSE(AreSpherical({sphere(cv::Rect(0, 0, 240, 128))}));
  cv::Mat framed = cv::Mat::zeros(sphere.size(), CV_8UC3);
  crop(cv::Rect(30, 20, 196, 88)).copyTo(framed(cv::Rect(30, 20, 196, 88)));
  EXPECT_FALSE(AreSpherical({framed}));
  // A letterbox: rows are constant at the top and bottom, the edges do not meet.
  cv::Mat letterbox = cv::Mat::zeros(sphere.size(), CV_8UC3);
  crop.rowRange(16, 112).copyTo(letterbox.rowRange(16, 112));
  EXPECT_FALSE(AreSpherical({letterbox}));
  EXPECT_FALSE(AreSpherical({cv::Mat::zeros(sphere.size(), CV_8UC1)}));
}

}  // namespace
}  // namespace rotslam
