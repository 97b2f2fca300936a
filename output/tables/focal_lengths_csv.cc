#include "output/tables/focal_lengths_csv.h"

#include <stdexcept>
#include <string>

#include "output/files/atomic_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

void WriteFocalLengthsCsv(const std::filesystem::path& path,
                          const std::vector<FocalLengthRow>& rows) {
  std::string text = "frame,timestamp,fx,fy,cx,cy\n";
  for (const FocalLengthRow& row : rows) {
    text += std::to_string(row.frame) + ',' + FormatNumber("%.9f", row.timestamp_s);
    for (const double value : {row.fx, row.fy, row.cx, row.cy}) {
      text += ',' + FormatNumber("%.17g", value);
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

std::vector<FocalLengthRow> ReadFocalLengthsCsv(const std::filesystem::path& path) {
  constexpr std::size_t kNumColumns = 6;
  std::vector<FocalLengthRow> rows;
  for (const TextRow& text : ReadCsvRows(path, kNumColumns)) {
    const auto number = [&](std::size_t column) { return NumberAt(path, text, column); };
    rows.push_back(
        {IntegerAt(path, text, 0, 0), number(1), number(2), number(3), number(4), number(5)});
    if (!(rows.back().fx > 0.0 && rows.back().fy > 0.0)) {
      throw std::runtime_error(AtLine(path, text.line, "a focal length is not positive"));
    }
  }
  return rows;
}

}  // namespace rotslam
