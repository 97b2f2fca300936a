#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/trajectory/metrics.h"
#include "output/trajectory/trajectory.h"
#include "tests/apps/command_line.h"

namespace rotslam {

/// Frames first to last, inclusive, and what segments.csv says of them.
struct SegmentRow {
  int first = 0;
  int last = 0;
  std::string kind;
};

inline std::vector<SegmentRow> ReadSegments(const std::filesystem::path& path) {
  std::vector<SegmentRow> rows;
  const std::vector<std::string> lines = Lines(ReadWholeFile(path));
  for (std::size_t k = 1; k < lines.size(); ++k) {
    std::istringstream line(lines[k]);
    SegmentRow row;
    char comma = 0;
    line >> row.first >> comma >> row.last >> comma;
    std::getline(line, row.kind, ',');
    rows.push_back(row);
  }
  return rows;
}

/// How many points the header of a PLY file announces; -1 where it is none or too short for them.
inline std::int64_t CountPlyPoints(const std::filesystem::path& path) {
  const std::string file = ReadWholeFile(path);
  const std::string end = "end_header\n";
  const std::size_t body = file.find(end);
  if (!file.starts_with("ply\n") || body == std::string::npos) return -1;
  std::int64_t count = -1;
  std::int64_t bytes_per_point = 0;
  bool in_vertices = false;
  for (const std::string& line : Lines(file.substr(0, body))) {
    std::istringstream words(line);
    std::string word;
    std::string type;
    words >> word >> type;
    if (word == "element") {
      in_vertices = type == "vertex";
      if (in_vertices) words >> count;
    }
    if (word == "property" && in_vertices) bytes_per_point += type == "uchar" ? 1 : 4;
  }
  const auto present = static_cast<std::int64_t>(file.size() - body - end.size());
  return present >= count * bytes_per_point ? count : -1;
}

/// The metrics of an estimate against the ground truth, both files.
inline TrajectoryMetrics Compare(const std::filesystem::path& ground_truth,
                                 const std::filesystem::path& estimate) {
  const MetricsOptions options;
  return ComputeMetrics(
      AssociatePoses(ReadTrajectory(ground_truth), ReadTrajectory(estimate), options), options);
}

/// summary.json of a run.
inline nlohmann::ordered_json ReadSummary(const std::filesystem::path& directory) {
  return nlohmann::ordered_json::parse(ReadWholeFile(directory / "summary.json"));
}

/// That two runs have left the same files with the same bytes, times in summary.json excepted.
inline void ExpectSameRun(const std::filesystem::path& a, const std::filesystem::path& b) {
  ASSERT_EQ(FileNames(a), FileNames(b));
  for (const std::string& name : FileNames(a)) {
    // Times are in both.
    if (name == "summary.json" || name == "report.html") continue;
    EXPECT_TRUE(ReadWholeFile(a / name) == ReadWholeFile(b / name)) << name;
  }
  nlohmann::ordered_json summary_a = ReadSummary(a);
  nlohmann::ordered_json summary_b = ReadSummary(b);
  EXPECT_EQ(summary_a.erase("seconds"), 1u);
  EXPECT_EQ(summary_b.erase("seconds"), 1u);
  EXPECT_EQ(summary_a.dump(), summary_b.dump());
}

}  // namespace rotslam
