// Frames that are broken, dark, alike or of an unusual kind: the job is done, every frame has a
// pose.

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

using FaultyFrames = SmallSequenceTest;

class OneBadFrame : public FaultyFrames {
 protected:
  static constexpr int kBad = 10;

  // One warning, in one line, and a pose between those of the neighbours.
  void ExpectInterpolated(const fs::path& sequence, const std::string& reason) const {
    const CommandResult result = Run(sequence);
    EXPECT_THAT(Lines(result.error), ElementsAre(AllOf(HasSubstr("frame 10 "), HasSubstr(reason))));
    const Trajectory trajectory = Result(result);
    ASSERT_EQ(trajectory.size(), std::size_t{kNumFrames});
    EXPECT_LT(LargestErrorDeg(trajectory), 0.2);
    const StampedPose& before = trajectory[kBad - 1];
    const StampedPose& after = trajectory[kBad + 1];
    const Eigen::Vector3d middle = 0.5 * (before.center_in_world + after.center_in_world);
    EXPECT_LT((trajectory[kBad].center_in_world - middle).norm(),
              0.05 * (after.center_in_world - before.center_in_world).norm());
    EXPECT_NEAR(AngleDeg(before.world_from_cam, trajectory[kBad].world_from_cam),
                AngleDeg(trajectory[kBad].world_from_cam, after.world_from_cam),
                0.02);
  }
};

TEST_F(OneBadFrame, CutOffPng) {
  const fs::path sequence = Copy();
  const fs::path image = Images(sequence)[kBad];
  fs::resize_file(image, fs::file_size(image) / 2);
  ExpectInterpolated(sequence, "PNG data are cut off");
}

TEST_F(OneBadFrame, DamagedPng) {
  const fs::path sequence = Copy();
  const fs::path image = Images(sequence)[kBad];
  std::string bytes = ReadWholeFile(image);
  bytes[bytes.size() / 2] = static_cast<char>(~bytes[bytes.size() / 2]);
  std::ofstream(image, std::ios::binary) << bytes;
  ExpectInterpolated(sequence, "PNG data are damaged");
}

TEST_F(OneBadFrame, CutOffJpeg) {
  const fs::path sequence = Copy();
  const fs::path image = Images(sequence)[kBad];
  std::vector<unsigned char> bytes;
  ASSERT_TRUE(cv::imencode(".jpg", cv::imread(image.string(), cv::IMREAD_UNCHANGED), bytes));
  std::ofstream(image, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size() / 2));
  ExpectInterpolated(sequence, "JPEG data are cut off");
}

TEST_F(OneBadFrame, MissingFile) {
  const fs::path sequence = Copy();
  fs::remove(Images(sequence)[kBad]);
  ExpectInterpolated(sequence, "file cannot be opened");
}

TEST_F(OneBadFrame, AnotherSize) {
  ExpectInterpolated(CopyWith([](const cv::Mat& image, int frame) {
                       return frame == kBad ? image.rowRange(0, 120).clone() : image;
                     }),
                     "image is 320x120, the first readable one is 320x240");
}

TEST_F(FaultyFrames, AnotherSizeFromOneFrameOn) {
  constexpr int kFirst = 19;
  const CommandResult result = Run(CopyWith([](const cv::Mat& image, int frame) {
    cv::Mat half;
    cv::resize(image, half, {}, 0.5, 0.5, cv::INTER_AREA);
    return frame >= kFirst ? half : image;
  }));
  EXPECT_THAT(Lines(result.error),
              Contains(HasSubstr("image is 160x120")).Times(kNumFrames - kFirst));
  const Trajectory trajectory = Result(result);
  ASSERT_EQ(trajectory.size(), std::size_t{kNumFrames});
  for (int n = kFirst; n < kNumFrames; ++n) {
    EXPECT_LT(AngleDeg(trajectory[n].world_from_cam, trajectory[kFirst - 1].world_from_cam), 1e-9);
  }
}

TEST_F(FaultyFrames, UnreadableFramesAtBothEnds) {
  const fs::path sequence = Copy();
  const std::vector<fs::path> images = Images(sequence);
  for (const int frame : {0, 1, kNumFrames - 1}) fs::remove(images[frame]);
  const CommandResult result = Run(sequence);
  EXPECT_EQ(Lines(result.error).size(), 4u) << result.error;
  EXPECT_THAT(result.error, HasSubstr("frames 0-1, 23: nothing ties these frames to the map"));
  const Trajectory trajectory = Result(result);
  ASSERT_EQ(trajectory.size(), std::size_t{kNumFrames});
  // The ends take over the nearest orientation.
  for (const int frame : {0, 1}) {
    EXPECT_LT(AngleDeg(trajectory[frame].world_from_cam, trajectory[2].world_from_cam), 1e-9);
  }
  EXPECT_LT(AngleDeg(trajectory[kNumFrames - 1].world_from_cam,
                     trajectory[kNumFrames - 2].world_from_cam),
            1e-9);
  EXPECT_LT(LargestErrorDeg(Trajectory(trajectory.begin() + 2, trajectory.end() - 1), 2), 0.2);
}

TEST_F(FaultyFrames, ABlackoutInTheMiddle) {
  const CommandResult result = Run(CopyWith([](const cv::Mat& image, int frame) -> cv::Mat {
    return frame >= 8 && frame < 18 ? cv::Mat::zeros(image.size(), image.type()) : image;
  }));
  const Trajectory trajectory = Result(result);
  ASSERT_EQ(trajectory.size(), std::size_t{kNumFrames});
  EXPECT_THAT(Lines(result.error), Contains(HasSubstr("10 frames match no other")));
}

TEST_F(FaultyFrames, ACameraThatStands) {
  const cv::Mat first = cv::imread(Images(Good()).front().string(), cv::IMREAD_UNCHANGED);
  const CommandResult result = Run(CopyWith([&](const cv::Mat&, int) { return first; }));
  const Trajectory trajectory = Result(result);
  ASSERT_EQ(trajectory.size(), std::size_t{kNumFrames});
  for (const StampedPose& pose : trajectory) {
    EXPECT_LT(AngleDeg(pose.world_from_cam, trajectory[0].world_from_cam), 1e-3);
    EXPECT_EQ(pose.center_in_world, trajectory[0].center_in_world);
  }
}

TEST_F(FaultyFrames, TwoFramesInTurn) {
  const std::vector<fs::path> images = Images(Good());
  const CommandResult result = Run(CopyWith([&](const cv::Mat&, int frame) {
    return cv::imread(images[frame % 2 == 0 ? 0 : 12].string(), cv::IMREAD_UNCHANGED);
  }));
  ASSERT_EQ(Result(result).size(), std::size_t{kNumFrames});
}

// ---- unusual, but good

TEST_F(FaultyFrames, SixteenBitsAndAlpha) {
  const fs::path deep = CopyWith([](const cv::Mat& image, int) {
    cv::Mat grey;
    image.convertTo(grey, CV_16U, 257.0);
    return grey;
  });
  EXPECT_LT(LargestErrorDeg(Result(Run(deep))), 0.2);
  fs::remove_all(deep);
  fs::remove_all(Out());
  const fs::path alpha = CopyWith([](const cv::Mat& image, int) {
    cv::Mat bgra;
    cv::cvtColor(image, bgra, cv::COLOR_GRAY2BGRA);
    return bgra;
  });
  EXPECT_LT(LargestErrorDeg(Result(Run(alpha))), 0.2);
}

TEST_F(FaultyFrames, LinksInPlaceOfAllPaths) {
  const fs::path sequence = Copy();
  fs::rename(sequence / "rgb", folder_.path() / "elsewhere");
  fs::create_directory(sequence / "rgb");
  for (const auto& image : fs::directory_iterator(folder_.path() / "elsewhere")) {
    fs::create_symlink(image.path(), sequence / "rgb" / image.path().filename());
  }
  fs::create_directory_symlink(sequence, folder_.path() / "link");
  fs::create_directory(folder_.path() / "results");
  fs::create_directory_symlink(folder_.path() / "results", Out());
  EXPECT_LT(LargestErrorDeg(Result(Run(folder_.path() / "link"))), 0.2);
  EXPECT_TRUE(fs::is_symlink(Out()));
  // A link to itself, and one to nothing.
  fs::remove(folder_.path() / "link");
  fs::create_symlink("link", folder_.path() / "link");
  EXPECT_THAT(Lines(Run(folder_.path() / "link").error), ElementsAre(HasSubstr("link: ")));
  fs::remove(folder_.path() / "elsewhere" / Images(sequence)[10].filename());
  EXPECT_THAT(Lines(Run(sequence).error),
              ElementsAre(AllOf(HasSubstr("frame 10 "), HasSubstr("file cannot be opened"))));
}

TEST_F(FaultyFrames, PathsWithSpacesAndOtherScripts) {
  const fs::path sequence = Copy("mit Leerzeichen, 日本 'é");
  const std::string out = (folder_.path() / "Ergebnis ü %s").string();
  const CommandResult result =
      Rotslam({"run", sequence.string(), "--no-report", "--out", out, "--quiet"});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(result.error, "");
  EXPECT_EQ(ReadTrajectory(out + "/trajectory_tum.txt").size(), std::size_t{kNumFrames});
}

}  // namespace
}  // namespace rotslam
