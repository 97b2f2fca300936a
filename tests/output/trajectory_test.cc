#include "output/trajectory.h"

#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

Trajectory RandomTrajectory(int num_poses) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-3.0, 3.0);
  Trajectory trajectory;
  for (int k = 0; k < num_poses; ++k) {
    const auto random_vector = [&] {
      return Eigen::Vector3d(uniform(generator), uniform(generator), uniform(generator));
    };
    trajectory.push_back(
        {1.4e9 + 0.05 * k, Rotation::Exp(random_vector()), 100.0 * random_vector()});
  }
  return trajectory;
}

void ExpectNear(const Trajectory& a, const Trajectory& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_LT((a[k].world_from_cam.Inverse() * b[k].world_from_cam).Angle(), tolerance);
    EXPECT_LT((a[k].center_in_world - b[k].center_in_world).norm(), 300.0 * tolerance);
  }
}

TEST(Trajectory, ComesBackFromTum) {
  const TemporaryFolder folder;
  const Trajectory written = RandomTrajectory(20);
  WriteTumTrajectory(folder.path() / "t.txt", written);
  const Trajectory read = ReadTrajectory(folder.path() / "t.txt");
  ExpectNear(written, read, 1e-11);
  for (std::size_t k = 0; k < read.size(); ++k) {
    EXPECT_EQ(read[k].timestamp_s, written[k].timestamp_s);
  }
}

TEST(Trajectory, KeepsNanoseconds) {
  const TemporaryFolder folder;
  WriteTumTrajectory(folder.path() / "t.txt", {{123.456789012, {}, Eigen::Vector3d::Zero()}});
  EXPECT_EQ(ReadTrajectory(folder.path() / "t.txt")[0].timestamp_s, 123.456789012);
}

TEST(Trajectory, ComesBackFromKittiWithItsTimes) {
  const TemporaryFolder folder;
  const Trajectory written = RandomTrajectory(3);
  WriteKittiTrajectory(folder.path() / "t.txt", written);
  const auto times = folder.Write("times.txt", "0.5\n1.5\n4e1\n99\n");
  const Trajectory read = ReadTrajectory(folder.path() / "t.txt", times);
  ExpectNear(written, read, 1e-11);
  EXPECT_EQ(read[2].timestamp_s, 40.0);
  EXPECT_EQ(ReadTrajectory(folder.path() / "t.txt")[2].timestamp_s, 2.0);
}

TEST(Trajectory, ReadsCommasCommentsAndDisorder) {
  const TemporaryFolder folder;
  const auto path = folder.Write(
      "t.txt", "# timestamp tx ..\n\n2.0, 1,2,3, 0,0,0,1\r\n  # x\n1.0 4 5 +6 0 0 0.2 0\n");
  const Trajectory read = ReadTrajectory(path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].timestamp_s, 1.0);
  EXPECT_EQ(read[0].center_in_world, Eigen::Vector3d(4, 5, 6));
  EXPECT_NEAR(read[0].world_from_cam.AngleDeg(), 180.0, 1e-9);
  EXPECT_EQ(read[1].center_in_world, Eigen::Vector3d(1, 2, 3));
}

TEST(Trajectory, NamesTheLineThatIsWrong) {
  const TemporaryFolder folder;
  const auto error_of = [&](const std::string& content) {
    const auto path = folder.Write("t.txt", content);
    return RuntimeErrorOf([&] { ReadTrajectory(path); });
  };
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n"), HasSubstr("t.txt:2: "));
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 1\n2 1e999 0 0 0 0 0 1\n"), HasSubstr("t.txt:2: "));
  EXPECT_THAT(error_of("#\n1 0 0 0 0 0 0 one\n"), HasSubstr("t.txt:2: expected a finite number"));
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 1\n2 0 0 0\n"), HasSubstr("t.txt:2: expected 8 columns"));
  EXPECT_THAT(error_of("1 2 3\n"), HasSubstr("t.txt:1: expected 8 columns (TUM) or 12 (KITTI)"));
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 0\n"), HasSubstr("t.txt:1: "));
  EXPECT_THAT(error_of("2 0 0 0 0 1 0 0 0 0 1 0\n"), HasSubstr("t.txt:1: "));
  EXPECT_THAT(error_of("# nothing\n"), HasSubstr("has no poses"));
}

TEST(Trajectory, RefusesWhatIsNoFileAndTooFewTimes) {
  const TemporaryFolder folder;
  EXPECT_THAT(RuntimeErrorOf([&] { ReadTrajectory(folder.path() / "none.txt"); }),
              HasSubstr("none.txt"));
  EXPECT_THAT(RuntimeErrorOf([&] { ReadTrajectory(folder.path()); }), HasSubstr("is a folder"));
  WriteKittiTrajectory(folder.path() / "t.txt", RandomTrajectory(3));
  const auto times = folder.Write("times.txt", "0\n1\n");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadTrajectory(folder.path() / "t.txt", times); }),
              HasSubstr("has 2 timestamps for the 3 poses"));
}

TEST(Trajectory, IsNotWrittenWhenNotFinite) {
  const TemporaryFolder folder;
  Trajectory trajectory = RandomTrajectory(2);
  trajectory[1].center_in_world.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(WriteTumTrajectory(folder.path() / "t.txt", trajectory), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "t.txt"));
}

}  // namespace
}  // namespace rotslam
