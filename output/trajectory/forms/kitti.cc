// KITTI: the row-major 3x4 matrix [R t] in a line, or the 4x4 one, with a number in front or not.

#include <cmath>

#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

bool RecognisesKitti(const TrajectoryInput& input) {
  const std::size_t count = input.NumColumns();
  if (!input.columns.empty()) return false;
  if (count == 12 || count == 13 || count == 16) return true;
  if (count != 17) return false;
  const std::vector<std::string>& words = input.rows.front().words;
  return words[16] == "1" || words[16].starts_with("1.0");
}

bool AreCounted(const std::vector<double>& values) {
  double last = -1.0;
  for (const double value : values) {
    if (value != std::floor(value) || value <= last || value > 1e7) return false;
    last = value;
  }
  return true;
}

TrajectoryFile ReadKitti(const TrajectoryInput& input,
                         const std::optional<std::filesystem::path>& times) {
  const std::size_t num_columns = input.NumColumns();
  const std::size_t first = num_columns % 4 == 1 ? 1 : 0;
  std::vector<double> numbers;
  for (const TextRow& row : input.rows) {
    if (row.words.size() != num_columns) {
      throw std::runtime_error(AtLine(input.path,
                                      row.line,
                                      "expected " + std::to_string(num_columns) +
                                          " columns, as above, found " +
                                          std::to_string(row.words.size())));
    }
    numbers.push_back(first == 1 ? NumberAt(input.path, row, 0)
                                 : static_cast<double>(numbers.size()));
  }
  TrajectoryBuilder builder(input, "KITTI");
  std::vector<std::string> notes;
  bool has_times = times.has_value();
  std::vector<double> timestamps_s;
  if (first == 1 && !AreCounted(numbers)) {
    std::string note;
    timestamps_s = SecondsIn(input.path, input.rows, 0, false, note);
    builder.Note("the first of its columns is taken for a time");
    if (!note.empty()) builder.Note(note);
    has_times = true;
  } else {
    if (first == 1) builder.Note("the first of its columns is taken for the number of the frame");
    timestamps_s = TimesOfPoses(input, times, numbers, notes);
  }
  for (const std::string& note : notes) builder.Note(note);
  for (std::size_t k = 0; k < input.rows.size(); ++k) {
    const TextRow& row = input.rows[k];
    std::array<double, 12> pose{};
    bool is_lost = false;
    for (std::size_t n = 0; n < num_columns - first; ++n) {
      is_lost |= IsMissingNumber(row.words[first + n]);
      const double value = is_lost ? 0.0 : NumberAt(input.path, row, first + n);
      if (n < 12) {
        pose[n] = value;
      } else if (!is_lost && std::abs(value - (n == 15 ? 1.0 : 0.0)) > 1e-6) {
        throw std::runtime_error(AtLine(input.path,
                                        row.line,
                                        "expected 0 0 0 1 in the last row of the matrix, found \"" +
                                            row.words[first + n] + "\""));
      }
    }
    if (is_lost) {
      builder.AddLost(row.line);
    } else {
      builder.Add(row.line, timestamps_s[k], pose);
    }
  }
  TrajectoryFile file = builder.Finish();
  file.has_times = has_times;
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormKitti() {
  return {"KITTI",
          "the 12 numbers of [R t] by rows, or 16 of a 4x4 matrix, with a frame's number in front "
          "or not; times from --times",
          RecognisesKitti,
          ReadKitti};
}

}  // namespace forms
}  // namespace rotslam
