#include "output/tables/loops_csv.h"

#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

std::vector<LoopRow> SomeRows() {
  return {{120, 3, 0.0625, 187, 2.5, true, 1.04, 0.5, 2}, {131, 7, 1.0 / 3.0, 0, 0.0, false}};
}

TEST(LoopsCsv, HasOneLinePerRow) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "loops.csv";
  WriteLoopsCsv(path, SomeRows());
  EXPECT_EQ(ReadWholeFile(path),
            "frame,match,score,inliers,angle_deg,accepted,turn_scale,scaled_angle_deg,edges\n"
            "120,3,0.0625,187,2.5,1,1.04,0.5,2\n"
            "131,7,0.333333,0,0,0,1,0,0\n");
  WriteLoopsCsv(path, {});
  EXPECT_EQ(ReadWholeFile(path),
            "frame,match,score,inliers,angle_deg,accepted,turn_scale,scaled_angle_deg,edges\n");
}

TEST(LoopsCsv, RefusesNumbersThatAreNotFinite) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "loops.csv";
  const auto write = [&](auto change) {
    std::vector<LoopRow> rows = SomeRows();
    change(rows[1]);
    WriteLoopsCsv(path, rows);
  };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double number : {std::nan(""), kInfinity, -kInfinity}) {
    EXPECT_THROW(write([&](LoopRow& row) { row.score = number; }), std::invalid_argument);
    EXPECT_THROW(write([&](LoopRow& row) { row.angle_deg = number; }), std::invalid_argument);
    EXPECT_THROW(write([&](LoopRow& row) { row.turn_scale = number; }), std::invalid_argument);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(LoopsCsv, NamesTheFrameItRefuses) {
  const TemporaryFolder folder;
  std::vector<LoopRow> rows = SomeRows();
  rows[1].score = std::nan("");
  try {
    WriteLoopsCsv(folder.path() / "loops.csv", rows);
    ADD_FAILURE() << "expected a std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("frame 131"));
  }
}

TEST(LoopsCsv, KeepsTheOldFileWhenItCannotWriteTheNew) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "loops.csv";
  WriteLoopsCsv(path, SomeRows());
  const std::string before = ReadWholeFile(path);
  std::vector<LoopRow> rows = SomeRows();
  rows[1].angle_deg = std::nan("");
  EXPECT_THROW(WriteLoopsCsv(path, rows), std::invalid_argument);
  EXPECT_EQ(ReadWholeFile(path), before);
  EXPECT_THROW(WriteLoopsCsv(folder.path() / "no_such_folder" / "loops.csv", SomeRows()),
               std::runtime_error);
  // Nothing is left beside it either.
  const std::filesystem::directory_iterator files(folder.path());
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

TEST(LoopsCsv, ReadsWhatItHasWritten) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "loops.csv";
  WriteLoopsCsv(path, {{90, 7, 0.5, 123, 1.25, true, 1.002, 0.75, 3}});
  const std::vector<LoopRow> read = ReadLoopsCsv(path);
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].frame, 90);
  EXPECT_EQ(read[0].match, 7);
  EXPECT_EQ(read[0].score, 0.5);
  EXPECT_EQ(read[0].inliers, 123);
  EXPECT_EQ(read[0].angle_deg, 1.25);
  EXPECT_TRUE(read[0].accepted);
  EXPECT_EQ(read[0].turn_scale, 1.002);
  EXPECT_EQ(read[0].scaled_angle_deg, 0.75);
  EXPECT_EQ(read[0].edges, 3);
}

}  // namespace
}  // namespace rotslam
