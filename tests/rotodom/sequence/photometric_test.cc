#include "rotodom/sequence/photometric.h"

#include <cmath>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "rotodom/sequence/sequence.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

const cv::Size kSize(64, 48);

// The lens's share of the light at a pixel: 1 in the middle, 0.55 in the corners.
double VignetteAt(int x, int y) {
  const double dx = (x - 31.5) / 40.0;
  const double dy = (y - 23.5) / 40.0;
  return 1.0 - 0.45 * (dx * dx + dy * dy);
}

cv::Mat MakeVignette() {
  cv::Mat vignette(kSize, CV_16U);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      vignette.at<std::uint16_t>(y, x) =
          static_cast<std::uint16_t>(std::lround(60000.0 * VignetteAt(x, y)));
    }
  }
  return vignette;
}

// A camera whose tone is the light to the power `gamma`, looking at an even wall.
cv::Mat PictureOf(double wall_tone, double gamma) {
  cv::Mat image(kSize, CV_8U);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const double light = std::pow(wall_tone / 255.0, 1.0 / gamma) * VignetteAt(x, y);
      image.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(std::lround(255.0 * std::pow(light, gamma)));
    }
  }
  return image;
}

std::string InverseResponse(double gamma) {
  std::string text;
  for (int tone = 0; tone < 256; ++tone) {
    text += std::to_string(255.0 * std::pow(tone / 255.0, 1.0 / gamma)) + " ";
  }
  return text;
}

class PhotometricTest : public testing::Test {
 protected:
  void SetUp() override { cv::imwrite((folder_.path() / "vignette.png").string(), MakeVignette()); }

  PhotometricFiles Files(const std::string& inverse_response) const {
    PhotometricFiles files;
    files.vignette = folder_.path() / "vignette.png";
    if (!inverse_response.empty()) {
      files.inverse_response = folder_.Write("pcalib.txt", inverse_response);
    }
    return files;
  }

  std::string Complaint(const PhotometricFiles& files, const cv::Size& size) const {
    try {
      const PhotometricCorrection correction(files, size);
      return "none";
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }

  const TemporaryFolder folder_;
};

TEST_F(PhotometricTest, MakesAnEvenWallEven) {
  for (const double gamma : {1.0, 0.45}) {
    const PhotometricCorrection correction(Files(gamma == 1.0 ? "" : InverseResponse(gamma)),
                                           kSize);
    for (const double tone : {40.0, 120.0, 200.0}) {
      cv::Mat image = PictureOf(tone, gamma);
      double darkest = 0.0;
      double brightest = 0.0;
      cv::minMaxLoc(image, &darkest, &brightest);
      ASSERT_GT(brightest - darkest, 5.0);
      correction.Apply(image);
      cv::minMaxLoc(image, &darkest, &brightest);
      EXPECT_NEAR(darkest, tone, 1.0) << gamma;
      EXPECT_NEAR(brightest, tone, 1.0) << gamma;
    }
  }
}

TEST_F(PhotometricTest, SaysWhatIsWrong) {
  EXPECT_THAT(Complaint(Files("1 2 3"), kSize), HasSubstr("pcalib.txt:1: has 3 numbers"));
  std::string falling;
  for (int tone = 0; tone < 256; ++tone) falling += std::to_string(tone == 7 ? 0 : tone) + " ";
  EXPECT_THAT(Complaint(Files(falling), kSize), HasSubstr("the light of tone 7 is not above"));
  EXPECT_THAT(Complaint(Files(""), {32, 48}),
              HasSubstr("vignette.png: is 64x48, the images are 32x48"));
  cv::imwrite((folder_.path() / "vignette.png").string(), cv::Mat::zeros(kSize, CV_8U));
  EXPECT_THAT(Complaint(Files(""), kSize), HasSubstr("black"));
}

TEST_F(PhotometricTest, IsAppliedToASequenceThatHasOne) {
  std::filesystem::create_directory(folder_.path() / "images");
  for (const char* name : {"00000.png", "00001.png", "00002.png"}) {
    cv::imwrite((folder_.path() / "images" / name).string(), PictureOf(120.0, 0.45));
  }
  folder_.Write("times.txt", "00000 1.0 0.01\n00001 1.1 0.01\n00002 1.2 0.01\n");
  folder_.Write("camera.txt", "0.5 0.6 0.5 0.5 0\n64 48\ncrop\n64 48\n");
  folder_.Write("pcalib.txt", InverseResponse(0.45));
  const auto sequence = OpenSequence(folder_.path(), {});
  EXPECT_THAT(sequence->notes(), testing::Contains(HasSubstr("vignetting")));
  const std::optional<Frame> frame = sequence->Next();
  ASSERT_TRUE(frame);
  EXPECT_NEAR(frame->image.at<std::uint8_t>(0, 0), 120, 1);
  EXPECT_NEAR(frame->image.at<std::uint8_t>(24, 32), 120, 1);
}

}  // namespace
}  // namespace rotslam
