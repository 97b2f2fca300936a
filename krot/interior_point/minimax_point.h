#pragma once

#include <span>

#include <Eigen/Core>

#include "krot/lp/lp.h"

namespace rotslam {

/// One observation of a single unknown u, a point or a centre: (A u + b) is (x, y, depth) of the
/// projection less the measurement, x and y still times depth.
struct PointObservation {
  Eigen::Matrix3d A;
  Eigen::Vector3d b;
};

/// A point seen from a known centre under a known rotation, u being the point.
PointObservation SightOfPoint(const Eigen::Matrix3d& R_c_w,
                              const Eigen::Vector3d& center_in_world,
                              const Eigen::Vector2d& xy);
/// A known point seen under a known rotation, u being the centre.
PointObservation SightFromCenter(const Eigen::Matrix3d& R_c_w,
                                 const Eigen::Vector3d& point_in_world,
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

/// The least possible largest residual lies in [gamma_low, gamma_high].
struct MinimaxPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // attains gamma_high
  double gamma_low = 0.0;         // checked in our own arithmetic, rounding counted
  double gamma_high = kInfinity;  // infinite: no position in front of all cameras was found
};

/// Larger of |x|, |y| over depth, of all observations; infinity where a depth is not positive.
double MaxPointResidual(std::span<const PointObservation> observations,
                        const Eigen::Vector3d& position);

/// Position with the least sum of squares of x and y, both still times depth: where a search
/// starts.
Eigen::Vector3d LeastSquaresPoint(std::span<const PointObservation> observations);

/// L-infinity triangulation and resection with known rotation: the position whose largest residual
/// per image axis is smallest, box norm, with a proven bound.
/// @param start  tried first, as is the least-squares position.
/// Error:   the bracket of relative_gap; [0, gamma_high] where the optimum is zero up to rounding.
/// Cost:    some 40 interior-point steps on four unknowns; 0.05 ms for six observations.
/// Source:  Kahl & Hartley, Multiple-View Geometry under the L-infinity Norm, PAMI 2008; ours
///          replaces halving by the step of Crouzeix, Ferland & Schaible.
MinimaxPoint FindMinimaxPoint(std::span<const PointObservation> observations,
                              const Eigen::Vector3d& start,
                              const MinimaxPointOptions& options = {});

}  // namespace rotslam
