// `rotslam run --rotations`: orientations from elsewhere.

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/apps/run_directory.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class GivenRotations : public SmallSequenceTest {
 protected:
  static Trajectory Truth() { return ReadTrajectory(Good() / "groundtruth_tum.txt"); }

  // A TUM file of the truth, every pose changed; those with a negative time left out.
  std::string Changed(const std::function<void(StampedPose&)>& change) const {
    Trajectory poses = Truth();
    for (StampedPose& pose : poses) change(pose);
    std::erase_if(poses, [](const StampedPose& pose) { return pose.timestamp_s < 0.0; });
    WriteTumTrajectory(folder_.path() / "given.txt", poses);
    return (folder_.path() / "given.txt").string();
  }

  CommandResult RunWith(const std::string& rotations) const {
    return Run(Good(), {"--rotations", rotations});
  }
};

TEST_F(GivenRotations, CarryTheMap) {
  // The world may be any; a hundredth of a degree of noise is what an encoder has.
  const Rotation turn = Rotation::Exp({1.0, -2.0, 0.5});
  int k = 0;
  const Trajectory result = Result(RunWith(Changed([&](StampedPose& pose) {
    const double noise_rad = 0.01 * kRadFromDeg * (k++ % 3 - 1);
    pose.world_from_cam = turn * pose.world_from_cam * Rotation::Exp({noise_rad, 0.0, -noise_rad});
    pose.center_in_world = Eigen::Vector3d(5.0, 5.0, 5.0);  // not looked at
  })));
  EXPECT_LT(LargestErrorDeg(result), 0.1);
  EXPECT_LT(AngleDeg(turn.Inverse() * result[3].world_from_cam, Truth()[3].world_from_cam), 0.1);
  const TrajectoryMetrics metrics =
      Compare(Good() / "groundtruth_tum.txt", Out() / "trajectory_tum.txt");
  EXPECT_LT(metrics.ate_m.value(), 0.02 * metrics.path_length_m);
  EXPECT_GT(CountPlyPoints(Out() / "cloud.ply"), 1000);
  const nlohmann::json summary = nlohmann::json::parse(ReadWholeFile(Out() / "summary.json"));
  EXPECT_THAT(summary["sequence"]["rotations_file"].get<std::string>(), HasSubstr("given.txt"));
  EXPECT_LT(summary["rotodom"]["given_disagreement_deg"].get<double>(), 0.1);
  const std::vector<std::string> rows = Lines(ReadWholeFile(Out() / "rotations.csv"));
  for (std::size_t line = 1; line < rows.size(); ++line)
    EXPECT_THAT(rows[line], HasSubstr("given"));
}

TEST_F(GivenRotations, AreReadFromARotationsCsvAndBetweenItsTimes) {
  Result(Run(Good()));
  const fs::path csv = folder_.path() / "rotations.csv";
  fs::copy_file(Out() / "rotations.csv", csv);
  const Trajectory before = ReadTrajectory(Out() / "rotations_tum.txt");
  const std::string sigmas = Lines(ReadWholeFile(csv))[10];
  fs::remove_all(Out());
  Result(RunWith(csv.string()));
  const Trajectory after = ReadTrajectory(Out() / "rotations_tum.txt");
  for (std::size_t k = 0; k < before.size(); ++k) {
    EXPECT_LT(AngleDeg(before[k].world_from_cam, after[k].world_from_cam), 1e-8);
  }
  // Their standard deviations, too.
  const auto upto_sigmas = [](const std::string& line) {
    std::size_t end = 0;
    for (int comma = 0; comma < 9; ++comma) end = line.find(',', end + 1);
    return line.substr(0, end);
  };
  EXPECT_EQ(upto_sigmas(Lines(ReadWholeFile(Out() / "rotations.csv"))[10]), upto_sigmas(sigmas));

  // A frame that the file leaves out lies between its neighbours.
  int k = 0;
  fs::remove_all(Out());
  const Trajectory between = Result(
      RunWith(Changed([&](StampedPose& pose) { pose.timestamp_s *= k++ == 7 ? -1.0 : 1.0; })));
  EXPECT_LT(LargestErrorDeg(between), 0.3);
}

TEST_F(GivenRotations, OfAnotherConventionAreRefusedByItsName) {
  EXPECT_THAT(Refusal(RunWith(Changed(
                  [](StampedPose& pose) { pose.world_from_cam = pose.world_from_cam.Inverse(); }))),
              AllOf(HasSubstr("given.txt: "), HasSubstr("taken for world->camera by")));
  const auto put_w_first = [](StampedPose& pose) {
    const Eigen::Quaterniond& q = pose.world_from_cam.Quaternion();
    pose.world_from_cam = Rotation(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()));
  };
  EXPECT_THAT(Refusal(RunWith(Changed(put_w_first))), HasSubstr("with qw in front by"));
  const Rotation cam_from_imu = Rotation::Exp({0.0, 0.0, 1.5});
  EXPECT_THAT(Refusal(RunWith(Changed([&](StampedPose& pose) {
                pose.world_from_cam = pose.world_from_cam * cam_from_imu;
              }))),
              HasSubstr("another sensor's axes"));
}

TEST_F(GivenRotations, MustBeThereForEveryFrame) {
  int k = 0;
  EXPECT_THAT(Refusal(RunWith(Changed([&](StampedPose& pose) {
                if (k++ >= 10) pose.timestamp_s = -1.0;
              }))),
              HasSubstr("14 of the 24 frames, the first being frame 10"));
  EXPECT_THAT(Refusal(RunWith(Changed([](StampedPose& pose) { pose.timestamp_s += 1000.0; }))),
              HasSubstr("24 of the 24 frames, the first being frame 0"));
}

TEST_F(GivenRotations, MustBeWellFormed) {
  const auto refusal = [&](const std::string& text) {
    return Refusal(RunWith(folder_.Write("given.txt", text).string()));
  };
  EXPECT_THAT(refusal("0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 2\n"),
              HasSubstr("given.txt:2: the quaternion is not of length 1"));
  EXPECT_THAT(refusal("0 0 0 0 0 0 0 nan\n"),
              HasSubstr("given.txt: has no poses: all are marked as lost"));
  EXPECT_THAT(refusal("0 0 0 1\n"), HasSubstr("expected 8 columns (TUM)"));
  EXPECT_THAT(refusal("# nothing\n"), HasSubstr("given.txt: has no orientations"));
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n"), HasSubstr("has no orientation for"));
  const std::string header =
      "frame,timestamp,qx,qy,qz,qw,sigma_x_deg,sigma_y_deg,sigma_z_deg,inlier_edges,flags\n";
  EXPECT_THAT(refusal(header + "0,0,0,0,0,1,,,,3\n"),
              HasSubstr("given.txt:2: expected 11 columns, found 10"));
  EXPECT_THAT(refusal(header + "0,0,0,0,0,1,-1,0,0,3,\n"), HasSubstr("is negative"));
  EXPECT_THAT(Refusal(RunWith("nowhere.txt")), HasSubstr("nowhere.txt: No such file"));
}

}  // namespace
}  // namespace rotslam
