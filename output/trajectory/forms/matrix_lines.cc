// Matrices over several lines: 3x4 or 4x4, a line of one or three numbers before each or not
// (Redwood's .log).

#include <cmath>

#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

bool RecognisesMatrixLines(const TrajectoryInput& input) {
  const std::size_t count = input.NumColumns();
  if (count == 4) return input.rows.size() >= 3;
  return (count == 1 || count == 3) && input.rows.size() >= 4 && input.rows[1].words.size() == 4;
}

bool IsLastRow(const TextRow& row) {
  constexpr std::array<double, 4> kLast = {0.0, 0.0, 0.0, 1.0};
  for (std::size_t k = 0; k < 4; ++k) {
    if (IsMissingNumber(row.words[k])) return false;
    double value = 0.0;
    try {
      value = NumberAt({}, row, k);
    } catch (const std::runtime_error&) {
      return false;
    }
    if (std::abs(value - kLast[k]) > 1e-6) return false;
  }
  return true;
}

TrajectoryFile ReadMatrixLines(const TrajectoryInput& input,
                               const std::optional<std::filesystem::path>& times) {
  struct Matrix {
    int line = 0;
    std::array<double, 12> numbers{};
    bool is_lost = false;
  };
  std::vector<Matrix> matrices;
  std::size_t num_rows = 0;  // of the matrix that is being read
  for (const TextRow& row : input.rows) {
    if ((num_rows == 0 || num_rows == 3) && (row.words.size() == 1 || row.words.size() == 3)) {
      num_rows = 0;
      continue;
    }
    if (row.words.size() != 4) {
      throw std::runtime_error(AtLine(input.path,
                                      row.line,
                                      "expected a row of four numbers of a 3x4 or 4x4 matrix, "
                                      "found " +
                                          std::to_string(row.words.size())));
    }
    if (num_rows == 3) {
      num_rows = 0;
      if (IsLastRow(row)) continue;
    }
    if (num_rows == 0) matrices.push_back({row.line, {}, false});
    for (std::size_t k = 0; k < 4; ++k) {
      if (IsMissingNumber(row.words[k])) {
        matrices.back().is_lost = true;
      } else {
        matrices.back().numbers[4 * num_rows + k] = NumberAt(input.path, row, k);
      }
    }
    ++num_rows;
  }
  if (num_rows != 0 && num_rows != 3) {
    throw std::runtime_error(
        AtLine(input.path, input.rows.back().line, "the last matrix has too few rows"));
  }
  std::vector<double> numbers;
  for (std::size_t k = 0; k < matrices.size(); ++k) numbers.push_back(static_cast<double>(k));
  TrajectoryBuilder builder(input, "matrices over several lines");
  std::vector<std::string> notes;
  const std::vector<double> timestamps_s = TimesOfPoses(input, times, numbers, notes);
  for (const std::string& note : notes) builder.Note(note);
  for (std::size_t k = 0; k < matrices.size(); ++k) {
    if (matrices[k].is_lost) {
      builder.AddLost(matrices[k].line);
    } else {
      builder.Add(matrices[k].line, timestamps_s[k], matrices[k].numbers);
    }
  }
  TrajectoryFile file = builder.Finish();
  file.has_times = times.has_value();
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormMatrixLines() {
  return {"matrices over several lines",
          "3x4 or 4x4 matrices, a line a row (Redwood's .log)",
          RecognisesMatrixLines,
          ReadMatrixLines};
}

}  // namespace forms
}  // namespace rotslam
