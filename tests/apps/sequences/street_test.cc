// Ways along a simulated street that comes back, or on which the camera stops.

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "output/tables/loops_csv.h"
#include "rotodom/camera/read_camera.h"
#include "tests/apps/run_directory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// What a car does from one frame to the next.
struct Step {
  double length_m = 0.0;
  double turn_rad = 0.0;  // to the right
};

Trajectory Driven(const std::vector<Step>& steps) {
  Trajectory path;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double heading = 0.0;
  for (const Step& step : steps) {
    const Rotation world_from_cam = Rotation::Exp({0.0, heading, 0.0});
    path.push_back({static_cast<double>(path.size()), world_from_cam, center});
    const double middle = heading + 0.5 * step.turn_rad;
    center += step.length_m * Eigen::Vector3d(std::sin(middle), 0.0, std::cos(middle));
    heading += step.turn_rad;
  }
  return path;
}

// A folder with a street seen on that way.
void Film(const std::vector<Step>& steps,
          const std::vector<std::string>& size,
          const fs::path& out) {
  const TemporaryFolder folder;
  const fs::path poses = folder.path() / "poses.txt";
  WriteKittiTrajectory(poses, Driven(steps));
  const CommandResult simulated = Rotslam(
      {"simulate", "street", "--hfov-deg=80", "--poses=" + poses.string(), "--out=" + out.string()},
      size);
  ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
}

// A lap and a seventh around a block of 110 m x 70 m with rounded corners.
std::vector<Step> RoundABlock() {
  constexpr double kLength = 0.9;
  constexpr std::size_t kNumFrames = 438;
  constexpr int kCorner = 18;  // frames
  std::vector<Step> lap;
  for (const int side : {100, 55, 100, 55}) {
    lap.insert(lap.end(), side, {kLength, 0.0});
    lap.insert(lap.end(), kCorner, {kLength, 0.5 * std::numbers::pi / kCorner});
  }
  std::vector<Step> steps;
  while (steps.size() < kNumFrames) steps.push_back(lap[steps.size() % lap.size()]);
  return steps;
}

TEST(StreetRoundABlock, LoopsTakeDriftAwayAndNoneIsFalse) {
  const TemporaryFolder folder;
  const fs::path sequence = folder.path() / "street";
  Film(RoundABlock(), {"--width=256", "--height=80"}, sequence);
  const fs::path truth = sequence / "groundtruth_tum.txt";
  const auto rpe_n_deg = [&](const std::string& flag) {
    const fs::path out = folder.path() / flag;
    const CommandResult run =
        Rotslam({"rotations", sequence.string(), flag, "--no-report", "--out=" + out.string()});
    EXPECT_EQ(run.exit_code, 0) << run.error;
    return Compare(truth, out / "rotations_tum.txt").rpen_deg;
  };
  EXPECT_LT(rpe_n_deg("--loops"), rpe_n_deg("--no-loops"));

  int num_accepted = 0;
  const Trajectory stood = ReadTrajectory(truth);
  for (const LoopRow& loop : ReadLoopsCsv(folder.path() / "--loops" / "loops.csv")) {
    if (!loop.accepted) continue;
    ++num_accepted;
    EXPECT_GT(loop.frame, loop.match + 300);
    const Eigen::Vector3d apart =
        stood.at(loop.frame).center_in_world - stood.at(loop.match).center_in_world;
    EXPECT_LT(apart.norm(), 10.0) << loop.frame << " and " << loop.match;
  }
  EXPECT_GE(num_accepted, 3);
}

// The camera turns for 60 frames, and stands in 30 of them; it moves before and behind the stop
// though it turns there the same way.
TEST(StreetWithAStop, IsHeldAmidATurn) {
  std::vector<Step> steps(100, {0.05, 0.0});
  for (int frame = 20; frame < 80; ++frame) steps[frame].turn_rad = 1.5 * kRadFromDeg;
  for (int frame = 35; frame < 65; ++frame) steps[frame].length_m = 0.0;
  const TemporaryFolder folder;
  const fs::path sequence = folder.path() / "stop";
  Film(steps, {"--width=320", "--height=120"}, sequence);
  const fs::path out = folder.path() / "out";
  const CommandResult run =
      Rotslam({"run", sequence.string(), "--no-report", "--out=" + out.string()});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  const Trajectory held = ReadTrajectory(out / "trajectory_tum.txt");
  for (int frame = 40; frame <= 60; ++frame) {
    EXPECT_EQ(held.at(frame).center_in_world, held.at(40).center_in_world) << frame;
  }
  EXPECT_NE(held.at(30).center_in_world, held.at(40).center_in_world);
  EXPECT_NE(held.at(70).center_in_world, held.at(60).center_in_world);
}

// Pairs of views of a street fit a fisheye as well.
TEST(StreetWithoutACalibration, IsSeenThroughAPinhole) {
  const TemporaryFolder folder;
  const fs::path lens = folder.path() / "lens.yaml";
  Camera truth;
  truth.model = CameraModel::kRadtan;
  truth.width = 640;
  truth.height = 480;
  truth.fx = truth.fy = 320.0;
  truth.cx = 338.0;
  truth.cy = 229.0;
  truth.distortion = {-0.25, 0.05};
  WriteCameraYaml(lens, truth);
  const fs::path sequence = folder.path() / "street";
  const CommandResult simulated = Rotslam({"simulate",
                                           "street",
                                           "--frames=150",
                                           "--seed=1",
                                           "--camera=" + lens.string(),
                                           "--out=" + sequence.string()});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
  const fs::path out = folder.path() / "out";
  const CommandResult run =
      Rotslam({"run", sequence.string(), "--camera=none", "--no-report", "--out=" + out.string()});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  const Camera found = ReadCamera(out / "camera.yaml");
  EXPECT_EQ(found.model, CameraModel::kRadtan);
  EXPECT_NEAR(found.fx / truth.fx, 1.0, 0.003);
  EXPECT_NEAR(found.cx, truth.cx, 0.003 * truth.width);
  EXPECT_NEAR(found.cy, truth.cy, 0.003 * truth.width);
}

}  // namespace
}  // namespace rotslam
