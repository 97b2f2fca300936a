#include "output/orientation_file.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "output/unit_length.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr std::size_t kTumColumns = 8;
constexpr std::size_t kCsvColumns = 11;

Rotation RotationAt(const std::filesystem::path& path, const TextRow& row, std::size_t first) {
  Eigen::Vector4d q;
  for (int k = 0; k < 4; ++k) q[k] = NumberAt(path, row, first + k);
  if (!IsUnitLength(q.norm())) {
    throw std::runtime_error(AtLine(path,
                                    row.line,
                                    "the quaternion is of length " +
                                        FormatNumber("%.4g", q.norm()) +
                                        ", not 1: its columns are qx qy qz qw"));
  }
  return Rotation(Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
}

StampedRotation ParseCsvRow(const std::filesystem::path& path, const TextRow& row) {
  StampedRotation stamped{NumberAt(path, row, 1), RotationAt(path, row, 2), std::nullopt};
  const bool has_sigma = !row.words[6].empty() && !row.words[7].empty() && !row.words[8].empty();
  if (!has_sigma) return stamped;
  stamped.sigma_deg.emplace(NumberAt(path, row, 6), NumberAt(path, row, 7), NumberAt(path, row, 8));
  if (!(stamped.sigma_deg->minCoeff() >= 0.0)) {
    throw std::runtime_error(AtLine(path, row.line, "a standard deviation is negative"));
  }
  return stamped;
}

std::vector<StampedRotation> ReadCsv(const std::filesystem::path& path) {
  std::vector<StampedRotation> orientations;
  for (const TextRow& row : ReadCsvRows(path, kCsvColumns)) {
    orientations.push_back(ParseCsvRow(path, row));
  }
  return orientations;
}

}  // namespace

std::vector<StampedRotation> ReadOrientations(const std::filesystem::path& path) {
  const std::vector<TextRow> rows = ReadTextRows(path);
  std::vector<StampedRotation> orientations;
  if (!rows.empty() && rows.front().words.front() == "frame") {
    orientations = ReadCsv(path);
  } else {
    orientations.reserve(rows.size());
    for (const TextRow& row : rows) {
      if (row.words.size() != kTumColumns) {
        throw std::runtime_error(
            AtLine(path,
                   row.line,
                   "expected the 8 columns of a TUM file or the header of a rotations.csv, found " +
                       std::to_string(row.words.size()) + " columns"));
      }
      orientations.push_back({NumberAt(path, row, 0), RotationAt(path, row, 4), std::nullopt});
    }
  }
  if (orientations.empty()) throw std::runtime_error(path.string() + ": has no orientations");
  std::stable_sort(orientations.begin(),
                   orientations.end(),
                   [](const StampedRotation& a, const StampedRotation& b) {
                     return a.timestamp_s < b.timestamp_s;
                   });
  for (std::size_t k = 1; k < orientations.size(); ++k) {
    if (orientations[k].timestamp_s > orientations[k - 1].timestamp_s) continue;
    throw std::runtime_error(path.string() + ": the time " +
                             FormatNumber("%.9f", orientations[k].timestamp_s) + " is there twice");
  }
  return orientations;
}

}  // namespace rotslam
