#include "output/trajectory/orientation_file.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "output/trajectory/trajectory.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr std::size_t kCsvColumns = 11;

Rotation RotationAt(const std::filesystem::path& path, const TextRow& row, std::size_t first) {
  Eigen::Vector4d q;
  for (int k = 0; k < 4; ++k) q[k] = NumberAt(path, row, first + k);
  if (!IsUnitLength(q.norm())) {
    throw std::runtime_error(AtLine(path,
                                    row.line,
                                    "the quaternion is of length " +
                                        FormatNumber("%.4g", q.norm()) +
                                        ", not 1: its columns are qx qy qz qw"));
  }
  return Rotation(Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
}

StampedRotation ParseCsvRow(const std::filesystem::path& path, const TextRow& row) {
  StampedRotation stamped{NumberAt(path, row, 1), RotationAt(path, row, 2), std::nullopt};
  const bool has_sigma = !row.words[6].empty() && !row.words[7].empty() && !row.words[8].empty();
  if (!has_sigma) return stamped;
  stamped.sigma_deg.emplace(NumberAt(path, row, 6), NumberAt(path, row, 7), NumberAt(path, row, 8));
  if (!(stamped.sigma_deg->minCoeff() >= 0.0)) {
    throw std::runtime_error(AtLine(path, row.line, "a standard deviation is negative"));
  }
  return stamped;
}

std::vector<StampedRotation> ReadCsv(const std::filesystem::path& path) {
  std::vector<StampedRotation> orientations;
  for (const TextRow& row : ReadCsvRows(path, kCsvColumns)) {
    orientations.push_back(ParseCsvRow(path, row));
  }
  return orientations;
}

void SortByTime(const std::filesystem::path& path, std::vector<StampedRotation>& orientations) {
  std::stable_sort(orientations.begin(),
                   orientations.end(),
                   [](const StampedRotation& a, const StampedRotation& b) {
                     return a.timestamp_s < b.timestamp_s;
                   });
  for (std::size_t k = 1; k < orientations.size(); ++k) {
    if (orientations[k].timestamp_s > orientations[k - 1].timestamp_s) continue;
    throw std::runtime_error(path.string() + ": the time " +
                             FormatNumber("%.9f", orientations[k].timestamp_s) + " is there twice");
  }
}

}  // namespace

OrientationFile ReadOrientationFile(const std::filesystem::path& path) {
  OrientationFile file;
  const bool is_folder = std::filesystem::is_directory(path);
  const std::vector<TextRow> rows = is_folder ? std::vector<TextRow>{} : ReadTextRows(path);
  if (!is_folder && rows.empty()) throw std::runtime_error(path.string() + ": has no orientations");
  if (!rows.empty() && rows.front().words.front() == "frame" &&
      rows.front().words.size() == kCsvColumns) {
    file.form = "rotations.csv";
    file.orientations = ReadCsv(path);
    if (file.orientations.empty()) {
      throw std::runtime_error(path.string() + ": has no orientations");
    }
    SortByTime(path, file.orientations);
    return file;
  }
  TrajectoryFile trajectory = ReadTrajectoryFile(path, std::nullopt);
  const auto times = TimesBeside(path);
  if (!trajectory.has_times && times) trajectory = ReadTrajectoryFile(path, times);
  if (!trajectory.has_times) {
    throw std::runtime_error(path.string() + ": was taken for " + trajectory.form +
                             ", which has no times; expected a time for each orientation, or a "
                             "times.txt beside it");
  }
  if (trajectory.first_scaled_line > 0) {
    throw std::runtime_error(AtLine(path,
                                    trajectory.first_scaled_line,
                                    "the quaternion is not of length 1: its columns are qx qy qz "
                                    "qw, unless a header says otherwise"));
  }
  file.form = std::move(trajectory.form);
  file.notes = std::move(trajectory.notes);
  for (const StampedPose& pose : trajectory.poses) {
    file.orientations.push_back({pose.timestamp_s, pose.world_from_cam, std::nullopt});
  }
  return file;
}

std::vector<StampedRotation> ReadOrientations(const std::filesystem::path& path) {
  return ReadOrientationFile(path).orientations;
}

}  // namespace rotslam
