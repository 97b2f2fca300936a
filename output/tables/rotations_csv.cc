#include "output/tables/rotations_csv.h"

#include <cmath>
#include <cstddef>
#include <sstream>
#include <stdexcept>

#include "output/files/atomic_file.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

void Require(const RotationRow& row) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("WriteRotationsCsv: frame " + std::to_string(row.frame) + ": " +
                                what);
  };
  if (!std::isfinite(row.timestamp_s)) refuse("the timestamp is not finite");
  if (row.sigma_deg && !row.sigma_deg->allFinite()) refuse("a standard deviation is not finite");
  for (const std::string& flag : row.flags) {
    if (flag.empty() || flag.find_first_of(",| \t\r\n\"") != std::string::npos) {
      refuse("\"" + flag + "\" is no flag");
    }
  }
}

std::vector<std::string> CutAtBars(const std::string& words) {
  std::vector<std::string> flags;
  std::istringstream stream(words);
  for (std::string flag; std::getline(stream, flag, '|');) flags.push_back(flag);
  return flags;
}

RotationRow ParseRow(const std::filesystem::path& path, const TextRow& text) {
  const auto number = [&](std::size_t column) { return NumberAt(path, text, column); };
  RotationRow row;
  row.frame = IntegerAt(path, text, 0, 0);
  row.timestamp_s = number(1);
  const Eigen::Quaterniond q(number(5), number(2), number(3), number(4));
  if (!IsUnitLength(q.norm())) {
    throw std::runtime_error(AtLine(path, text.line, "the quaternion is not of length 1"));
  }
  row.world_from_cam = Rotation(q);
  if (!text.words[6].empty()) row.sigma_deg.emplace(number(6), number(7), number(8));
  row.inlier_edges = IntegerAt(path, text, 9, 0);
  row.flags = CutAtBars(text.words[10]);
  return row;
}

}  // namespace

void WriteRotationsCsv(const std::filesystem::path& path, const std::vector<RotationRow>& rows) {
  std::string text =
      "frame,timestamp,qx,qy,qz,qw,sigma_x_deg,sigma_y_deg,sigma_z_deg,inlier_edges,flags\n";
  for (const RotationRow& row : rows) {
    Require(row);
    text += std::to_string(row.frame) + ',' + FormatNumber("%.9f", row.timestamp_s);
    for (const double value : row.world_from_cam.Quaternion().coeffs()) {
      text += ',' + FormatNumber("%.12g", value);
    }
    for (int axis = 0; axis < 3; ++axis) {
      text += ',';
      if (row.sigma_deg) text += FormatNumber("%.6g", (*row.sigma_deg)[axis]);
    }
    text += ',' + std::to_string(row.inlier_edges) + ',';
    for (std::size_t k = 0; k < row.flags.size(); ++k) text += (k == 0 ? "" : "|") + row.flags[k];
    text += '\n';
  }
  ReplaceFile(path, text);
}

std::vector<RotationRow> ReadRotationsCsv(const std::filesystem::path& path) {
  constexpr std::size_t kNumColumns = 11;
  const std::vector<TextRow> texts = ReadCsvRows(path, kNumColumns);
  std::vector<RotationRow> rows;
  rows.reserve(texts.size());
  for (const TextRow& text : texts) rows.push_back(ParseRow(path, text));
  return rows;
}

}  // namespace rotslam
