#include "output/tables/loops_csv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "output/files/atomic_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

void WriteLoopsCsv(const std::filesystem::path& path, const std::vector<LoopRow>& rows) {
  std::string text =
      "frame,match,score,inliers,angle_deg,accepted,turn_scale,scaled_angle_deg,edges\n";
  for (const LoopRow& row : rows) {
    const std::array<double, 4> numbers = {
        row.score, row.angle_deg, row.turn_scale, row.scaled_angle_deg};
    if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) {
      throw std::invalid_argument("WriteLoopsCsv: frame " + std::to_string(row.frame) +
                                  ": a number is not finite");
    }
    text += std::to_string(row.frame) + ',' + std::to_string(row.match) + ',' +
            FormatNumber("%.6g", row.score) + ',' + std::to_string(row.inliers) + ',' +
            FormatNumber("%.6g", row.angle_deg) + ',' + (row.accepted ? "1," : "0,") +
            FormatNumber("%.6g", row.turn_scale) + ',' +
            FormatNumber("%.6g", row.scaled_angle_deg) + ',' + std::to_string(row.edges) + '\n';
  }
  ReplaceFile(path, text);
}

std::vector<LoopRow> ReadLoopsCsv(const std::filesystem::path& path) {
  constexpr std::size_t kNumColumns = 9;
  const std::vector<TextRow> texts = ReadCsvRows(path, kNumColumns);
  std::vector<LoopRow> rows;
  rows.reserve(texts.size());
  for (const TextRow& text : texts) {
    const auto number = [&](std::size_t column) { return NumberAt(path, text, column); };
    rows.push_back({IntegerAt(path, text, 0, 0),
                    IntegerAt(path, text, 1, 0),
                    number(2),
                    IntegerAt(path, text, 3, 0),
                    number(4),
                    number(5) != 0.0,
                    number(6),
                    number(7),
                    IntegerAt(path, text, 8, 0)});
  }
  return rows;
}

}  // namespace rotslam
