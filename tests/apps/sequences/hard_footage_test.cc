// Footage that shows nothing, or something else, for a while: what the orientations say of it, and
// that they are as good afterwards as before.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

class HardFootage : public SmallSequenceTest {
 protected:
  // The fault: frames 9 to 16 of 24.
  static constexpr int kFirst = 9;
  static constexpr int kLast = 16;

  CommandResult Rotations(const std::function<cv::Mat(const cv::Mat&, int frame)>& fault) const {
    const std::filesystem::path sequence = CopyWith([&](const cv::Mat& image, int frame) {
      return frame < kFirst || frame > kLast ? image : fault(image, frame);
    });
    const CommandResult result = Rotslam(
        {"rotations", sequence.string(), "--out", Out().string(), "--no-report", "--quiet"});
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return result;
  }

  std::vector<std::string> Rows() const {
    std::vector<std::string> rows = Lines(ReadWholeFile(Out() / "rotations.csv"));
    rows.erase(rows.begin());
    return rows;
  }

  // Error of the turn from one frame to another.
  static double TurnErrorDeg(const Trajectory& trajectory, int from, int to) {
    const Trajectory truth = ReadTrajectory(Good() / "groundtruth_tum.txt");
    return AngleDeg(trajectory[from].world_from_cam.Inverse() * trajectory[to].world_from_cam,
                    truth[from].world_from_cam.Inverse() * truth[to].world_from_cam);
  }

  // The frames of the fault have no edge and no uncertainty that would be a lie; those behind it
  // are tied to those before it.
  void ExpectBridged(const CommandResult& result) const {
    EXPECT_THAT(Lines(result.error), Contains(HasSubstr("8 frames match no other")));
    const std::vector<std::string> rows = Rows();
    ASSERT_EQ(rows.size(), std::size_t{kNumFrames});
    for (int k = 0; k < kNumFrames; ++k) {
      const bool is_fault = k >= kFirst && k <= kLast;
      EXPECT_EQ(rows[k].find("predicted") != std::string::npos, is_fault) << rows[k];
      EXPECT_EQ(rows[k].find(",,,") != std::string::npos, is_fault) << rows[k];
      EXPECT_EQ(rows[k].find("break"), std::string::npos) << rows[k];
    }
    const Trajectory trajectory = ReadTrajectory(Out() / "rotations_tum.txt");
    EXPECT_LT(TurnErrorDeg(trajectory, kFirst - 1, kLast + 1), 0.3);
    EXPECT_LT(TurnErrorDeg(trajectory, kLast + 1, kNumFrames - 1), 0.2);
  }
};

TEST_F(HardFootage, Black) {
  ExpectBridged(Rotations([](const cv::Mat& image, int) -> cv::Mat {
    return cv::Mat::zeros(image.size(), image.type());
  }));
}

TEST_F(HardFootage, White) {
  ExpectBridged(Rotations([](const cv::Mat& image, int) {
    return cv::Mat(image.size(), image.type(), cv::Scalar::all(255));
  }));
}

// Noise has corners, other ones in every frame: they must not push out what was seen before.
TEST_F(HardFootage, CoveredLens) {
  ExpectBridged(Rotations([](const cv::Mat& image, int frame) {
    cv::Mat noise(image.size(), CV_8UC1);
    cv::RNG random(static_cast<std::uint64_t>(frame) + 1);
    random.fill(noise, cv::RNG::NORMAL, 40.0, 5.0);
    return noise;
  }));
}

TEST_F(HardFootage, FrozenFrame) {
  const cv::Mat frozen = cv::imread(Images(Good())[kFirst].string(), cv::IMREAD_UNCHANGED);
  const CommandResult result = Rotations([&](const cv::Mat&, int) { return frozen; });
  EXPECT_THAT(result.error, IsEmpty());
  const Trajectory trajectory = ReadTrajectory(Out() / "rotations_tum.txt");
  for (int k = kFirst + 1; k <= kLast; ++k) {
    EXPECT_LT(AngleDeg(trajectory[k].world_from_cam, trajectory[kFirst].world_from_cam), 0.01);
  }
  EXPECT_LT(TurnErrorDeg(trajectory, kFirst, kLast + 1), 0.3);
  EXPECT_LT(TurnErrorDeg(trajectory, kLast + 1, kNumFrames - 1), 0.2);
}

TEST_F(HardFootage, NothingToSeeAtAll) {
  const std::filesystem::path sequence = CopyWith([](const cv::Mat& image, int) {
    return cv::Mat(image.size(), image.type(), cv::Scalar(90));
  });
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("no two of the 24 frames could be matched"));
}

// Nothing says how the two hang together.
TEST_F(HardFootage, ACutToAnotherPlace) {
  const std::filesystem::path other = folder_.path() / "other";
  ASSERT_EQ(Rotslam({"simulate",
                     "street",
                     "--width=320",
                     "--height=240",
                     "--frames=24",
                     "--quiet",
                     "--out=" + other.string()})
                .exit_code,
            0);
  const std::vector<std::filesystem::path> images = Images(other);
  const std::filesystem::path sequence = CopyWith([&](const cv::Mat& image, int frame) {
    return frame < 12 ? image : cv::imread(images[frame].string(), cv::IMREAD_UNCHANGED);
  });
  const CommandResult result =
      Rotslam({"rotations", sequence.string(), "--out", Out().string(), "--no-report", "--quiet"});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(Lines(result.error), Contains(HasSubstr("frame 12 matches none before it")));
  const std::vector<std::string> rows = Rows();
  ASSERT_EQ(rows.size(), std::size_t{kNumFrames});
  EXPECT_THAT(rows[12], HasSubstr("break"));
  // What lies between the two is not known, and so is no orientation against the first frame.
  for (int k = 13; k < kNumFrames; ++k) EXPECT_THAT(rows[k], HasSubstr(",,,"));
  EXPECT_LT(LargestErrorDeg([&] {
              Trajectory first = ReadTrajectory(Out() / "rotations_tum.txt");
              first.resize(12);
              return first;
            }()),
            0.2);
}

}  // namespace
}  // namespace rotslam
