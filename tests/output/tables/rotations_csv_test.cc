#include "output/tables/rotations_csv.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::ElementsAre;

std::vector<std::vector<std::string>> ReadCells(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::vector<std::string>> cells;
  for (std::string line; std::getline(file, line);) {
    std::vector<std::string>& row = cells.emplace_back();
    std::size_t begin = 0;
    for (std::size_t end = line.find(','); end != std::string::npos; end = line.find(',', begin)) {
      row.push_back(line.substr(begin, end - begin));
      begin = end + 1;
    }
    row.push_back(line.substr(begin));
  }
  return cells;
}

std::vector<RotationRow> SomeRows() {
  std::vector<RotationRow> rows(3);
  rows[0] = {0, 1403636579.76, Rotation(), Eigen::Vector3d::Zero(), 3, {}};
  rows[1] = {1, 1403636579.81, Rotation::Exp({0.1, -2.0, 0.7}), std::nullopt, 0, {"predicted"}};
  rows[2] = {2,
             1403636579.86,
             Rotation::Exp({3.0, 0.2, 0.1}),
             Eigen::Vector3d(0.01, 2.5e-5, 12.0),
             7,
             {"weak", "searched_wide"}};
  return rows;
}

TEST(RotationsCsv, ComesBack) {
  const TemporaryFolder folder;
  const std::vector<RotationRow> rows = SomeRows();
  WriteRotationsCsv(folder.path() / "rotations.csv", rows);
  const auto cells = ReadCells(folder.path() / "rotations.csv");
  ASSERT_EQ(cells.size(), rows.size() + 1);
  EXPECT_THAT(cells[0],
              ElementsAre("frame",
                          "timestamp",
                          "qx",
                          "qy",
                          "qz",
                          "qw",
                          "sigma_x_deg",
                          "sigma_y_deg",
                          "sigma_z_deg",
                          "inlier_edges",
                          "flags"));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::vector<std::string>& row = cells[k + 1];
    ASSERT_EQ(row.size(), cells[0].size());
    EXPECT_EQ(std::stoi(row[0]), rows[k].frame);
    EXPECT_NEAR(std::stod(row[1]), rows[k].timestamp_s, 1e-6);
    const Rotation rotation(Eigen::Quaterniond(
        std::stod(row[5]), std::stod(row[2]), std::stod(row[3]), std::stod(row[4])));
    EXPECT_LT((rotation * rows[k].world_from_cam.Inverse()).Angle(), 1e-11);
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_EQ(row[6 + axis].empty(), !rows[k].sigma_deg.has_value());
      if (!rows[k].sigma_deg) continue;
      const double sigma = (*rows[k].sigma_deg)[axis];
      EXPECT_NEAR(std::stod(row[6 + axis]), sigma, 1e-5 * sigma);
    }
    EXPECT_EQ(std::stoi(row[9]), rows[k].inlier_edges);
  }
  EXPECT_EQ(cells[1][10], "");
  EXPECT_EQ(cells[2][10], "predicted");
  EXPECT_EQ(cells[3][10], "weak|searched_wide");
}

TEST(RotationsCsv, RefusesWhatWouldNotComeBack) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "rotations.csv";
  const auto write = [&](auto change) {
    std::vector<RotationRow> rows = SomeRows();
    change(rows[2]);
    WriteRotationsCsv(path, rows);
  };
  EXPECT_THROW(write([](RotationRow& row) { row.timestamp_s = NAN; }), std::invalid_argument);
  EXPECT_THROW(
      write([](RotationRow& row) { row.sigma_deg->x() = std::numeric_limits<double>::infinity(); }),
      std::invalid_argument);
  for (const char* flag : {"", "a,b", "a|b", "a b", "a\nb"}) {
    EXPECT_THROW(write([&](RotationRow& row) { row.flags = {flag}; }), std::invalid_argument)
        << flag;
  }
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_THROW(WriteRotationsCsv(folder.path() / "no_such_folder" / "rotations.csv", SomeRows()),
               std::runtime_error);
}

TEST(RotationsCsv, ReadsWhatItHasWritten) {
  const TemporaryFolder folder;
  std::vector<RotationRow> rows(2);
  rows[0].sigma_deg = Eigen::Vector3d(0.1, 0.2, 0.3);
  rows[1] = {1, 0.25, Rotation::Exp({0.1, -0.2, 0.3}), std::nullopt, 7, {"weak", "loop"}};
  const std::filesystem::path path = folder.path() / "rotations.csv";
  WriteRotationsCsv(path, rows);
  const std::vector<RotationRow> read = ReadRotationsCsv(path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].sigma_deg, rows[0].sigma_deg);
  EXPECT_THAT(read[0].flags, testing::IsEmpty());
  EXPECT_EQ(read[1].frame, 1);
  EXPECT_EQ(read[1].timestamp_s, 0.25);
  EXPECT_LT((read[1].world_from_cam.Inverse() * rows[1].world_from_cam).Angle(), 1e-9);
  EXPECT_EQ(read[1].sigma_deg, std::nullopt);
  EXPECT_EQ(read[1].inlier_edges, 7);
  EXPECT_THAT(read[1].flags, ElementsAre("weak", "loop"));
}

TEST(RotationsCsv, SaysWhichLineCannotBeRead) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& line) {
    const auto path = folder.Write("rotations.csv", "names\n" + line + "\n");
    return RuntimeErrorOf([&] { ReadRotationsCsv(path); });
  };
  EXPECT_THAT(error("0,0,0,0,0,1"), testing::HasSubstr("rotations.csv:2: expected 11 columns"));
  EXPECT_THAT(error("0,0,0,0,0,5,,,,1,"), testing::HasSubstr("not of length 1"));
  EXPECT_THAT(error("0,,0,0,0,1,,,,1,"), testing::HasSubstr("expected a finite number"));
}

}  // namespace
}  // namespace rotslam
