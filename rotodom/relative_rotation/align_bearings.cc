#include "rotodom/relative_rotation/align_bearings.h"

#include <Eigen/Dense>

namespace rotslam {

std::optional<Rotation> AlignBearings(std::span<const BearingPair> pairs) {
  if (pairs.size() < 2) return std::nullopt;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const BearingPair& pair : pairs) sum += pair.bearing_j * pair.bearing_i.transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!sum.allFinite() || svd.singularValues()[1] < 1e-12 * svd.singularValues()[0])
    return std::nullopt;
  Eigen::Matrix3d U = svd.matrixU();
  if (U.determinant() * svd.matrixV().determinant() < 0.0) U.col(2) = -U.col(2);
  return Rotation(Eigen::Quaterniond(Eigen::Matrix3d(U * svd.matrixV().transpose())));
}

}  // namespace rotslam
