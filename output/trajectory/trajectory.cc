#include "output/trajectory/trajectory.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "output/files/atomic_file.h"
#include "output/trajectory/trajectory_form.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

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

TrajectoryFile ReadTrajectoryFile(const std::filesystem::path& path,
                                  const std::optional<std::filesystem::path>& times) {
  const TrajectoryInput input = ReadTrajectoryInput(path);
  if (!input.is_folder && input.rows.empty()) {
    throw std::runtime_error(path.string() + ": has no poses");
  }
  if (!input.odd_word.empty()) {
    throw std::runtime_error(AtLine(path,
                                    input.rows.front().line,
                                    "expected a finite number, found \"" + input.odd_word + "\""));
  }
  for (const TrajectoryForm& form : TrajectoryForms()) {
    if (form.recognises(input)) return form.read(input, times);
  }
  if (input.is_folder) {
    throw std::runtime_error(path.string() +
                             ": is a folder without pose files: expected 4x4 matrices in "
                             "frame-000000.pose.txt or 0.txt, or a data.csv");
  }
  throw std::runtime_error(
      AtLine(path,
             input.rows.front().line,
             "expected 8 columns (TUM) or 12 (KITTI), 7, 9, 13, 16 or 17 of other forms, or a "
             "header that names timestamp, qx, qy, qz and qw; found " +
                 std::to_string(input.NumColumns())));
}

Trajectory ReadTrajectory(const std::filesystem::path& path,
                          const std::optional<std::filesystem::path>& times) {
  return ReadTrajectoryFile(path, times).poses;
}

std::optional<std::string> RecogniseTrajectory(const std::filesystem::path& path) {
  const TrajectoryInput input = ReadTrajectoryInput(path);
  if (!input.odd_word.empty() || (!input.is_folder && input.rows.empty())) return std::nullopt;
  for (const TrajectoryForm& form : TrajectoryForms()) {
    if (form.recognises(input)) return form.name;
  }
  return std::nullopt;
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
