// Whether pictures are told to be those that a run has read.

#include "apps/cli/export/picture_check.h"

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/sequence/frame_thumbnail.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

constexpr int kNumPictures = 40;

// A view of a large texture, `step_px` further to the right with each frame.
class Video {
 public:
  explicit Video(double step_px) : step_px_(step_px) {
    cv::RNG random(7);
    cv::Mat coarse(30, 80, CV_8UC3);
    random.fill(coarse, cv::RNG::UNIFORM, 0, 255);
    cv::resize(coarse, texture_, {}, 16.0, 16.0, cv::INTER_CUBIC);
    for (int k = 0; k < 600; ++k) {
      const cv::Point corner(random.uniform(0, texture_.cols), random.uniform(0, texture_.rows));
      cv::rectangle(texture_,
                    {corner.x, corner.y, random.uniform(4, 40), random.uniform(4, 40)},
                    cv::Scalar(random.uniform(0, 255), random.uniform(0, 255), 90),
                    cv::FILLED);
    }
  }

  cv::Mat Frame(int number) const {
    cv::Mat frame;
    const cv::Matx23d shift(1.0, 0.0, -(20.0 + step_px_ * number), 0.0, 1.0, -20.0);
    cv::warpAffine(texture_, frame, shift, {320, 240}, cv::INTER_LINEAR);
    return frame;
  }

  ThumbnailTable Thumbnails() const {
    ThumbnailTable table{kThumbnailWidth, kThumbnailHeight, {}};
    for (int k = 0; k < kNumPictures; ++k) table.grey.push_back(MakeFrameThumbnail(Frame(k)));
    return table;
  }

 private:
  double step_px_;
  cv::Mat texture_;
};

cv::Mat Jpeg(const cv::Mat& image, int quality) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(bytes, cv::IMREAD_COLOR);
}

// What the check says when frame k is offered change(k).
template <typename Change>
std::optional<std::string> Check(const Video& video, const Change& change) {
  std::vector<OfferedPicture> pictures;
  for (int k = 0; k < kNumPictures; ++k) {
    pictures.push_back({FrameId{k}, std::to_string(k) + ".png", MakeFrameThumbnail(change(k))});
  }
  return FindWrongPicture(video.Thumbnails(), pictures);
}

TEST(PictureCheck, TakesWhatCompressionAndExposureMakeOfAFrame) {
  for (const double step_px : {0.0, 0.3, 2.0, 20.0}) {
    const Video video(step_px);
    EXPECT_EQ(Check(video, [&](int k) { return video.Frame(k); }), std::nullopt);
    for (const int quality : {95, 50, 20}) {
      EXPECT_EQ(Check(video, [&](int k) { return Jpeg(video.Frame(k), quality); }), std::nullopt)
          << step_px << " px, quality " << quality;
    }
    EXPECT_EQ(Check(video,
                    [&](int k) {
                      cv::Mat brighter;
                      video.Frame(k).convertTo(brighter, -1, 0.8, 25.0);
                      return brighter;
                    }),
              std::nullopt);
  }
}

TEST(PictureCheck, FindsFramesThatWereShifted) {
  for (const double step_px : {1.0, 2.0, 5.0, 20.0}) {
    const Video video(step_px);
    for (const int quality : {95, 50}) {
      const auto problem = Check(video, [&](int k) { return Jpeg(video.Frame(k + 1), quality); });
      ASSERT_TRUE(problem.has_value()) << step_px << " px, quality " << quality;
      EXPECT_THAT(*problem,
                  HasSubstr("0.png: is not the picture that the run read as frame 0; it "
                            "looks like frame 1"));
    }
  }
}

TEST(PictureCheck, FindsOneFrameOfMany) {
  const Video video(8.0);
  const auto problem = Check(video, [&](int k) { return video.Frame(k == 17 ? 15 : k); });
  ASSERT_TRUE(problem.has_value());
  EXPECT_THAT(*problem,
              HasSubstr("17.png: is not the picture that the run read as frame 17; it "
                        "looks like frame 15"));
}

TEST(PictureCheck, FindsAnotherScene) {
  const Video video(5.0);
  const auto problem = Check(video, [&](int k) {
    cv::Mat other;
    cv::flip(video.Frame(k), other, 0);
    return other;
  });
  ASSERT_TRUE(problem.has_value());
  EXPECT_THAT(*problem, HasSubstr("0.png: is not the picture that the run read as frame 0"));
}

TEST(PictureCheck, LetsFramesPassThatItKnowsNothingOf) {
  const Video video(5.0);
  ThumbnailTable thumbnails = video.Thumbnails();
  thumbnails.grey[3].clear();  // could not be read
  const std::vector<std::uint8_t> other = MakeFrameThumbnail(video.Frame(30));
  EXPECT_EQ(FindWrongPicture(thumbnails, {{FrameId{3}, "3.png", other}}), std::nullopt);
  EXPECT_EQ(FindWrongPicture(thumbnails, {{FrameId{99}, "99.png", other}}), std::nullopt);
  EXPECT_EQ(FindWrongPicture({}, {{FrameId{0}, "0.png", other}}), std::nullopt);
}

TEST(FrameThumbnail, IsTheSameOfGreyAndOfLargeImages) {
  const cv::Mat image = Video(0.0).Frame(0);
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  cv::Mat large;
  cv::resize(image, large, {}, 5.0, 5.0, cv::INTER_LINEAR);
  const FrameThumbnail thumbnail = MakeFrameThumbnail(image);
  ASSERT_EQ(thumbnail.size(), static_cast<std::size_t>(kThumbnailWidth * kThumbnailHeight));
  for (const cv::Mat& other : {grey, large}) {
    const FrameThumbnail same = MakeFrameThumbnail(other);
    for (std::size_t k = 0; k < thumbnail.size(); ++k) EXPECT_NEAR(same[k], thumbnail[k], 6);
  }
  EXPECT_TRUE(MakeFrameThumbnail({}).empty());
}

}  // namespace
}  // namespace rotslam
