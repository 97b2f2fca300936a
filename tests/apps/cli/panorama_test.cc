// `rotslam panorama`, and what `run` says of cameras that turn in place or stand still.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/run_directory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Frames of the simulated turn in place alone, and of the camera at rest.
class PanoramaCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    Simulate("turn", {"--frames=100", "--first=30", "--last=69"});
    Rest();
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  static void Simulate(const std::string& name, const std::vector<std::string>& more) {
    const CommandResult simulated = Rotslam(
        {"simulate", "gimbal", "--width=320", "--height=240", "--out=" + Sequence(name).string()},
        more);
    ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
    Run(name);
  }

  // One picture again and again, with fresh noise.
  static void Rest() {
    const fs::path images = Sequence("rest") / "images";
    fs::create_directories(images);
    fs::copy_file(Sequence("turn") / "camera.yaml", Sequence("rest") / "camera.yaml");
    const fs::path first = Sequence("turn") / "rgb" / FileNames(Sequence("turn") / "rgb").front();
    const cv::Mat picture = cv::imread(first.string(), cv::IMREAD_GRAYSCALE);
    cv::RNG random(7);
    for (int k = 10; k < 50; ++k) {
      cv::Mat noise(picture.size(), CV_16SC1);
      random.fill(noise, cv::RNG::NORMAL, 0.0, 2.0);
      cv::Mat noisy(picture.size(), CV_8UC1);
      for (int y = 0; y < picture.rows; ++y) {
        for (int x = 0; x < picture.cols; ++x) {
          noisy.at<unsigned char>(y, x) = cv::saturate_cast<unsigned char>(
              picture.at<unsigned char>(y, x) + noise.at<std::int16_t>(y, x));
        }
      }
      cv::imwrite((images / (std::to_string(k) + ".png")).string(), noisy);
    }
    Run("rest");
  }

  static void Run(const std::string& name) {
    const CommandResult run =
        Rotslam({"run", Sequence(name).string(), "--out=" + Out(name).string()});
    ASSERT_EQ(run.exit_code, 0) << run.error;
    EXPECT_THAT(run.error, HasSubstr("never leaves its place"));
  }

  static fs::path Sequence(const std::string& name) { return shared_->path() / name; }
  static fs::path Out(const std::string& name) { return shared_->path() / (name + "_out"); }

 private:
  static inline const TemporaryFolder* shared_ = nullptr;
};

TEST_F(PanoramaCommand, ATurnInPlaceHasOrientationsAndNoPoints) {
  const std::vector<SegmentRow> segments = ReadSegments(Out("turn") / "segments.csv");
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].kind, "rotating");
  EXPECT_EQ(segments[0].first, 0);
  EXPECT_EQ(segments[0].last, 39);
  const Trajectory poses = ReadTrajectory(Out("turn") / "trajectory_tum.txt");
  ASSERT_EQ(poses.size(), 40u);
  for (const StampedPose& pose : poses) EXPECT_EQ(pose.center_in_world, Eigen::Vector3d::Zero());
  EXPECT_EQ(CountPlyPoints(Out("turn") / "cloud.ply"), 0);
  EXPECT_LT(Compare(Sequence("turn") / "groundtruth_tum.txt", Out("turn") / "trajectory_tum.txt")
                .rpe1_deg,
            0.02);
}

TEST_F(PanoramaCommand, StitchesTheTurn) {
  const fs::path out = Out("turn") / "pano.png";
  const CommandResult result =
      Rotslam({"panorama", Out("turn").string(), "--out=" + out.string(), "--width=720"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.output, HasSubstr("of the frames 0 to 39"));
  const cv::Mat image = cv::imread(out.string(), cv::IMREAD_UNCHANGED);
  ASSERT_FALSE(image.empty());
  // 120 deg of turn and a view of 65, two pixels a degree.
  EXPECT_NEAR(image.cols, 370, 12);
  const CommandResult full =
      Rotslam({"panorama", Out("turn").string(), "--out=" + out.string(), "--width=720", "--full"});
  ASSERT_EQ(full.exit_code, 0) << full.error;
  EXPECT_EQ(cv::imread(out.string()).size(), cv::Size(720, 360));
}

TEST_F(PanoramaCommand, SaysWhatIsWrongInOneLine) {
  const std::string out = "--out=" + (Out("turn") / "x.png").string();
  const auto error = [&](const std::string& run, const std::vector<std::string>& more) {
    const CommandResult result = Rotslam({"panorama", run, out}, more);
    EXPECT_NE(result.exit_code, 0);
    EXPECT_EQ(Lines(result.error).size(), 1u) << result.error;
    return result.error;
  };
  EXPECT_THAT(error("nowhere", {}), HasSubstr("nowhere/summary.json"));
  EXPECT_THAT(error(Out("rest").string(), {}), HasSubstr("nowhere turns in one place"));
  EXPECT_THAT(error(Out("turn").string(), {"--segment=3"}), HasSubstr("no segment 3"));
  EXPECT_THAT(error(Out("turn").string(), {"--first=90"}), HasSubstr("frames 0 to 39"));
  EXPECT_THAT(error(Out("turn").string(), {"--sequence=gone"}), HasSubstr("gone"));
  EXPECT_THAT(error(Out("turn").string(), {"--width=7"}), HasSubstr("width"));
  const TemporaryFolder folder;
  fs::copy(Out("turn"), folder.path(), fs::copy_options::recursive);
  nlohmann::ordered_json summary = ReadSummary(folder.path());
  summary["camera"]["readout_s"] = -1.0;
  folder.Write("summary.json", summary.dump());
  EXPECT_THAT(error(folder.path().string(), {}), HasSubstr("readout_s"));
  summary["camera"]["readout_s"] = 0.02;
  summary["camera"]["readout_from"] = "up";
  folder.Write("summary.json", summary.dump());
  EXPECT_THAT(error(folder.path().string(), {}), HasSubstr("readout_from must be top"));
}

TEST_F(PanoramaCommand, ACameraAtRestStandsStill) {
  const std::vector<SegmentRow> segments = ReadSegments(Out("rest") / "segments.csv");
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].kind, "still");
  const Trajectory poses = ReadTrajectory(Out("rest") / "trajectory_tum.txt");
  ASSERT_EQ(poses.size(), 40u);
  for (const StampedPose& pose : poses) {
    EXPECT_EQ(pose.center_in_world, Eigen::Vector3d::Zero());
    EXPECT_LT(pose.world_from_cam.AngleDeg(), 0.01);
  }
}

}  // namespace
}  // namespace rotslam
