#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "output/trajectory/trajectory.h"
#include "rotodom/types/rotation.h"
#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

// The first columns of a table that are numbers, row by row.
std::vector<std::vector<double>> NumbersOf(const std::filesystem::path& table) {
  std::vector<std::vector<double>> rows;
  std::vector<std::string> lines = Lines(ReadWholeFile(table));
  for (std::size_t k = 1; k < lines.size(); ++k) {
    std::istringstream line(lines[k]);
    std::vector<double>& row = rows.emplace_back();
    double number = 0.0;
    char comma = ',';
    while (comma == ',' && line >> number) {
      row.push_back(number);
      if (!line.get(comma)) break;
    }
  }
  return rows;
}

// Mean squared error over variance, per degree of freedom.
struct NormalisedErrors {
  double orientation = 0.0;  // the first frame laid over that of the truth
  double position = 0.0;     // after alignment by a similarity
};

NormalisedErrors ErrorsOf(const std::filesystem::path& run, const Trajectory& truth) {
  NormalisedErrors errors;
  const auto rotations = NumbersOf(run / "rotations.csv");
  const auto poses = NumbersOf(run / "poses.csv");
  const auto rotation_of = [](const std::vector<double>& row) {
    return Rotation(Eigen::Quaterniond(row[5], row[2], row[3], row[4]));
  };
  const Rotation estimate_from_truth =
      rotation_of(rotations[0]) * truth[0].world_from_cam.Inverse();
  for (std::size_t k = 1; k < rotations.size(); ++k) {
    const Eigen::Vector3d error =
        (rotation_of(rotations[k]).Inverse() * estimate_from_truth * truth[k].world_from_cam)
            .Log() *
        kDegFromRad;
    const Eigen::Vector3d sigma(rotations[k][6], rotations[k][7], rotations[k][8]);
    errors.orientation += error.cwiseQuotient(sigma).squaredNorm() / 3.0;
  }
  errors.orientation /= static_cast<double>(rotations.size() - 1);

  Eigen::Matrix3Xd estimated(3, poses.size());
  Eigen::Matrix3Xd true_ones(3, poses.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    estimated.col(k) = Eigen::Vector3d(poses[k][2], poses[k][3], poses[k][4]);
    true_ones.col(k) = truth[k].center_in_world;
  }
  const Eigen::Matrix4d aligned = Eigen::umeyama(true_ones, estimated, true);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const Eigen::Vector3d error =
        estimated.col(k) - (aligned * true_ones.col(k).homogeneous()).head<3>();
    const Eigen::Vector3d sigma(poses[k][9], poses[k][10], poses[k][11]);
    errors.position += error.cwiseQuotient(sigma).squaredNorm() / 3.0;
  }
  errors.position /= static_cast<double>(poses.size());
  return errors;
}

TEST(Deviations, TellTheErrorsOfANoisyWalk) {
  constexpr int kNumFrames = 60;
  constexpr int kNumSeeds = 3;
  const TemporaryFolder folder;
  NormalisedErrors mean;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    const std::filesystem::path sequence = folder.path() / ("sequence" + std::to_string(seed));
    const std::filesystem::path run = folder.path() / ("run" + std::to_string(seed));
    const CommandResult simulated = Rotslam({"simulate",
                                             "handheld",
                                             "--width=320",
                                             "--height=240",
                                             "--noise=4",
                                             "--frames=" + std::to_string(kNumFrames),
                                             "--seed=" + std::to_string(seed),
                                             "--quiet",
                                             "--out=" + sequence.string()});
    ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
    const CommandResult result = Rotslam({"run",
                                          sequence.string(),
                                          "--camera=" + (sequence / "camera.yaml").string(),
                                          "--no-report",
                                          "--quiet",
                                          "--out=" + run.string()});
    ASSERT_EQ(result.exit_code, 0) << result.error;
    const Trajectory truth = ReadTrajectory(sequence / "groundtruth_tum.txt");
    ASSERT_EQ(truth.size(), kNumFrames);
    const NormalisedErrors errors = ErrorsOf(run, truth);
    mean.orientation += errors.orientation / kNumSeeds;
    mean.position += errors.position / kNumSeeds;
  }
  RecordProperty("orientation", std::to_string(mean.orientation));
  RecordProperty("position", std::to_string(mean.position));
  EXPECT_GT(mean.orientation, 0.5);
  EXPECT_LT(mean.orientation, 2.0);
  EXPECT_GT(mean.position, 0.5);
  EXPECT_LT(mean.position, 2.0);
}

}  // namespace
}  // namespace rotslam
