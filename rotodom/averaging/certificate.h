#pragma once

#include <functional>
#include <span>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Bound on the chordal least-squares cost, the sum over the edges of weight |R_j - R_j_i R_i|^2
/// (Frobenius) with fixed isotropic weights. It differs from the robust cost that AverageGlobally
/// minimises; on the inliers the minima of both are close.
struct AveragingCertificate {
  RotationMap cam_from_world;  // refined to a stationary point of this cost
  double cost = 0.0;
  // Lower bound of the cost of any orientations.
  double cost_bound = 0.0;
  // Lower bound of the smallest eigenvalue of the dual matrix; zero, or slightly negative, where
  // the orientations are optimal.
  double smallest_eigenvalue = 0.0;
  double gradient = 0.0;  // of the cost, largest of a view, relative to the view's weights
  double RelativeGap() const { return cost > 0.0 ? (cost - cost_bound) / cost : 0.0; }
};

/// Progress of the computation of a certificate.
struct CertificateProgress {
  double entries = 0.0;    // of one factorisation
  double products = 0.0;   // multiplications of one
  int factorisations = 0;  // done so far
};
constexpr int kMaxCertificateFactorisations = 8;

/// Refines orientations to a minimum of the chordal cost and bounds its distance from the global
/// minimum.
///
/// At a stationary point the Lagrange multipliers of R^T R = I follow in closed form; with the
/// multipliers' blocks Lambda and the connection Laplacian L of the graph, every choice of n
/// orientations costs at least cost + 3 n min(0, lambda) where lambda is the smallest eigenvalue of
/// S = L - Lambda. That S + epsilon I is positive definite is shown by its Cholesky factorisation,
/// and the smallest such epsilon found by bisection to a factor of two, near a Lanczos estimate of
/// lambda first.
/// @param weights  by edge, zero or more; zero leaves an edge out.
/// @param observe  is called before the first factorisation and after each one; may be empty.
/// Throws std::invalid_argument when the sizes differ, a weight is negative or an edge's view has
/// no orientation.
/// Error:   eigenvalues to 1e-12 of the largest weight of a view.
/// Cost:    one to eight Cholesky factorisations of 3 n unknowns; 12 bytes per entry of the factor.
/// Source:  Eriksson et al., Rotation Averaging and Strong Duality, CVPR 2018; Rosen, Scalable
///          Low-Rank Semidefinite Programming for Certifiably Correct Machine Perception, 2022, for
///          the factorisation as a test.
AveragingCertificate CertifyAveraging(
    std::span<const RelativeRotation> edges,
    std::span<const double> weights,
    const RotationMap& cam_from_world,
    const std::function<void(const CertificateProgress&)>& observe = {});

}  // namespace rotslam
