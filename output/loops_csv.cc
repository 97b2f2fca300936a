#include "output/loops_csv.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "output/atomic_file.h"
#include "output/text_file.h"

namespace rotslam {

void WriteLoopsCsv(const std::filesystem::path& path, const std::vector<LoopRow>& rows) {
  std::string text = "frame,match,score,inliers,angle_deg,accepted\n";
  for (const LoopRow& row : rows) {
    if (!std::isfinite(row.score) || !std::isfinite(row.angle_deg)) {
      throw std::invalid_argument("WriteLoopsCsv: frame " + std::to_string(row.frame) +
                                  ": a number is not finite");
    }
    text += std::to_string(row.frame) + ',' + std::to_string(row.match) + ',' +
            FormatNumber("%.6g", row.score) + ',' + std::to_string(row.inliers) + ',' +
            FormatNumber("%.6g", row.angle_deg) + ',' + (row.accepted ? "1\n" : "0\n");
  }
  ReplaceFile(path, text);
}

}  // namespace rotslam
