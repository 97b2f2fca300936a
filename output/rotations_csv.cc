#include "output/rotations_csv.h"

#include <cmath>
#include <stdexcept>

#include "output/atomic_file.h"
#include "output/text_file.h"

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

}  // namespace rotslam
