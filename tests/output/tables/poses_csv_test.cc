#include "output/tables/poses_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

PoseRow UnplacedRow(int frame) {
  PoseRow row;
  row.frame = frame;
  row.pose.timestamp_s = 0.1 * frame;
  return row;
}

TEST(PosesCsv, ReadsWhatItHasWritten) {
  PoseRow measured = UnplacedRow(0);
  measured.pose.world_from_cam = Rotation::Exp({0.1, -0.2, 0.3});
  measured.pose.center_in_world = {1.0, 2.5, -3.0};
  measured.sigma.emplace(0.25, 0.5, 0.125);
  measured.state = PoseState::kMeasured;
  measured.component = 2;
  PoseRow unplaced = UnplacedRow(1);
  unplaced.note = "matches no frame of the map";
  const TemporaryFolder folder;
  WritePosesCsv(folder.path() / "poses.csv", {measured, unplaced});
  const std::vector<PoseRow> read = ReadPosesCsv(folder.path() / "poses.csv");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].frame, 0);
  EXPECT_LT((read[0].pose.world_from_cam * measured.pose.world_from_cam.Inverse()).Angle(), 1e-9);
  EXPECT_EQ(read[0].pose.center_in_world, measured.pose.center_in_world);
  ASSERT_TRUE(read[0].sigma.has_value());
  EXPECT_EQ(*read[0].sigma, *measured.sigma);
  EXPECT_EQ(read[0].state, PoseState::kMeasured);
  EXPECT_EQ(read[0].component, 2);
  EXPECT_EQ(read[1].pose.timestamp_s, 0.1);
  EXPECT_FALSE(read[1].sigma.has_value());
  EXPECT_EQ(read[1].state, PoseState::kUnplaced);
  EXPECT_EQ(read[1].component, -1);
  EXPECT_EQ(read[1].note, unplaced.note);
}

TEST(PosesCsv, RefusesStatesThatItDoesNotKnow) {
  const TemporaryFolder folder;
  const auto path = folder.Write("poses.csv", "header\n0,0,0,0,0,0,0,0,1,,,,guessed,0,\n");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadPosesCsv(path); }), HasSubstr("poses.csv:2: \"guessed\""));
}

TEST(PosesCsv, RefusesNotesThatBreakTheLine) {
  PoseRow row = UnplacedRow(0);
  row.note = "one, two";
  const TemporaryFolder folder;
  EXPECT_THROW(WritePosesCsv(folder.path() / "poses.csv", {row}), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
