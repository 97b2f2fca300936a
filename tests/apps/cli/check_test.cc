#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/tables/poses_csv.h"
#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// A run's folder with ten frames, of which the first `num_unplaced` have no place.
class CheckCommand : public testing::Test {
 protected:
  CommandResult Check(int num_unplaced) const {
    folder_.Write("summary.json",
                  R"({"command": "run", "sequence": {"path": "walk"}, "camera": {},
                      "counts": {"frames": 10, "keyframes": 5},
                      "ba": {"observations": 5000, "mean_error_px": 0.3}})");
    std::vector<PoseRow> rows(10);
    for (int n = 0; n < 10; ++n) {
      rows[n].frame = n;
      rows[n].state = n < num_unplaced ? PoseState::kUnplaced : PoseState::kMeasured;
    }
    WritePosesCsv(folder_.path() / "poses.csv", rows);
    return Rotslam({"check", folder_.path().string()});
  }

  TemporaryFolder folder_;
};

TEST_F(CheckCommand, TellsScriptsByItsExitCode) {
  const CommandResult green = Check(0);
  EXPECT_EQ(green.exit_code, 0);
  EXPECT_THAT(green.output, StartsWith("green"));
  const CommandResult look_at = Check(3);
  EXPECT_EQ(look_at.exit_code, 3);
  EXPECT_THAT(look_at.output, StartsWith("look at: 1 reason\nlook at: frames 0-2: "));
  const CommandResult do_not_use = Check(8);
  EXPECT_EQ(do_not_use.exit_code, 4);
  EXPECT_THAT(do_not_use.output, StartsWith("do not use"));
}

TEST_F(CheckCommand, RefusesFoldersThatAreNoRuns) {
  const CommandResult result = Rotslam({"check", folder_.path().string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr("summary.json: cannot be read"));
}

}  // namespace
}  // namespace rotslam
