#include "apps/slam/input/frame_source.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/slam/image_source.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Eight images, each of one grey value: ten times its number.
SimulatedSequence EightGreys() {
  SimulatedSequence sequence;
  for (int k = 0; k < 8; ++k) {
    sequence.images.emplace_back(20, 30, CV_8U, cv::Scalar(10.0 * k));
    sequence.truth.emplace_back().timestamp_s = 0.1 * k;
  }
  return sequence;
}

int GreyOf(const cv::Mat& image) { return image.at<std::uint8_t>(3, 4); }

std::vector<int> GreysLeft(FrameSource& frames) {
  std::vector<int> greys;
  while (const auto frame = frames.Next()) greys.push_back(GreyOf(frame->image));
  return greys;
}

std::vector<int> GreysRead(FrameSource& frames, const std::set<FrameId>& ids) {
  std::vector<int> greys;
  frames.Read(
      ids,
      [&](FrameId frame, const cv::Mat& image) {
        EXPECT_TRUE(ids.contains(frame));
        greys.push_back(GreyOf(image));
      },
      [](const std::string& problem) { ADD_FAILURE() << problem; });
  return greys;
}

TEST(FirstFrames, EndAfterSoMany) {
  ImageSource all(EightGreys());
  FirstFrames some(all, 3);
  EXPECT_EQ(some.NumFrames(), 3);
  EXPECT_THAT(GreysLeft(some), ElementsAre(0, 10, 20));
  EXPECT_THAT(GreysLeft(some), IsEmpty());
  EXPECT_EQ(all.next(), 3) << "the rest stays where it is";
  FirstFrames more(all, 20);
  EXPECT_EQ(more.NumFrames(), 8);
}

TEST(FirstFrames, CountWhatIsSkipped) {
  ImageSource all(EightGreys());
  FirstFrames some(all, 4);
  some.Skip(2);
  EXPECT_THAT(GreysLeft(some), ElementsAre(20, 30));
  some.Rewind();
  some.Skip(9);
  EXPECT_THAT(GreysLeft(some), IsEmpty());
  EXPECT_EQ(all.next(), 4);
}

TEST(FirstFrames, StartAgainAndReadImages) {
  ImageSource all(EightGreys());
  FirstFrames some(all, 2);
  EXPECT_THAT(GreysLeft(some), ElementsAre(0, 10));
  some.Rewind();
  EXPECT_THAT(GreysLeft(some), ElementsAre(0, 10));
  EXPECT_THAT(GreysRead(some, {FrameId{0}, FrameId{1}}), ElementsAre(0, 10));
}

class SequenceSourceTest : public testing::Test {
 protected:
  void SetUp() override {
    const SimulatedSequence sequence = EightGreys();
    for (std::size_t k = 0; k < sequence.images.size(); ++k) {
      cv::imwrite((folder_.path() / (std::to_string(k) + ".png")).string(), sequence.images[k]);
    }
  }

  const TemporaryFolder folder_;
};

TEST_F(SequenceSourceTest, ReadsImagesWhereverNextStands) {
  SequenceSource source(folder_.path(), {.first = 1});
  EXPECT_EQ(source.NumFrames(), 7);
  source.Skip(1);
  EXPECT_EQ(source.Next()->id, FrameId{1});
  EXPECT_THAT(GreysRead(source, {FrameId{0}, FrameId{3}, FrameId{6}}), ElementsAre(10, 40, 70));
  EXPECT_EQ(source.Next()->id, FrameId{2});
}

TEST_F(SequenceSourceTest, StartsAgain) {
  SequenceSource source(folder_.path(), {.stride = 3});
  EXPECT_THAT(GreysLeft(source), ElementsAre(0, 30, 60));
  source.Rewind();
  EXPECT_THAT(GreysLeft(source), ElementsAre(0, 30, 60));
}

}  // namespace
}  // namespace rotslam
