// Images that `rotslam run` reduces: what it leaves fits the original ones.

#include <algorithm>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/export/known_rotation_file.h"
#include "output/map/run_map.h"
#include "rotodom/camera/read_camera.h"
#include "tests/apps/run_directory.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kScale = 4.0 / 7.0;

class WorkingSizeOfRuns : public SmallSequenceTest {
 protected:
  // Lets images of 320 x 240 pixels be worked with at 180 x 136.
  std::string Config() const {
    return folder_.Write("small.yaml", "max_image_side_px: 200\n").string();
  }
};

TEST_F(WorkingSizeOfRuns, IsSaidAndResultsFitTheOriginalImages) {
  const CommandResult result = Rotslam(
      {"run", Good().string(), "--config", Config(), "--no-report", "--out", Out().string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.output + result.error, HasSubstr("images are 320x240; worked at 180x136"));
  const auto summary = ReadSummary(Out());
  EXPECT_DOUBLE_EQ(summary.at("sequence").at("working_scale").get<double>(), kScale);
  const Camera given = ReadCamera(Good() / "camera.yaml");
  EXPECT_EQ(summary.at("camera").at("width"), 320);
  EXPECT_EQ(summary.at("camera").at("fx").get<double>(), given.fx);

  const RunMap map = ReadRunMap(Out() / "map.bin");
  EXPECT_EQ(map.camera.width, 320);
  EXPECT_EQ(map.num_levels, 8 + 3) << "three levels of 1.2 lie below the reduced images";
  double largest_x = 0.0;
  for (const MapTrack& entry : map.tracks) {
    for (const Observation& seen : entry.track.observations) {
      largest_x = std::max(largest_x, seen.keypoint_px.x());
    }
    for (const int level : entry.levels) EXPECT_LT(level, map.num_levels);
  }
  EXPECT_GT(largest_x, 280.0);
  EXPECT_LT(largest_x, 320.0);

  const KnownRotationInput problem = ReadKnownRotation(Out() / "known_rotation.txt");
  EXPECT_EQ(problem.camera.fx, given.fx);
}

TEST_F(WorkingSizeOfRuns, IsThatOfSolve) {
  const CommandResult run = Run(Good(), {"--config", Config()});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  const fs::path solved = folder_.path() / "solved";
  const CommandResult solve = Rotslam({"solve",
                                       (Out() / "known_rotation.txt").string(),
                                       "--config",
                                       Config(),
                                       "--quiet",
                                       "--out",
                                       solved.string()});
  ASSERT_EQ(solve.exit_code, 0) << solve.error;
  const double of_run = ReadSummary(Out()).at("krot").at("gamma_high_px").get<double>();
  const double of_solve = ReadSummary(solved).at("krot").at("gamma_high_px").get<double>();
  EXPECT_NEAR(of_solve / of_run, 1.0, 0.05);
}

}  // namespace
}  // namespace rotslam
