#include "output/tables/poses_csv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <stdexcept>

#include "output/files/atomic_file.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// In the order of PoseState.
constexpr std::array<const char*, 5> kStateNames = {
    "measured", "held", "interpolated", "extrapolated", "unplaced"};

void RequireWritable(const PoseRow& row) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("WritePosesCsv: frame " + std::to_string(row.frame) + ": " + what);
  };
  if (!std::isfinite(row.pose.timestamp_s)) refuse("the timestamp is not finite");
  if (!row.pose.center_in_world.allFinite()) refuse("the position is not finite");
  if (row.sigma && !row.sigma->allFinite()) refuse("a standard deviation is not finite");
  if (row.note.find_first_of(",_\r\n\"") != std::string::npos) refuse("the note breaks the line");
}

// Readers of tables drop blanks.
std::string WithUnderscores(std::string note) {
  std::replace(note.begin(), note.end(), ' ', '_');
  return note;
}

PoseState ParseState(const std::filesystem::path& path, const TextRow& text, std::size_t column) {
  const auto name = std::find(kStateNames.begin(), kStateNames.end(), text.words[column]);
  if (name == kStateNames.end()) {
    throw std::runtime_error(
        AtLine(path, text.line, "\"" + text.words[column] + "\" is no state of a pose"));
  }
  return static_cast<PoseState>(std::distance(kStateNames.begin(), name));
}

PoseRow ParsePoseRow(const std::filesystem::path& path, const TextRow& text) {
  const auto number = [&](std::size_t column) { return NumberAt(path, text, column); };
  PoseRow row;
  row.frame = IntegerAt(path, text, 0, 0);
  row.pose.timestamp_s = number(1);
  row.pose.center_in_world = {number(2), number(3), number(4)};
  const Eigen::Quaterniond q(number(8), number(5), number(6), number(7));
  if (!IsUnitLength(q.norm())) {
    throw std::runtime_error(AtLine(path, text.line, "the quaternion is not of length 1"));
  }
  row.pose.world_from_cam = Rotation(q);
  if (!text.words[9].empty()) row.sigma.emplace(number(9), number(10), number(11));
  row.state = ParseState(path, text, 12);
  row.component = IntegerAt(path, text, 13, -1);
  row.note = text.words[14];
  std::replace(row.note.begin(), row.note.end(), '_', ' ');
  return row;
}

}  // namespace

const char* Name(PoseState state) { return kStateNames.at(static_cast<std::size_t>(state)); }

void WritePosesCsv(const std::filesystem::path& path, const std::vector<PoseRow>& rows) {
  std::string text =
      "frame,timestamp,x,y,z,qx,qy,qz,qw,sigma_x,sigma_y,sigma_z,state,component,note\n";
  for (const PoseRow& row : rows) {
    RequireWritable(row);
    text += std::to_string(row.frame) + ',' + FormatNumber("%.9f", row.pose.timestamp_s);
    for (const double value : row.pose.center_in_world) text += ',' + FormatNumber("%.12g", value);
    for (const double value : row.pose.world_from_cam.Quaternion().coeffs()) {
      text += ',' + FormatNumber("%.12g", value);
    }
    for (int axis = 0; axis < 3; ++axis) {
      text += ',';
      if (row.sigma) text += FormatNumber("%.6g", (*row.sigma)[axis]);
    }
    text += std::string(",") + Name(row.state) + ',' + std::to_string(row.component) + ',' +
            WithUnderscores(row.note) + '\n';
  }
  ReplaceFile(path, text);
}

std::vector<PoseRow> ReadPosesCsv(const std::filesystem::path& path) {
  constexpr std::size_t kNumColumns = 15;
  const std::vector<TextRow> texts = ReadCsvRows(path, kNumColumns);
  std::vector<PoseRow> rows;
  rows.reserve(texts.size());
  for (const TextRow& text : texts) rows.push_back(ParsePoseRow(path, text));
  return rows;
}

}  // namespace rotslam
