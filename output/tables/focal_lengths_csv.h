#pragma once

#include <filesystem>
#include <vector>

namespace rotslam {

/// One line of focal_lengths.csv, which a run has whose lens zooms.
struct FocalLengthRow {
  int frame = 0;
  double timestamp_s = 0.0;
  double fx = 0.0;  // px, as cx and cy; pixel centres at integer coordinates
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
};

/// Writes `frame,timestamp,fx,fy,cx,cy`; the numbers read back the same. Throws std::runtime_error
/// when the file cannot be written.
void WriteFocalLengthsCsv(const std::filesystem::path& path,
                          const std::vector<FocalLengthRow>& rows);

/// Reads what WriteFocalLengthsCsv has written. Throws std::runtime_error with path, line and
/// reason: missing, no number, a focal length that is not positive.
std::vector<FocalLengthRow> ReadFocalLengthsCsv(const std::filesystem::path& path);

}  // namespace rotslam
