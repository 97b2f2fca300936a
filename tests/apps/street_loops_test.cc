// Loops along a simulated street that comes back: from pictures to orientations.

#include <array>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <numbers>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

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

// Pairs of frames that are one place by the table of loops.
std::vector<std::pair<std::size_t, std::size_t>> AcceptedLoops(const fs::path& path) {
  std::vector<std::pair<std::size_t, std::size_t>> loops;
  const std::vector<std::string> lines = Lines(ReadWholeFile(path));
  for (std::size_t k = 1; k < lines.size(); ++k) {
    std::istringstream line(lines[k]);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(line, cell, ',');) cells.push_back(cell);
    if (cells.at(5) == "1") loops.emplace_back(std::stoul(cells[0]), std::stoul(cells[1]));
  }
  return loops;
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

  const auto loops = AcceptedLoops(folder.path() / "--loops" / "loops.csv");
  EXPECT_GE(loops.size(), 3U);
  const Trajectory stood = ReadTrajectory(truth);
  for (const auto& [frame, match] : loops) {
    EXPECT_GT(frame, match + 300);
    EXPECT_LT((stood.at(frame).center_in_world - stood.at(match).center_in_world).norm(), 10.0)
        << frame << " and " << match;
  }
}

}  // namespace
}  // namespace rotslam
