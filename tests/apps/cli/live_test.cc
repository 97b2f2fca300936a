#include <atomic>
#include <filesystem>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

using testing::HasSubstr;

class LiveTest : public SmallSequenceTest {
 protected:
  // A session on all images at once, through a pipe.
  CommandResult LiveFromPipe(const std::string& flag) const {
    const std::string setup = "cat " + Quoted((Good() / "rgb").string()) + "/*.png |";
    return Rotslam({"live",
                    "-",
                    "--camera=" + (Good() / "camera.yaml").string(),
                    "--fps=30",
                    "--no-report",
                    "--out=" + Out().string(),
                    flag},
                   setup,
                   "");
  }
};

// Frames that a session left out have their places among those that it took: the images of the map
// must be those of its poses.
TEST_F(LiveTest, EndsWithTheResultOfRunAlsoWhereFramesWereLeftOut) {
  for (const std::string flag : {"--wait", "--drop"}) {
    const CommandResult live = LiveFromPipe(flag);
    ASSERT_EQ(live.exit_code, 0) << flag << live.error;
    const fs::path run = folder_.path() / ("run" + flag);
    const CommandResult expected = Rotslam({"run",
                                            (Out() / "frames").string(),
                                            "--camera=" + (Good() / "camera.yaml").string(),
                                            "--no-report",
                                            "--out=" + run.string()});
    ASSERT_EQ(expected.exit_code, 0) << expected.error;
    for (const char* file : {"trajectory_tum.txt", "cloud.ply", "map.bin"}) {
      EXPECT_TRUE(ReadWholeFile(Out() / file) == ReadWholeFile(run / file)) << flag << file;
    }
  }
}

// Poses as emitted are the same bytes where another program keeps the other core busy.
TEST_F(LiveTest, EmitsTheSameBytesOnABusyMachine) {
  ASSERT_EQ(LiveFromPipe("--wait").exit_code, 0);
  const std::string expected = ReadWholeFile(Out() / "live_trajectory_tum.txt");
  ASSERT_GT(expected.size(), 500U);
  std::atomic<bool> is_over = false;
  std::thread other([&] {
    while (!is_over) {
    }
  });
  const CommandResult busy = LiveFromPipe("--wait");
  is_over = true;
  other.join();
  ASSERT_EQ(busy.exit_code, 0) << busy.error;
  EXPECT_TRUE(ReadWholeFile(Out() / "live_trajectory_tum.txt") == expected);
}

TEST_F(LiveTest, RefusesWhatItCannotDo) {
  const std::string camera = "--camera=" + (Good() / "camera.yaml").string();
  EXPECT_THAT(Rotslam({"live", "/dev/null"}).error, HasSubstr("calibration"));
  EXPECT_THAT(Rotslam({"live", "-", camera, "--last=3"}).error, HasSubstr("for files"));
  EXPECT_THAT(Rotslam({"live", "-", camera}, "echo rubbish |", "").error,
              HasSubstr("standard input: no image came"));
}

}  // namespace
}  // namespace rotslam
