// `rotslam rotations --method paper`.

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class PaperCommand : public SmallSequenceTest {
 protected:
  CommandResult Rotations(const fs::path& out, const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"rotations",
                                          Good().string(),
                                          "--out",
                                          out.string(),
                                          "--last",
                                          "7",
                                          "--no-report",
                                          "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Rotslam(arguments);
  }
};

TEST_F(PaperCommand, WritesWhatRotationsWrites) {
  const CommandResult result = Rotations(Out(), {"--method", "paper"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(ReadTrajectory(Out() / "rotations_tum.txt").size(), 8U);
  for (const char* file : {"rotations.csv", "loops.csv", "view_graph.g2o"}) {
    EXPECT_TRUE(fs::exists(Out() / file)) << file;
  }
  const auto summary = nlohmann::json::parse(ReadWholeFile(Out() / "summary.json"));
  EXPECT_EQ(summary["options"]["method"], "paper");
  EXPECT_EQ(summary["options"]["rotodom"]["features"]["max_features"], 4000);
}

// config/paper.yaml says what the method starts from, and threads change nothing.
TEST_F(PaperCommand, SaysInItsConfigurationWhatItDoes) {
  const fs::path without = Out() / "without";
  const fs::path with = Out() / "with";
  const fs::path config = fs::path(ROTSLAM_CONFIG_DIR) / "paper.yaml";
  ASSERT_EQ(Rotations(without, {"--method", "paper", "--threads", "1"}).exit_code, 0);
  ASSERT_EQ(Rotations(with, {"--method", "paper", "--threads", "3", "--config", config.string()})
                .exit_code,
            0);
  for (const char* file : {"rotations_tum.txt", "rotations.csv", "loops.csv", "view_graph.g2o"}) {
    EXPECT_EQ(ReadWholeFile(without / file), ReadWholeFile(with / file)) << file;
  }
  const auto options = [](const fs::path& run) {
    auto summary = nlohmann::json::parse(ReadWholeFile(run / "summary.json"));
    return summary["options"];
  };
  EXPECT_EQ(options(without), options(with));
}

TEST_F(PaperCommand, IsNotTheDefault) {
  const fs::path ours = Out() / "ours";
  const fs::path default_run = Out() / "default";
  ASSERT_EQ(Rotations(ours, {"--method", "ours"}).exit_code, 0);
  ASSERT_EQ(Rotations(default_run, {}).exit_code, 0);
  EXPECT_EQ(ReadWholeFile(ours / "rotations_tum.txt"),
            ReadWholeFile(default_run / "rotations_tum.txt"));
  EXPECT_THAT(ReadWholeFile(ours / "summary.json"), testing::Not(HasSubstr("\"method\"")));
}

TEST_F(PaperCommand, RefusesInOneLine) {
  EXPECT_THAT(Refusal(Rotations(Out(), {"--method", "wrong"})),
              AllOf(HasSubstr("--method"), HasSubstr("wrong")));
  EXPECT_THAT(Refusal(Rotations(Out(), {"--method", "paper", "--resume"})),
              AllOf(HasSubstr("--method paper"), HasSubstr("--resume")));
}

}  // namespace
}  // namespace rotslam
