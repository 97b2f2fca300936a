#include "output/trajectory/orientation_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/tables/pose_covariance_csv.h"
#include "output/tables/rotations_csv.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(OrientationFile, TumLinesAreSortedAndTheirPositionsNotLookedAt) {
  const TemporaryFolder folder;
  const auto file = folder.Write("tum.txt", "# t x y z q\n2.5 9 9 9 1 0 0 0\n1.5 0 0 0 0 0 0 1\n");
  const std::vector<StampedRotation> read = ReadOrientations(file);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].timestamp_s, 1.5);
  EXPECT_LT(read[0].world_from_cam.Angle(), 1e-12);
  EXPECT_EQ(read[1].timestamp_s, 2.5);
  EXPECT_NEAR(read[1].world_from_cam.Angle(), M_PI, 1e-12);
  EXPECT_FALSE(read[1].sigma_deg.has_value());
}

TEST(OrientationFile, WhatRotationsCsvSaysComesBack) {
  const TemporaryFolder folder;
  std::vector<RotationRow> rows(2);
  rows[0].timestamp_s = 0.1;
  rows[0].world_from_cam = Rotation::Exp({0.1, -0.2, 0.3});
  rows[0].sigma_deg = Eigen::Vector3d(0.5, 0.25, 0.125);
  rows[1].frame = 1;
  rows[1].timestamp_s = 0.2;
  WriteRotationsCsv(folder.path() / "rotations.csv", rows);
  const std::vector<StampedRotation> read = ReadOrientations(folder.path() / "rotations.csv");
  ASSERT_EQ(read.size(), 2u);
  EXPECT_NEAR(read[0].timestamp_s, 0.1, 1e-9);
  EXPECT_LT((read[0].world_from_cam.Inverse() * rows[0].world_from_cam).Angle(), 1e-8);
  ASSERT_TRUE(read[0].sigma_deg.has_value());
  EXPECT_LT((*read[0].sigma_deg - Eigen::Vector3d(0.5, 0.25, 0.125)).norm(), 1e-8);
  EXPECT_FALSE(read[1].sigma_deg.has_value());
}

TEST(OrientationFile, OtherFormsAndWhatIsLeftOut) {
  const TemporaryFolder folder;
  const auto euroc = folder.Write("data.csv",
                                  "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],"
                                  "q_z []\n1403636579763555584,1,2,3,0.6,0.8,0,0\n");
  const OrientationFile file = ReadOrientationFile(euroc);
  EXPECT_EQ(file.form, "EuRoC");
  ASSERT_EQ(file.orientations.size(), 1u);
  EXPECT_NEAR(file.orientations[0].world_from_cam.Quaternion().x(), 0.8, 1e-12);
  const auto twice = folder.Write("tum.txt", "1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
  EXPECT_EQ(ReadOrientationFile(twice).orientations.size(), 1u);
  EXPECT_EQ(ReadOrientationFile(twice).notes.size(), 1u);
}

TEST(OrientationFile, RefusesInOneLine) {
  const TemporaryFolder folder;
  std::vector<RotationRow> rows(1);
  rows[0].sigma_deg = Eigen::Vector3d(0.5, -0.25, 0.125);
  WriteRotationsCsv(folder.path() / "negative.csv", rows);
  const std::map<std::string, std::string> reasons = {
      {"# nothing\n", "has no orientations"},
      {"1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n", ":2: expected 8 columns, as above, found 7"},
      {"1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1.5\n", ":2: the quaternion is not of length 1"},
      {"1 0 0 0 0 0 0 1.5\n", ":1: columns 5 to 8 are no quaternions of length 1"},
      {"1 0 0 0 0 1 0 0 0 0 1 0\n", "was taken for KITTI, which has no times"}};
  for (const auto& [content, reason] : reasons) {
    const auto file = folder.Write("tum.txt", content);
    EXPECT_THAT(RuntimeErrorOf([&] { ReadOrientations(file); }), HasSubstr(reason)) << content;
  }
  EXPECT_THAT(RuntimeErrorOf([&] { ReadOrientations(folder.path() / "negative.csv"); }),
              HasSubstr("a standard deviation is negative"));
}

TEST(PoseCovarianceCsv, HasTheUpperTriangleRowByRow) {
  const TemporaryFolder folder;
  PoseCovarianceRow row;
  row.frame = 4;
  row.timestamp_s = 1.25;
  for (int r = 0; r < 6; ++r) {
    for (int c = 0; c < 6; ++c) row.covariance(r, c) = 10 * std::min(r, c) + std::max(r, c);
  }
  const auto file = folder.path() / "pose_covariance.csv";
  WritePoseCovarianceCsv(file, {row});
  const std::string text = ReadWholeFile(file);
  EXPECT_THAT(text, StartsWith("frame,timestamp,rx_rx,rx_ry,rx_rz,rx_x,rx_y,rx_z,ry_ry,ry_rz,"));
  EXPECT_THAT(text,
              HasSubstr("z_z\n4,1.250000000,0,1,2,3,4,5,11,12,13,14,15,22,23,24,25,33,34,35,44,45,"
                        "55\n"));
  const std::vector<PoseCovarianceRow> read = ReadPoseCovarianceCsv(file);
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].frame, 4);
  EXPECT_EQ(read[0].timestamp_s, 1.25);
  EXPECT_EQ(read[0].covariance, row.covariance);
  const auto torn = folder.Write("torn.csv", text.substr(0, text.size() - 4));
  EXPECT_THAT(RuntimeErrorOf([&] { ReadPoseCovarianceCsv(torn); }), HasSubstr("torn.csv:2: "));
  row.covariance(2, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(WritePoseCovarianceCsv(file, {row}), std::invalid_argument);
  EXPECT_EQ(ReadWholeFile(file), text) << "the file stays as it was";
}

}  // namespace
}  // namespace rotslam
