#include <filesystem>
#include <string>

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

TEST_F(LiveTest, RefusesWhatItCannotDo) {
  const std::string camera = "--camera=" + (Good() / "camera.yaml").string();
  EXPECT_THAT(Rotslam({"live", "/dev/null"}).error, HasSubstr("calibration"));
  EXPECT_THAT(Rotslam({"live", "-", camera, "--last=3"}).error, HasSubstr("for files"));
  EXPECT_THAT(Rotslam({"live", "-", camera}, "echo rubbish |", "").error,
              HasSubstr("standard input: no image came"));
}

}  // namespace
}  // namespace rotslam
