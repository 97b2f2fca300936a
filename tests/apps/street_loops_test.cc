// Loops along a simulated street that comes back: from pictures to orientations.

#include <array>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "output/loops_csv.h"
#include "tests/apps/run_directory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// A lap and a seventh around a block of 110 m x 70 m with rounded corners, as a KITTI pose file.
std::string RoundABlock() {
  constexpr double kStep = 0.9;  // metres a frame
  constexpr int kNumFrames = 438;
  constexpr int kCorner = 18;  // frames
  constexpr std::array<int, 4> kSides = {100, 55, 100, 55};
  std::vector<double> turns;
  for (const int side : kSides) {
    turns.insert(turns.end(), side, 0.0);
    turns.insert(turns.end(), kCorner, 0.5 * std::numbers::pi / kCorner);
  }
  std::ostringstream poses;
  poses << std::setprecision(9);
  double x = 0.0;
  double z = 0.0;
  double heading = 0.0;
  for (int frame = 0; frame < kNumFrames; ++frame) {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    poses << c << " 0 " << s << " " << x << " 0 1 0 0 " << -s << " 0 " << c << " " << z << "\n";
    const double turn = turns[frame % turns.size()];
    x += kStep * std::sin(heading + 0.5 * turn);
    z += kStep * std::cos(heading + 0.5 * turn);
    heading += turn;
  }
  return poses.str();
}

TEST(StreetRoundABlock, LoopsTakeDriftAwayAndNoneIsFalse) {
  const TemporaryFolder folder;
  const fs::path sequence = folder.path() / "street";
  const fs::path poses = folder.Write("poses.txt", RoundABlock());
  const CommandResult simulated = Rotslam({"simulate",
                                           "street",
                                           "--poses=" + poses.string(),
                                           "--width=256",
                                           "--height=80",
                                           "--hfov-deg=80",
                                           "--out=" + sequence.string()});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
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

}  // namespace
}  // namespace rotslam
