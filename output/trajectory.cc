#include "output/trajectory.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "output/atomic_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr std::size_t kTumColumns = 8;
constexpr std::size_t kKittiColumns = 12;

std::vector<double> Numbers(const std::filesystem::path& path, const TextRow& row) {
  std::vector<double> numbers;
  for (std::size_t k = 0; k < row.words.size(); ++k) numbers.push_back(NumberAt(path, row, k));
  return numbers;
}

StampedPose ParseTumPose(const std::vector<double>& v) {
  return {v[0],
          Rotation(Eigen::Quaterniond(v[7], v[4], v[5], v[6])),
          Eigen::Vector3d(v[1], v[2], v[3])};
}

StampedPose ParseKittiPose(const std::vector<double>& v, double timestamp_s) {
  Eigen::Matrix3d R_w_c;
  R_w_c << v[0], v[1], v[2], v[4], v[5], v[6], v[8], v[9], v[10];
  return {timestamp_s, Rotation::FromMatrix(R_w_c), Eigen::Vector3d(v[3], v[7], v[11])};
}

std::vector<double> ReadTimes(const std::filesystem::path& path) {
  std::vector<double> times;
  for (const TextRow& row : ReadTextRows(path)) times.push_back(NumberAt(path, row, 0));
  return times;
}

void RequireFinite(const Trajectory& trajectory) {
  for (std::size_t k = 0; k < trajectory.size(); ++k) {
    if (!std::isfinite(trajectory[k].timestamp_s) || !trajectory[k].center_in_world.allFinite()) {
      throw std::invalid_argument("WriteTrajectory: pose " + std::to_string(k) + " is not finite");
    }
  }
}

void Append(std::string& text, double value) {
  if (!text.empty() && text.back() != '\n') text += ' ';
  text += FormatNumber("%.12g", value);
}

}  // namespace

std::optional<std::filesystem::path> TimesBeside(const std::filesystem::path& trajectory) {
  std::filesystem::path times = trajectory.parent_path() / "times.txt";
  if (!std::filesystem::exists(times)) return std::nullopt;
  return times;
}

Trajectory ReadTrajectory(const std::filesystem::path& path,
                          const std::optional<std::filesystem::path>& times) {
  const std::vector<TextRow> rows = ReadTextRows(path);
  if (rows.empty()) throw std::runtime_error(path.string() + ": has no poses");
  const std::size_t num_columns = rows.front().words.size();
  if (num_columns != kTumColumns && num_columns != kKittiColumns) {
    throw std::runtime_error(
        AtLine(path,
               rows.front().line,
               "expected 8 columns (TUM) or 12 (KITTI), found " + std::to_string(num_columns)));
  }
  const bool is_kitti = num_columns == kKittiColumns;
  std::vector<double> timestamps_s;
  if (is_kitti && times) {
    timestamps_s = ReadTimes(*times);
    if (timestamps_s.size() < rows.size()) {
      throw std::runtime_error(times->string() + ": has " + std::to_string(timestamps_s.size()) +
                               " timestamps for the " + std::to_string(rows.size()) + " poses of " +
                               path.string());
    }
  }
  Trajectory trajectory;
  trajectory.reserve(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows[k].words.size() != num_columns) {
      throw std::runtime_error(AtLine(path,
                                      rows[k].line,
                                      "expected " + std::to_string(num_columns) +
                                          " columns, found " +
                                          std::to_string(rows[k].words.size())));
    }
    const std::vector<double> numbers = Numbers(path, rows[k]);
    const double timestamp_s = timestamps_s.empty() ? static_cast<double>(k) : timestamps_s[k];
    try {
      trajectory.push_back(is_kitti ? ParseKittiPose(numbers, timestamp_s) : ParseTumPose(numbers));
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(AtLine(path, rows[k].line, error.what()));
    }
  }
  std::stable_sort(
      trajectory.begin(), trajectory.end(), [](const StampedPose& a, const StampedPose& b) {
        return a.timestamp_s < b.timestamp_s;
      });
  return trajectory;
}

void WriteTumTrajectory(const std::filesystem::path& path,
                        const Trajectory& trajectory,
                        const std::vector<std::string>& comments) {
  RequireFinite(trajectory);
  std::string text;
  for (const std::string& comment : comments) text += "# " + comment + '\n';
  for (const StampedPose& pose : trajectory) {
    text += FormatNumber("%.9f", pose.timestamp_s);
    for (const double value : pose.center_in_world) Append(text, value);
    for (const double value : pose.world_from_cam.Quaternion().coeffs()) Append(text, value);
    text += '\n';
  }
  ReplaceFile(path, text);
}

void WriteKittiTrajectory(const std::filesystem::path& path, const Trajectory& trajectory) {
  RequireFinite(trajectory);
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Matrix3d R_w_c = pose.world_from_cam.Matrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) Append(text, R_w_c(row, column));
      Append(text, pose.center_in_world[row]);
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

void WriteEurocTrajectory(const std::filesystem::path& path, const Trajectory& trajectory) {
  RequireFinite(trajectory);
  std::string text = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []\n";
  for (const StampedPose& pose : trajectory) {
    text += std::to_string(std::llround(1e9 * pose.timestamp_s));
    const Eigen::Quaterniond& q = pose.world_from_cam.Quaternion();
    const Eigen::Vector3d& p = pose.center_in_world;
    for (const double value : {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()}) {
      text += FormatNumber(",%.12g", value);
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

}  // namespace rotslam
