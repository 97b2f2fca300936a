#include "apps/slam/masks/frame_masks.h"

#include <functional>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const cv::Size kSize(60, 40);

// White, with a black square of 10 x 10 pixels whose left side is at `left`.
cv::Mat SquareAt(int left) {
  cv::Mat image(kSize, CV_8U, cv::Scalar(255));
  image(cv::Rect(left, 10, 10, 10)) = 0;
  return image;
}

class FrameMasksTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name, const cv::Mat& image) const {
    cv::imwrite((folder_.path() / name).string(), image);
    return folder_.path() / name;
  }

  static std::string Complaint(const std::function<void()>& action) {
    try {
      action();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  const TemporaryFolder folder_;
};

TEST_F(FrameMasksTest, BlackIsIgnored) {
  const Mask mask = ReadMask(Write("mask.png", SquareAt(20)), kSize);
  EXPECT_TRUE(mask.Covers({25.0, 15.0}, 0.0));
  EXPECT_FALSE(mask.Covers({40.0, 15.0}, 0.0));
  // All that is not black is used.
  EXPECT_TRUE(ReadMask(Write("ones.png", cv::Mat(kSize, CV_8U, cv::Scalar(1))), kSize).IsEmpty());
}

TEST_F(FrameMasksTest, BlackOfAJpegIsNotExact) {
  const Mask mask = ReadMask(Write("mask.jpg", SquareAt(20)), kSize);
  EXPECT_NEAR(mask.Share(), 100.0 / 2400.0, 0.01);
}

TEST_F(FrameMasksTest, SaysInOneLineWhatIsWrong) {
  const auto missing = folder_.path() / "none.png";
  EXPECT_THAT(Complaint([&] { ReadMask(missing, kSize); }), HasSubstr("none.png: "));
  const auto small = Write("small.png", cv::Mat(4, 5, CV_8U, cv::Scalar(255)));
  EXPECT_THAT(Complaint([&] { ReadMask(small, kSize); }),
              HasSubstr("small.png: the mask is 5x4, the images are 60x40"));
  const auto black = Write("black.png", cv::Mat(kSize, CV_8U, cv::Scalar(0)));
  EXPECT_THAT(Complaint([&] { ReadMask(black, kSize); }), HasSubstr("black everywhere"));
}

TEST_F(FrameMasksTest, FindsFilesByTheFramesNames) {
  Write("000001.jpg.png", SquareAt(0));  // as COLMAP has it
  Write("000002.png", SquareAt(10));     // the stem
  Write("3.png", SquareAt(20));          // without leading zeros
  FrameMasks masks;
  masks.AddFolder(folder_.path(), {"000001.jpg", "000002.jpg", "000003.jpg"}, kSize);
  masks.AddToAll(Mask(SquareAt(45)));
  for (const auto& [name, left] :
       {std::pair("000001.jpg", 0), std::pair("000002.jpg", 10), std::pair("000003.jpg", 20)}) {
    const Mask mask = masks.Of(name);
    EXPECT_TRUE(mask.Covers({left + 5.0, 15.0}, 0.0)) << name;
    EXPECT_TRUE(mask.Covers({50.0, 15.0}, 0.0)) << name;
    EXPECT_NEAR(mask.Share(), 200.0 / 2400.0, 1e-9) << name;
  }
}

TEST_F(FrameMasksTest, NamesTheFrameWithoutMask) {
  Write("1.png", SquareAt(0));
  FrameMasks masks;
  EXPECT_THAT(Complaint([&] {
                masks.AddFolder(folder_.path(), {"1.jpg", "2.jpg"}, kSize);
              }),
              HasSubstr("holds no mask for frame 2.jpg; it should be called 2.jpg.png"));
  EXPECT_THAT(Complaint([&] { masks.AddFolder(folder_.path() / "nowhere", {}, kSize); }),
              HasSubstr("nowhere: is no folder of masks"));
}

TEST_F(FrameMasksTest, AreWrittenAsColmapReadsThem) {
  FrameMasks masks;
  EXPECT_TRUE(WriteMasks(masks, {"a.jpg"}, folder_.path() / "masks").empty());
  masks.AddToAll(Mask(SquareAt(30)));
  const auto files = WriteMasks(masks, {"a.jpg", "left/b.png"}, folder_.path() / "masks");
  EXPECT_THAT(files, ElementsAre("a.jpg.png", "left/b.png.png"));
  for (const auto& file : files) {
    const cv::Mat image =
        cv::imread((folder_.path() / "masks" / file).string(), cv::IMREAD_UNCHANGED);
    ASSERT_FALSE(image.empty());
    EXPECT_EQ(cv::norm(image, SquareAt(30), cv::NORM_INF), 0.0);
  }
}

}  // namespace
}  // namespace rotslam
