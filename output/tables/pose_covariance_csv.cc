#include "output/tables/pose_covariance_csv.h"

#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "output/files/atomic_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

void WritePoseCovarianceCsv(const std::filesystem::path& path,
                            const std::vector<PoseCovarianceRow>& rows) {
  constexpr std::array<const char*, 6> kNames = {"rx", "ry", "rz", "x", "y", "z"};
  std::string text = "frame,timestamp";
  for (std::size_t r = 0; r < kNames.size(); ++r) {
    for (std::size_t c = r; c < kNames.size(); ++c) {
      text += std::string(",") + kNames[r] + '_' + kNames[c];
    }
  }
  text += '\n';
  for (const PoseCovarianceRow& row : rows) {
    if (!row.covariance.allFinite()) {
      throw std::invalid_argument("WritePoseCovarianceCsv: frame " + std::to_string(row.frame) +
                                  ": a number is not finite");
    }
    text += std::to_string(row.frame) + ',' + FormatNumber("%.9f", row.timestamp_s);
    for (int r = 0; r < 6; ++r) {
      for (int c = r; c < 6; ++c) text += ',' + FormatNumber("%.9g", row.covariance(r, c));
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

std::vector<PoseCovarianceRow> ReadPoseCovarianceCsv(const std::filesystem::path& path) {
  constexpr std::size_t kNumColumns = 2 + 21;
  std::vector<PoseCovarianceRow> rows;
  for (const TextRow& text : ReadCsvRows(path, kNumColumns)) {
    PoseCovarianceRow row;
    row.frame = IntegerAt(path, text, 0, 0);
    row.timestamp_s = NumberAt(path, text, 1);
    std::size_t column = 2;
    for (int r = 0; r < 6; ++r) {
      for (int c = r; c < 6; ++c) {
        row.covariance(r, c) = row.covariance(c, r) = NumberAt(path, text, column++);
      }
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace rotslam
