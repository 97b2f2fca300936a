#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// How well one pose is known.
struct PoseCovarianceRow {
  int frame = 0;
  double timestamp_s = 0.0;
  // Of (delta, centre): delta in rad about the camera's axes, Exp(delta) * cam_from_world; the
  // centre along the world's axes, in the trajectory's units.
  Eigen::Matrix<double, 6, 6> covariance;
};

/// pose_covariance.csv: `frame,timestamp,rx_rx,rx_ry,...,z_z`: the upper triangle, row by row, of
/// the covariance of (rx, ry, rz, x, y, z). Errors as WriteRotationsCsv.
void WritePoseCovarianceCsv(const std::filesystem::path& path,
                            const std::vector<PoseCovarianceRow>& rows);

/// Reads what WritePoseCovarianceCsv has written. Throws std::runtime_error with file, line and
/// reason.
std::vector<PoseCovarianceRow> ReadPoseCovarianceCsv(const std::filesystem::path& path);

}  // namespace rotslam
