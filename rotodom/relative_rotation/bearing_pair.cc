#include "rotodom/relative_rotation/bearing_pair.h"

#include <Eigen/Geometry>

namespace rotslam {

Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& direction) {
  int smallest = 0;
  direction.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

Eigen::Matrix2d TangentCovariance(const Eigen::Vector3d& bearing,
                                  const Eigen::Matrix2d& image_covariance) {
  // d bearing = z (I - f f^T) (dx, dy, 0), and the basis is perpendicular to f.
  const Eigen::Matrix2d J = bearing.z() * TangentBasis(bearing).transpose().leftCols<2>();
  return J * image_covariance * J.transpose();
}

Eigen::Matrix2d DifferenceCovariance(const Eigen::Vector3d& bearing_i,
                                     const Eigen::Matrix2d& image_covariance_i,
                                     const Eigen::Vector3d& bearing_j,
                                     const Eigen::Matrix2d& image_covariance_j,
                                     const Eigen::Matrix3d& R_j_i,
                                     const Eigen::Matrix<double, 3, 2>& basis_j) {
  // d bearing = z (I - f f^T) (dx, dy, 0); the basis is perpendicular to f_j.
  Eigen::Matrix<double, 3, 2> d_bearing_i = -bearing_i * bearing_i.head<2>().transpose();
  d_bearing_i(0, 0) += 1.0;
  d_bearing_i(1, 1) += 1.0;
  const Eigen::Matrix2d J_i =
      bearing_i.z() * (basis_j.transpose() * R_j_i).lazyProduct(d_bearing_i);
  const Eigen::Matrix2d J_j = bearing_j.z() * basis_j.transpose().leftCols<2>();
  return J_i * image_covariance_i * J_i.transpose() + J_j * image_covariance_j * J_j.transpose();
}

}  // namespace rotslam
