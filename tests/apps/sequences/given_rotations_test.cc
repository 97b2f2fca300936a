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
  const nlohmann::json& given = summary["rotodom"]["given"];
  EXPECT_LT(given["disagreement_deg"].get<double>(), 0.1);
  EXPECT_FALSE(given["aligned"].get<bool>());
  EXPECT_FALSE(given["has_mounting"].get<bool>());
  EXPECT_EQ(given["frames_of_both"].get<int>(), kNumFrames);
  const std::vector<std::string> rows = Lines(ReadWholeFile(Out() / "rotations.csv"));
  for (std::size_t line = 1; line < rows.size(); ++line)
    EXPECT_THAT(rows[line], HasSubstr(",images|given"));
}

TEST_F(GivenRotations, AreReadFromARotationsCsvAndBetweenItsTimes) {
  Result(Run(Good()));
  const fs::path csv = folder_.path() / "rotations.csv";
  fs::copy_file(Out() / "rotations.csv", csv);
  const Trajectory before = ReadTrajectory(Out() / "rotations_tum.txt");
  fs::remove_all(Out());
  Result(RunWith(csv.string()));
  const Trajectory after = ReadTrajectory(Out() / "rotations_tum.txt");
  for (std::size_t k = 0; k < before.size(); ++k) {
    EXPECT_LT(AngleDeg(before[k].world_from_cam, after[k].world_from_cam), 1e-8);
  }

  // A frame that the file leaves out is filled by the images.
  int k = 0;
  fs::remove_all(Out());
  const Trajectory between = Result(
      RunWith(Changed([&](StampedPose& pose) { pose.timestamp_s *= k++ == 7 ? -1.0 : 1.0; })));
  EXPECT_LT(LargestErrorDeg(between), 0.1);
}

TEST_F(GivenRotations, AreAlignedInTimeAndWithTheCamera) {
  const Rotation cam_from_sensor = Rotation::Exp({0.02, -0.025, 0.01});
  const std::string file = Changed([&](StampedPose& pose) {
    pose.world_from_cam = pose.world_from_cam * cam_from_sensor;
    pose.timestamp_s += 0.04;
  });
  const CommandResult unaligned = RunWith(file);
  EXPECT_THAT(unaligned.error, AllOf(HasSubstr("late"), HasSubstr("--align takes that out")));
  EXPECT_LT(LargestErrorDeg(Result(unaligned)), 0.1);
  fs::remove_all(Out());
  EXPECT_LT(LargestErrorDeg(Result(Run(Good(), {"--rotations", file, "--align"}))), 0.1);
  const nlohmann::json summary = nlohmann::json::parse(ReadWholeFile(Out() / "summary.json"));
  const nlohmann::json& given = summary["rotodom"]["given"];
  EXPECT_TRUE(given["aligned"].get<bool>());
  EXPECT_NEAR(given["offset_s"].get<double>(), 0.04, 0.002);
  EXPECT_NEAR(given["offset_s"].get<double>(), 0.04, 5.0 * given["offset_sigma_s"].get<double>());
  EXPECT_NEAR(given["mounting_x_deg"].get<double>(), 0.02 * kDegFromRad, 0.3);
  EXPECT_GT(Run(Good(), {"--align"}).exit_code, 0);
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
  // Mounted wrong and late, too, with or without --align.
  const auto mount = [](StampedPose& pose) {
    pose.world_from_cam = pose.world_from_cam * Rotation::Exp({0.4, -0.5, 0.2});
    pose.timestamp_s += 0.04;
  };
  const std::string inverted = Changed([&](StampedPose& pose) {
    mount(pose);
    pose.world_from_cam = pose.world_from_cam.Inverse();
  });
  const auto says =
      AllOf(HasSubstr("given.txt: "), HasSubstr("taken for world->camera, and turned"));
  EXPECT_THAT(Refusal(RunWith(inverted)), says);
  EXPECT_THAT(Refusal(Run(Good(), {"--rotations", inverted, "--align"})), says);
  EXPECT_THAT(Refusal(RunWith(Changed([&](StampedPose& pose) {
                mount(pose);
                put_w_first(pose);
              }))),
              HasSubstr("with qw in front, and turned"));
}

TEST_F(GivenRotations, MayCoverPartOfTheFrames) {
  int k = 0;
  EXPECT_LT(LargestErrorDeg(Result(RunWith(Changed([&](StampedPose& pose) {
              if (k++ >= 10) pose.timestamp_s = -1.0;
            })))),
            0.1);
  const std::vector<std::string> rows = Lines(ReadWholeFile(Out() / "rotations.csv"));
  EXPECT_THAT(rows[1 + 9], HasSubstr(",images|given"));
  EXPECT_THAT(rows[1 + 10], AllOf(HasSubstr(",images"), testing::Not(HasSubstr("given"))));
  fs::remove_all(Out());
  EXPECT_THAT(Refusal(RunWith(Changed([](StampedPose& pose) { pose.timestamp_s += 1000.0; }))),
              HasSubstr("for fewer than 3 of the 24 frames"));
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
  EXPECT_THAT(refusal("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n"),
              HasSubstr("for fewer than 3 of the 24 frames"));
  const std::string header =
      "frame,timestamp,qx,qy,qz,qw,sigma_x_deg,sigma_y_deg,sigma_z_deg,inlier_edges,flags\n";
  EXPECT_THAT(refusal(header + "0,0,0,0,0,1,,,,3\n"),
              HasSubstr("given.txt:2: expected 11 columns, found 10"));
  EXPECT_THAT(refusal(header + "0,0,0,0,0,1,-1,0,0,3,\n"), HasSubstr("is negative"));
  EXPECT_THAT(Refusal(RunWith("nowhere.txt")), HasSubstr("nowhere.txt: No such file"));
}

}  // namespace
}  // namespace rotslam
