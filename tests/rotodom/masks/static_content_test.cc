#include "rotodom/masks/static_content.h"

#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "rotodom/types/archive.h"

namespace rotslam {
namespace {

const cv::Size kSize(400, 300);

cv::Mat Texture(const cv::Size& size, std::uint64_t seed) {
  cv::Mat texture(size, CV_8U);
  cv::RNG(seed).fill(texture, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(texture, texture, {}, 2.5);
  cv::normalize(texture, texture, 20, 235, cv::NORM_MINMAX);
  return texture;
}

// The view of a camera that moves along a wall, frame k.
cv::Mat Moving(int k) {
  static const cv::Mat kWall = Texture({1200, 300}, 1);
  return kWall(cv::Rect(3 * k, 0, kSize.width, kSize.height)).clone();
}

// The view of a camera that stands beside a road: patches of texture pass in two lanes.
cv::Mat Standing(int k) {
  static const cv::Mat kPlace = Texture(kSize, 2);
  static const cv::Mat kCar = Texture({110, 70}, 3);
  cv::Mat image = kPlace.clone();
  for (const auto& [x, y] : {std::pair(9 * k, 60),
                             std::pair(9 * k + 260, 60),
                             std::pair(2000 - 7 * k, 180),
                             std::pair(2240 - 7 * k, 180)}) {
    const cv::Rect car(x % 520 - 110, y, 110, 70);
    const cv::Rect seen = car & cv::Rect({0, 0}, kSize);
    if (seen.empty()) continue;
    kCar(seen - car.tl()).copyTo(image(seen));
  }
  cv::Mat noise(kSize, CV_16S);
  cv::RNG(100 + k).fill(noise, cv::RNG::NORMAL, 0.0, 1.5);
  cv::add(image, noise, image, cv::noArray(), CV_8U);
  return image;
}

// Specks of dirt.
void AddDirt(cv::Mat& image) {
  cv::RNG rng(5);
  for (int k = 0; k < 60; ++k) {
    const cv::Point center(rng.uniform(0, kSize.width), rng.uniform(0, kSize.height));
    cv::circle(image, center, rng.uniform(3, 7), cv::Scalar(25), cv::FILLED);
  }
}

void AddText(cv::Mat& image) {
  for (const int y : {40, 120, 260}) {
    cv::putText(image, "16.2V  31.8M", {20, y}, cv::FONT_HERSHEY_DUPLEX, 1.2, {0}, 6);
    cv::putText(image, "16.2V  31.8M", {20, y}, cv::FONT_HERSHEY_DUPLEX, 1.2, {255}, 2);
  }
}

// A round picture, as an endoscope has it.
void AddBorder(cv::Mat& image) {
  cv::Mat inside(kSize, CV_8U, cv::Scalar(0));
  cv::circle(inside, {205, 148}, 130, cv::Scalar(255), cv::FILLED);
  image.setTo(0, inside == 0);
}

StaticContent FindIn(const std::function<cv::Mat(int)>& view, int num_frames = 100) {
  StaticContentFinder finder;
  for (int k = 0; k < num_frames; ++k) finder.Add(view(k));
  constexpr bool kHasRotated = true;
  return finder.Find(kHasRotated);
}

StaticContent FindOn(const std::function<void(cv::Mat&)>& add) {
  return FindIn([&](int k) {
    cv::Mat image = Moving(k);
    add(image);
    return image;
  });
}

TEST(StaticContent, IsNoneInFrontOfAMovingCamera) {
  EXPECT_EQ(FindIn(Moving).kind, StaticContentKind::kNone);
}

TEST(StaticContent, IsNoneWhereNothingMoves) {
  EXPECT_EQ(FindIn([](int) { return Moving(0); }).kind, StaticContentKind::kNone);
}

TEST(StaticContent, IsNoneInAFewFrames) {
  const auto view = [](int k) {
    cv::Mat image = Moving(k);
    AddText(image);
    return image;
  };
  EXPECT_EQ(FindIn(view, 20).kind, StaticContentKind::kNone);
}

TEST(StaticContent, IsText) {
  const StaticContent content = FindOn(AddText);
  EXPECT_EQ(content.kind, StaticContentKind::kOnPicture);
  ASSERT_EQ(content.mask.size(), kSize);
  EXPECT_TRUE(content.mask.Covers({60.0, 30.0}, 0.0));
  EXPECT_FALSE(content.mask.Covers({200.0, 190.0}, 0.0));
  EXPECT_LT(content.mask.Share(), 0.6);
}

TEST(StaticContent, IsDirt) {
  const StaticContent content = FindOn(AddDirt);
  EXPECT_EQ(content.kind, StaticContentKind::kOnPicture);
  // Most of the specks.
  cv::Mat specks(kSize, CV_8U, cv::Scalar(255));
  AddDirt(specks);
  const double num_all = cv::countNonZero(specks == 25);
  const double num_masked = cv::countNonZero((specks == 25) & (content.mask.ToImage() == 0));
  EXPECT_GT(num_masked, 0.8 * num_all);
  EXPECT_LT(content.mask.Share(), 0.5);
}

TEST(StaticContent, IsABorder) {
  const StaticContent content = FindOn(AddBorder);
  EXPECT_EQ(content.kind, StaticContentKind::kOnPicture);
  EXPECT_TRUE(content.mask.Covers({205.0, 19.0}, 1.0));
  EXPECT_FALSE(content.mask.Covers({205.0, 148.0}, 20.0));
}

// The end of a street, or mountains, that a camera drives towards.
TEST(StaticContent, IsNoSceneFarAwayWithoutARotation) {
  StaticContentFinder finder;
  for (int k = 0; k < 100; ++k) {
    cv::Mat image = Moving(k);
    const cv::Rect far(180, 130, 50, 40);
    Moving(0)(far).copyTo(image(far));
    finder.Add(image);
  }
  EXPECT_EQ(finder.Find(false).kind, StaticContentKind::kNone);
  EXPECT_EQ(finder.Find(true).kind, StaticContentKind::kOnPicture);
}

TEST(StaticContent, TellsACameraThatStands) {
  EXPECT_EQ(FindIn(Standing).kind, StaticContentKind::kStanding);
}

TEST(StaticContent, GoesOnFromAnArchive) {
  StaticContentFinder whole;
  StaticContentFinder first;
  const auto view = [](int k) {
    cv::Mat image = Moving(k);
    AddText(image);
    return image;
  };
  for (int k = 0; k < 150; ++k) whole.Add(view(k));
  for (int k = 0; k < 77; ++k) first.Add(view(k));
  ArchiveWriter writer;
  writer(first);
  const std::string bytes = writer.TakeBytes();
  StaticContentFinder second;
  ArchiveReader reader(bytes);
  reader(second);
  for (int k = 77; k < 150; ++k) second.Add(view(k));
  const Mask a = whole.Find(true).mask;
  const Mask b = second.Find(true).mask;
  ASSERT_FALSE(a.IsEmpty());
  EXPECT_EQ(cv::norm(a.ToImage(), b.ToImage(), cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace rotslam
