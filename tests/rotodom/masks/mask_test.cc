#include "rotodom/masks/mask.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "rotodom/types/archive.h"

namespace rotslam {
namespace {

// 60 x 40 pixels; the 10 x 10 from (20, 10) on are black.
cv::Mat WithSquare() {
  cv::Mat image(40, 60, CV_8U, cv::Scalar(255));
  image(cv::Rect(20, 10, 10, 10)) = 0;
  return image;
}

TEST(Mask, CoversWhatIsBlack) {
  const Mask mask(WithSquare());
  EXPECT_TRUE(mask.Covers({20.0, 10.0}, 0.0));
  EXPECT_TRUE(mask.Covers({29.4, 19.4}, 0.0));
  EXPECT_FALSE(mask.Covers({30.0, 15.0}, 0.0));
  EXPECT_FALSE(mask.Covers({19.4, 15.0}, 0.0));
  EXPECT_FALSE(mask.Covers({-5.0, 15.0}, 0.0));
  EXPECT_FALSE(mask.Covers({25.0, 45.0}, 0.0));
  EXPECT_NEAR(mask.Share(), 100.0 / 2400.0, 1e-12);
  EXPECT_EQ(cv::norm(mask.ToImage(), WithSquare(), cv::NORM_INF), 0.0);
}

TEST(Mask, ReachesBeyondIt) {
  const Mask mask(WithSquare());
  EXPECT_TRUE(mask.Covers({32.0, 15.0}, 3.0));
  EXPECT_FALSE(mask.Covers({33.0, 15.0}, 3.0));
}

TEST(Mask, IsEmptyWhereNothingIsBlack) {
  EXPECT_TRUE(Mask(cv::Mat(4, 5, CV_8U, cv::Scalar(1))).IsEmpty());
  EXPECT_FALSE(Mask().Covers({2.0, 2.0}, 100.0));
  EXPECT_EQ(Mask().Share(), 0.0);
}

TEST(Mask, RefusesOtherTypes) {
  EXPECT_THROW(Mask(cv::Mat(4, 5, CV_8UC3)), std::invalid_argument);
  EXPECT_THROW(Mask(cv::Mat()), std::invalid_argument);
}

TEST(Mask, UnionHasBoth) {
  cv::Mat other(40, 60, CV_8U, cv::Scalar(255));
  other(cv::Rect(0, 0, 5, 5)) = 0;
  const Mask both = Union(Mask(WithSquare()), Mask(other));
  EXPECT_TRUE(both.Covers({2.0, 2.0}, 0.0));
  EXPECT_TRUE(both.Covers({25.0, 15.0}, 0.0));
  EXPECT_FALSE(both.Covers({40.0, 30.0}, 0.0));
  EXPECT_EQ(Union(Mask(), Mask(other)).Share(), Mask(other).Share());
  const Mask small(cv::Mat(4, 5, CV_8U, cv::Scalar(0)));
  EXPECT_THROW(Union(small, Mask(other)), std::invalid_argument);
}

TEST(Mask, OfPolygonsIsTheirInside) {
  const Mask mask = MaskOfPolygons({{{20, 10}, {29, 10}, {29, 19}, {20, 19}}}, {60, 40});
  EXPECT_EQ(cv::norm(mask.ToImage(), WithSquare(), cv::NORM_INF), 0.0);
}

TEST(Mask, ComesBackFromAnArchive) {
  Mask mask(WithSquare());
  ArchiveWriter writer;
  writer(mask);
  const std::string bytes = writer.TakeBytes();
  Mask again;
  ArchiveReader reader(bytes);
  reader(again);
  EXPECT_EQ(cv::norm(again.ToImage(), WithSquare(), cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace rotslam
