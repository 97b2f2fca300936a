// `rotslam run` with every layout and camera model, and its promise of the same bytes every time.

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/camera/read_camera.h"
#include "tests/apps/run_directory.h"
#include "tests/apps/unknown_readout.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

using testing::HasSubstr;

class RunVariants : public testing::Test {
 protected:
  // Renders 45 frames of a walk through the room.
  fs::path Simulate(const std::vector<std::string>& more,
                    const std::string& kind = "handheld") const {
    const fs::path sequence = folder_.path() / "sequence";
    const CommandResult result =
        Rotslam({"simulate", kind, "--frames=45", "--out=" + sequence.string()}, more);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return sequence;
  }

  fs::path Run(const fs::path& sequence,
               const std::string& name,
               const std::vector<std::string>& more = {}) const {
    const fs::path out = folder_.path() / name;
    const CommandResult result =
        Rotslam({"run", sequence.string(), "--no-report", "--out=" + out.string()}, more);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return out;
  }

  // Bands of three times what was measured when they were set.
  static void ExpectGood(const fs::path& sequence, const fs::path& out) {
    EXPECT_EQ(ReadTrajectory(out / "trajectory_tum.txt").size(), 45u);
    const TrajectoryMetrics metrics =
        Compare(sequence / "groundtruth_tum.txt", out / "trajectory_tum.txt");
    EXPECT_LT(metrics.rpe1_deg, 0.06);
    ASSERT_TRUE(metrics.ate_m.has_value());
    EXPECT_LT(*metrics.ate_m, 0.01 * metrics.path_length_m);
    EXPECT_GT(CountPlyPoints(out / "cloud.ply"), 1500);
    RecordProperty("rpe1_deg", std::to_string(metrics.rpe1_deg));
    RecordProperty("ate_ratio", std::to_string(*metrics.ate_m / metrics.path_length_m));
  }

  const TemporaryFolder folder_;
};

TEST_F(RunVariants, EurocLayout) {
  const fs::path sequence = Simulate({"--layout=euroc", "--width=320", "--height=240"});
  ExpectGood(sequence, Run(sequence, "out"));
}

TEST_F(RunVariants, Colour) {
  const fs::path sequence = Simulate({"--color", "--width=320", "--height=240"});
  ExpectGood(sequence, Run(sequence, "out"));
}

TEST_F(RunVariants, RadtanCamera) {
  const std::string camera = folder_
                                 .Write("radtan.yaml",
                                        "model: radtan\nwidth: 376\nheight: 240\n"
                                        "fx: 229.3\nfy: 228.6\ncx: 183.6\ncy: 124.2\n"
                                        "distortion: [-0.283, 0.0739, 0.00019, 1.76e-5, 0]\n")
                                 .string();
  const fs::path sequence = Simulate({"--camera", camera});
  ExpectGood(sequence, Run(sequence, "out", {"--camera", camera}));
}

TEST_F(RunVariants, EquidistantCamera) {
  const std::string camera = folder_
                                 .Write("equidistant.yaml",
                                        "model: equidistant\nwidth: 320\nheight: 320\n"
                                        "fx: 120.1\nfy: 120.3\ncx: 159.1\ncy: 160.6\n"
                                        "distortion: [0.0034, 0.00077, -0.0018, 0.0004]\n")
                                 .string();
  const fs::path sequence = Simulate({"--camera", camera});
  ExpectGood(sequence, Run(sequence, "out", {"--camera", camera}));
}

TEST_F(RunVariants, RollingShutter) {
  const fs::path sequence =
      Simulate({"--readout=0.025", "--speed-scale=2", "--width=320", "--height=240"});
  ExpectGood(sequence, Run(sequence, "out"));
}

TEST_F(RunVariants, RollingShutterThatTheCameraFileDoesNotTellOf) {
  const fs::path sequence = folder_.path() / "sequence";
  ASSERT_NO_FATAL_FAILURE(SimulateUnknownReadout(sequence));
  for (const std::string command : {"run", "rotations"}) {
    SCOPED_TRACE(command);
    const fs::path out = folder_.path() / command;
    const CommandResult result =
        Rotslam({command, sequence.string(), "--no-report", "--out=" + out.string()});
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.error, HasSubstr("starts again from the first frame with readout_s: 0.02"));
    const auto summary = ReadSummary(out);
    EXPECT_NEAR(summary["readout"]["readout_s"].get<double>(), 0.025, 0.002);
    EXPECT_EQ(summary["readout"]["source"], "images");
    EXPECT_EQ(summary["camera"]["readout_s"], summary["readout"]["readout_s"]);
  }
  ExpectGood(sequence, folder_.path() / "run");
}

TEST_F(RunVariants, AsksForNoReadoutWhereTheCameraFileTellsIt) {
  const fs::path sequence = Simulate({"--width=320", "--height=240"});
  EXPECT_TRUE(ReadCamera(sequence / "camera.yaml").knows_readout);
  EXPECT_FALSE(ReadSummary(Run(sequence, "out")).contains("readout"));
}

TEST_F(RunVariants, SameBytesEveryTimeAndAtAnyNumberOfThreads) {
  for (const std::string kind : {"gimbal", "handheld"}) {
    SCOPED_TRACE(kind);
    fs::remove_all(folder_.path() / "sequence");
    const fs::path sequence = Simulate({"--width=320", "--height=240"}, kind);
    const fs::path first = Run(sequence, kind + "_1", {"--threads=1"});
    for (const std::string threads : {"1", "2", "4"}) {
      SCOPED_TRACE(threads + " threads");
      const fs::path again = Run(sequence, kind + "_again", {"--threads=" + threads});
      ExpectSameRun(first, again);
    }
  }
}

TEST_F(RunVariants, AnotherSeedIsAsGood) {
  const fs::path sequence = Simulate({"--width=320", "--height=240"});
  ExpectGood(sequence, Run(sequence, "out", {"--seed=77"}));
}

}  // namespace
}  // namespace rotslam
