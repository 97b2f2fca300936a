#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "output/trajectory/trajectory.h"
#include "tests/apps/command_line.h"

namespace rotslam {

/// A small sequence without fault, made once, and what a run may leave of it.
class SmallSequenceTest : public testing::Test {
 protected:
  static constexpr int kNumFrames = 24;

  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    const CommandResult result = Rotslam({"simulate",
                                          "handheld",
                                          "--width=320",
                                          "--height=240",
                                          "--frames=" + std::to_string(kNumFrames),
                                          "--quiet",
                                          "--out=" + Good().string()});
    ASSERT_EQ(result.exit_code, 0) << result.error;
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  // A sequence without fault, in TUM layout; not to be changed.
  static std::filesystem::path Good() { return shared_->path() / "good"; }

  // A copy to be spoilt.
  std::filesystem::path Copy(const std::string& name = "copy") const {
    std::filesystem::copy(Good(), folder_.path() / name, std::filesystem::copy_options::recursive);
    return folder_.path() / name;
  }

  static std::vector<std::filesystem::path> Images(const std::filesystem::path& sequence) {
    std::vector<std::filesystem::path> images;
    for (const auto& entry : std::filesystem::directory_iterator(sequence / "rgb")) {
      images.push_back(entry.path());
    }
    std::sort(images.begin(), images.end());
    return images;
  }

  // Reads, changes and writes back every image of a copy.
  std::filesystem::path CopyWith(
      const std::function<cv::Mat(const cv::Mat&, int frame)>& change) const {
    const std::filesystem::path sequence = Copy();
    const std::vector<std::filesystem::path> images = Images(sequence);
    for (std::size_t k = 0; k < images.size(); ++k) {
      const cv::Mat image = cv::imread(images[k].string(), cv::IMREAD_UNCHANGED);
      EXPECT_TRUE(cv::imwrite(images[k].string(), change(image, static_cast<int>(k))));
    }
    return sequence;
  }

  std::filesystem::path Out() const { return folder_.path() / "out"; }

  CommandResult Run(const std::filesystem::path& sequence,
                    const std::vector<std::string>& more = {}) const {
    return Rotslam({"run", sequence.string(), "--out", Out().string(), "--no-report", "--quiet"},
                   more);
  }

  // The line that a refused command prints, without "rotslam: ". Nothing may be left behind, but
  // for the checkpoint of one that is refused only after the images were read; it is thrown away
  // here.
  std::string Refusal(const CommandResult& result) const {
    EXPECT_GT(result.exit_code, 0) << result.error;
    EXPECT_EQ(result.output, "");
    EXPECT_THAT(
        FileNames(Out()),
        testing::AnyOf(testing::IsEmpty(),
                       testing::ElementsAre("unfinished/frames.bin", "unfinished/state.bin")));
    std::filesystem::remove_all(Out() / "unfinished");
    const std::vector<std::string> lines = Lines(result.error);
    EXPECT_THAT(lines, testing::ElementsAre(testing::StartsWith("rotslam: ")));
    EXPECT_TRUE(result.error.empty() || result.error.back() == '\n');
    return lines.empty() ? "" : lines.back().substr(std::string("rotslam: ").size());
  }

  // That the job was done for every frame of the good sequence; gives the trajectory.
  Trajectory Result(const CommandResult& result) const {
    EXPECT_EQ(result.exit_code, 0) << result.error;
    EXPECT_EQ(result.output, "");
    EXPECT_THAT(Lines(result.error), testing::Each(testing::StartsWith("rotslam: warning: ")));
    EXPECT_THAT(FileNames(Out()), testing::ElementsAreArray(RunFiles()));
    if (result.exit_code != 0) return {};
    Trajectory trajectory = ReadTrajectory(Out() / "trajectory_tum.txt");
    const Trajectory truth = ReadTrajectory(Good() / "groundtruth_tum.txt");
    EXPECT_EQ(trajectory.size(), truth.size());
    for (std::size_t k = 0; k < std::min(truth.size(), trajectory.size()); ++k) {
      EXPECT_NEAR(trajectory[k].timestamp_s, truth[k].timestamp_s, 1e-6);
    }
    return trajectory;
  }

  static double AngleDeg(const Rotation& a, const Rotation& b) {
    return (a.Inverse() * b).Angle() * 180.0 / M_PI;
  }

  // Largest error of an orientation relative to the first frame's.
  static double LargestErrorDeg(const Trajectory& trajectory, int first_frame = 0) {
    const Trajectory whole = ReadTrajectory(Good() / "groundtruth_tum.txt");
    const Trajectory truth(whole.begin() + first_frame, whole.end());
    double largest = 0.0;
    for (std::size_t k = 0; k < trajectory.size(); ++k) {
      largest =
          std::max(largest,
                   AngleDeg(trajectory[0].world_from_cam.Inverse() * trajectory[k].world_from_cam,
                            truth[0].world_from_cam.Inverse() * truth[k].world_from_cam));
    }
    return largest;
  }

  const TemporaryFolder folder_;

 private:
  static inline const TemporaryFolder* shared_ = nullptr;
};

}  // namespace rotslam
