// TartanAir: tx ty tz qx qy qz qw, without times.

#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

bool RecognisesTartanAir(const TrajectoryInput& input) {
  return input.NumColumns() == 7 && input.columns.empty();
}

// TartanAir's own files have axes x forward, y right, z down.
bool HasAxesOfTartanAir(const std::filesystem::path& path) {
  return path.filename() == "pose_left.txt" || path.filename() == "pose_right.txt";
}

TrajectoryFile ReadTartanAir(const TrajectoryInput& input,
                             const std::optional<std::filesystem::path>& times) {
  // With the number of the line for a time, these are the columns of TUM.
  TrajectoryInput numbered = input;
  std::vector<double> numbers;
  for (TextRow& row : numbered.rows) {
    row.words.insert(row.words.begin(), std::to_string(numbers.size()));
    numbers.push_back(static_cast<double>(numbers.size()));
  }
  for (std::size_t k = 0; k < input.rows.size(); ++k) {
    if (input.rows[k].words.size() == 7) continue;
    throw std::runtime_error(AtLine(input.path,
                                    input.rows[k].line,
                                    "expected the 7 columns tx ty tz qx qy qz qw, found " +
                                        std::to_string(input.rows[k].words.size())));
  }
  TrajectoryFile file = ReadPoseColumns(numbered, {}, "TartanAir");
  std::vector<double> kept;
  for (const StampedPose& pose : file.poses) kept.push_back(pose.timestamp_s);
  const std::vector<double> timestamps_s = TimesOfPoses(input, times, kept, file.notes);
  for (std::size_t k = 0; k < kept.size(); ++k) file.poses[k].timestamp_s = timestamps_s[k];
  file.has_times = times.has_value();
  file.is_order_assumed = !HasAxesOfTartanAir(input.path);
  if (file.is_order_assumed) return file;
  Eigen::Matrix3d R_ned_cam;
  R_ned_cam << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const Rotation ned_from_cam = Rotation::FromMatrix(R_ned_cam);
  for (StampedPose& pose : file.poses) pose.world_from_cam = pose.world_from_cam * ned_from_cam;
  file.notes.push_back(
      "its axes x forward, y right, z down, as TartanAir has them, are turned to those of a "
      "camera");
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormTartanAir() {
  return {"TartanAir",
          "tx ty tz qx qy qz qw without times; pose_left.txt has x forward, y right, z down",
          RecognisesTartanAir,
          ReadTartanAir};
}

}  // namespace forms
}  // namespace rotslam
