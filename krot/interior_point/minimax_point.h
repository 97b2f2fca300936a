#pragma once

#include <span>

#include <Eigen/Core>

#include "krot/lp/lp.h"

namespace rotslam {

/// How the residual of one observation depends on a single unknown u, a point or a centre. (A u +
/// b) is (x, y, depth): the difference of the projection from the measurement, times depth, and the
/// depth.
struct AffineProjection {
  Eigen::Matrix3d A;
  Eigen::Vector3d b;
};

/// The projection of an unknown point u into a view of known centre and rotation.
AffineProjection ProjectionOfPoint(const Eigen::Matrix3d& R_c_w,
                                   const Eigen::Vector3d& center_in_world,
                                   const Eigen::Vector2d& xy);
/// How closely the least largest residual of one point is bracketed.
struct MinimaxPointOptions {
  // Stop when the bracket is this narrow relative to its upper end. Lower bounds closer than 1e-6
  // drown in rounding.
  double relative_gap = 1e-3;
  // Residuals at most this are good enough: stop there.
  double good_enough = 0.0;
  int max_programs = 20;
  // Lower bounds hold for |u|_inf up to this many times the largest |b|.
  double max_extent = 1e6;
};

/// A position and a bracket of the optimum, the smallest largest residual: [gamma_low, gamma_high].
struct MinimaxPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // attains gamma_high
  double gamma_low = 0.0;                              // proven, with bounds on rounding
  double gamma_high = kInfinity;  // infinite: no position in front of all cameras was found
};

/// Maximum of |x| / depth and |y| / depth over all projections; infinity where a depth is not
/// positive.
double MaxPointResidual(std::span<const AffineProjection> projections,
                        const Eigen::Vector3d& position);

/// Position with the least sum of squares of x and y times depth: the start of the search.
Eigen::Vector3d LeastSquaresPoint(std::span<const AffineProjection> projections);

/// L-infinity triangulation and resection with known rotation: the position with the smallest
/// largest residual per image axis (box norm), with a proven lower bound.
/// @param start  one of two starts; the other is the least-squares position.
/// Error:   the bracket of relative_gap; [0, gamma_high] where the optimum is zero up to rounding.
/// Cost:    some 40 interior-point steps on four unknowns; 0.05 ms for six observations.
/// Source:  Kahl & Hartley, Multiple-View Geometry under the L-infinity Norm, PAMI 2008; ours
///          replaces halving by the step of Crouzeix, Ferland & Schaible.
MinimaxPoint FindMinimaxPoint(std::span<const AffineProjection> projections,
                              const Eigen::Vector3d& start,
                              const MinimaxPointOptions& options = {});

}  // namespace rotslam
