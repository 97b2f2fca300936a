#include "output/tables/pose_covariance_csv.h"

#include <array>
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

}  // namespace rotslam
