// TUM: timestamp tx ty tz qx qy qz qw, with nothing else or an index in front or a constant behind.

#include <cmath>

#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

constexpr std::size_t kTumColumns = 8;

bool IsEurocOrder(const TrajectoryInput& input) {
  const auto named = NamedPoseColumns(input.columns);
  return named && named->quaternion[3] < named->quaternion[0];
}

// Whole nanoseconds between commas: the columns of EuRoC, header or not.
bool HasEurocTimes(const TrajectoryInput& input) {
  const std::string& word = input.rows.front().words.front();
  return input.has_commas && input.columns.empty() && word.size() >= 18 &&
         word.find_first_not_of("0123456789") == std::string::npos;
}

bool RecognisesTum(const TrajectoryInput& input) {
  const std::size_t count = input.NumColumns();
  if (count != kTumColumns && count != kTumColumns + 1) return false;
  return !IsEurocOrder(input) && !(count == kTumColumns && HasEurocTimes(input));
}

// Whether the column counts 0, 1, 2 .. or 1, 2, 3 .., gaps allowed.
bool Counts(const TrajectoryInput& input) {
  double last = -1.0;
  for (const TextRow& row : input.rows) {
    const double value = NumberAt(input.path, row, 0);
    if (value != std::floor(value) || value <= last) return false;
    last = value;
  }
  return true;
}

bool LastColumnIsConstant(const TrajectoryInput& input) {
  for (const TextRow& row : input.rows) {
    if (row.words.back() != input.rows.front().words.back()) return false;
  }
  return true;
}

TrajectoryFile ReadTum(const TrajectoryInput& input,
                       const std::optional<std::filesystem::path>& times) {
  PoseColumns columns;
  std::string note;
  const auto named = NamedPoseColumns(input.columns);
  if (named) {
    columns = *named;
  } else if (input.NumColumns() == kTumColumns + 1) {
    if (LastColumnIsConstant(input)) {
      note =
          "the last of its 9 columns, always " + input.rows.front().words.back() + ", is not used";
    } else if (Counts(input)) {
      columns = {1, {2, 3, 4}, {5, 6, 7, 8}};
      note = "the first of its 9 columns is taken for an index";
    } else {
      throw std::runtime_error(
          AtLine(input.path,
                 input.rows.front().line,
                 "expected 8 columns (timestamp tx ty tz qx qy qz qw), found 9, of which the first "
                 "does not count and the last is not constant; name them in a first line"));
    }
  }
  TrajectoryFile file = ReadPoseColumns(input, columns, "TUM");
  if (!note.empty()) file.notes.push_back(note);
  file.is_order_assumed = !named;
  if (!times) return file;
  // Numbers of frames in place of times.
  std::vector<double> numbers;
  for (const StampedPose& pose : file.poses) {
    const bool is_number = pose.timestamp_s >= 0.0 && pose.timestamp_s < 1e7 &&
                           pose.timestamp_s == std::floor(pose.timestamp_s);
    if (!is_number) return file;
    numbers.push_back(pose.timestamp_s);
  }
  const std::vector<double> of_poses = TimesOfPoses(input, times, numbers, file.notes);
  for (std::size_t k = 0; k < of_poses.size(); ++k) file.poses[k].timestamp_s = of_poses[k];
  file.notes.push_back("its times are whole numbers and taken for lines of " + times->string());
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormTum() {
  return {"TUM", "timestamp tx ty tz qx qy qz qw", RecognisesTum, ReadTum};
}

}  // namespace forms
}  // namespace rotslam
