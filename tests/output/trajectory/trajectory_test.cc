#include "output/trajectory/trajectory.h"

#include <algorithm>
#include <limits>
#include <random>
#include <sstream>
#include <string>

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
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 1\nnan 0 0 0 0 0 0 1\n"), HasSubstr("t.txt:2: "));
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 1\n2 1e999 0 0 0 0 0 1\n"), HasSubstr("t.txt:2: "));
  EXPECT_THAT(error_of("#\n1 0 0 0 0 0 0 one\n"), HasSubstr("t.txt:2: expected a finite number"));
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 1\n2 0 0 0\n"), HasSubstr("t.txt:2: expected 8 columns"));
  EXPECT_THAT(error_of("1 2 3\n"), HasSubstr("t.txt:1: expected 8 columns (TUM) or 12 (KITTI)"));
  EXPECT_THAT(error_of("1 0 0 0 0 0 0 0\n"), HasSubstr("has no poses: all are marked as lost"));
  EXPECT_THAT(error_of("1 0 0.6 0 0.8 0 1 7\n"), HasSubstr("columns 2 to 5 are: name them"));
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

// Poses without symmetries, for the forms below.
constexpr const char* kTumLines =
    "1403636579.763555527 1 2 3 0.1 0.2 0.3 0.9273618495495704\n"
    "1403636579.813555479 1.5 2 3 0.2 0.2 0.3 0.9110433579144299\n"
    "1403636579.863555431 2 2 3 0.3 0.2 0.3 0.8831760866327848\n";

class TrajectoryForms : public testing::Test {
 protected:
  TrajectoryFile Read(const std::string& content, const std::string& name = "t.txt") const {
    return ReadTrajectoryFile(folder_.Write(name, content));
  }
  Trajectory Expected() const { return Read(kTumLines).poses; }
  void ExpectTheSame(const TrajectoryFile& file, bool has_times = true) const {
    const Trajectory expected = Expected();
    ExpectNear(expected, file.poses, 1e-5);
    for (std::size_t k = 0; k < file.poses.size(); ++k) {
      EXPECT_NEAR(file.poses[k].timestamp_s,
                  has_times ? expected[k].timestamp_s : static_cast<double>(k),
                  1e-6);
    }
    EXPECT_EQ(file.has_times, has_times);
  }
  static std::string Replaced(std::string text, char from, char to) {
    std::replace(text.begin(), text.end(), from, to);
    return text;
  }
  const TemporaryFolder folder_;
};

TEST_F(TrajectoryForms, TumWithWhateverSeparates) {
  EXPECT_THAT(Read(kTumLines).notes, testing::IsEmpty());
  EXPECT_EQ(Read(kTumLines).form, "TUM");
  ExpectTheSame(Read(Replaced(kTumLines, ' ', ',')));
  ExpectTheSame(Read(Replaced(kTumLines, ' ', ';')));
  ExpectTheSame(Read(Replaced(kTumLines, ' ', '\t')));
  const TrajectoryFile commas = Read(Replaced(kTumLines, '.', ','));
  ExpectTheSame(commas);
  EXPECT_THAT(commas.notes, testing::ElementsAre(HasSubstr("taken for decimal points")));
  ExpectTheSame(Read("\xef\xbb\xbf# x\r\n" + std::string(kTumLines)));
  const TrajectoryFile named = Read("timestamp tx ty tz qx qy qz qw\n" + std::string(kTumLines));
  ExpectTheSame(named);
  EXPECT_FALSE(named.is_order_assumed);
}

TEST_F(TrajectoryForms, ANinthColumnIsAnIndexOrAConstant) {
  std::string indexed;
  std::string trailing;
  int index = 0;
  std::istringstream lines(kTumLines);
  for (std::string line; std::getline(lines, line);) {
    indexed += std::to_string(index++) + ' ' + line + '\n';
    trailing += line + " 0\n";
  }
  ExpectTheSame(Read(indexed));
  ExpectTheSame(Read(trailing));
  EXPECT_THAT(Read(trailing).notes, testing::ElementsAre(HasSubstr("always 0, is not used")));
  EXPECT_THAT(RuntimeErrorOf([&] { Read("1 2 3 4 0 0 0 1 5\n1 2 3 4 0 0 0 1 6\n"); }),
              HasSubstr("t.txt:1: expected 8 columns"));
}

TEST_F(TrajectoryForms, EurocHasNanosecondsAndWFirst) {
  const std::string rows =
      "1403636579763555527,1,2,3,0.9273618495495704,0.1,0.2,0.3\n"
      "1403636579813555479,1.5,2,3,0.9110433579144299,0.2,0.2,0.3\n"
      "1403636579863555431,2,2,3,0.8831760866327848,0.3,0.2,0.3\n";
  const TrajectoryFile named = Read(
      "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
      "q_RS_z []\n" +
      rows);
  ExpectTheSame(named);
  EXPECT_EQ(named.form, "EuRoC");
  EXPECT_THAT(named.notes, testing::IsEmpty());
  const TrajectoryFile bare = Read(rows);
  ExpectTheSame(bare);
  EXPECT_TRUE(bare.is_order_assumed);
  const auto copy = folder_.path() / "ours.csv";
  WriteEurocTrajectory(copy, named.poses);
  ExpectTheSame(ReadTrajectoryFile(copy));
  // ORB-SLAM3 writes nanoseconds into TUM's columns.
  const TrajectoryFile nanoseconds = Read("1403636579763555584.000000 1 2 3 0 0 0 1\n");
  EXPECT_NEAR(nanoseconds.poses[0].timestamp_s, 1403636579.763555584, 1e-6);
  EXPECT_THAT(nanoseconds.notes, testing::ElementsAre("its times are taken for ns"));
}

TEST_F(TrajectoryForms, MatricesInALineOverLinesAndInFiles) {
  std::string twelve;
  std::string thirteen;
  std::string rows;
  std::filesystem::create_directory(folder_.path() / "seq-01");
  int index = 0;
  for (const StampedPose& pose : Expected()) {
    std::string row;
    const Eigen::Matrix3d R = pose.world_from_cam.Matrix();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) row += std::to_string(R(r, c)) + ' ';
      row += std::to_string(pose.center_in_world[r]) + (r < 2 ? " " : "");
    }
    std::string cut;
    int word = 0;
    for (const char c : row) cut += c == ' ' && ++word % 4 == 0 ? '\n' : c;
    twelve += row + '\n';
    thirteen += std::to_string(index) + ' ' + row + '\n';
    rows += cut + "\n0 0 0 1\n\n";
    folder_.Write("seq-01/frame-00000" + std::to_string(index++) + ".pose.txt",
                  cut + "\n0 0 0 1\n");
  }
  ExpectTheSame(Read(twelve), false);
  ExpectTheSame(Read(thirteen), false);
  ExpectTheSame(Read(rows), false);
  EXPECT_EQ(Read(rows).form, "matrices over several lines");
  const TrajectoryFile folder = ReadTrajectoryFile(folder_.path() / "seq-01");
  ExpectTheSame(folder, false);
  EXPECT_EQ(folder.form, "folder of pose files");
}

TEST_F(TrajectoryForms, TartanAirHasNoTimesAndItsOwnAxes) {
  std::string text;
  std::istringstream lines(kTumLines);
  for (std::string line; std::getline(lines, line);) text += line.substr(line.find(' ') + 1) + '\n';
  ExpectTheSame(Read(text), false);
  const TrajectoryFile turned = Read(text, "pose_left.txt");
  // Forward is x there, z here.
  const Eigen::Vector3d forward = Expected()[1].world_from_cam * Eigen::Vector3d::UnitX();
  EXPECT_LT((turned.poses[1].world_from_cam * Eigen::Vector3d::UnitZ() - forward).norm(), 1e-9);
}

TEST_F(TrajectoryForms, LostPosesAndTimesThatAreThereTwiceAreLeftOut) {
  const TrajectoryFile file = Read(std::string(kTumLines) +
                                   "1403636579.9 nan nan nan nan nan nan nan\n"
                                   "1403636580.0 0 0 0 0 0 0 0\n"
                                   "1403636579.813555479 1.5 2 3 0 0 0 1\n");
  ExpectTheSame(file);
  EXPECT_THAT(file.notes,
              testing::ElementsAre(HasSubstr("2 poses left out that are marked as lost (nan or "
                                             "zero), the first in line 4"),
                                   HasSubstr("1 pose left out whose time is there before, the "
                                             "first in line 6 (up to")));
}

TEST_F(TrajectoryForms, OtherFilesAreNotRecognised) {
  EXPECT_EQ(RecogniseTrajectory(folder_.Write("t.txt", kTumLines)), "TUM");
  for (const char* other : {"EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1\n", "camera: 1\nfx: 2\n", ""}) {
    EXPECT_EQ(RecogniseTrajectory(folder_.Write("t.txt", other)), std::nullopt) << other;
  }
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
