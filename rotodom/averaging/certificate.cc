#include "rotodom/averaging/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>

#include "rotodom/averaging/fill.h"
#include "rotodom/averaging/laplacian_solver.h"

namespace rotslam {
namespace {

constexpr int kMaxNewtonSteps = 100;
constexpr double kSmallestTurn_rad = 1e-12;
constexpr double kLeastDamping = 1e-12;
// Bounds of the search for epsilon, relative to the largest diagonal entry: the level of rounding,
// and a value at which every S is positive definite.
constexpr double kFirstShift = 1e-12;
constexpr double kLastShift = 10.0;

struct Chord {
  int i;
  int j;
  Eigen::Matrix3d j_from_i;
  double weight;
};

struct Chords {
  std::vector<FrameId> views;
  std::vector<Chord> edges;
  std::vector<Eigen::Matrix3d> R_c_w;
  std::vector<double> weight_of_view;
  int num_views() const { return static_cast<int>(views.size()); }
};

Chords MakeChords(std::span<const RelativeRotation> edges,
                  std::span<const double> weights,
                  const RotationMap& cam_from_world) {
  if (edges.size() != weights.size()) {
    throw std::invalid_argument("CertifyAveraging: needs one weight per edge");
  }
  Chords chords;
  chords.views.reserve(cam_from_world.size());
  chords.R_c_w.reserve(cam_from_world.size());
  for (const auto& [view, rotation] : cam_from_world) {
    chords.views.push_back(view);
    chords.R_c_w.push_back(rotation.Matrix());
  }
  chords.weight_of_view.resize(chords.views.size(), 0.0);
  const auto position = [&](FrameId view) {
    const auto found = std::lower_bound(chords.views.begin(), chords.views.end(), view);
    if (found == chords.views.end() || *found != view) {
      throw std::invalid_argument("CertifyAveraging: an edge's view has no orientation");
    }
    return static_cast<int>(found - chords.views.begin());
  };
  chords.edges.reserve(edges.size());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!(weights[k] >= 0.0 && std::isfinite(weights[k]))) {
      throw std::invalid_argument("CertifyAveraging: a weight is negative or not finite");
    }
    if (weights[k] == 0.0) continue;
    const int i = position(edges[k].i);
    const int j = position(edges[k].j);
    chords.edges.push_back({i, j, edges[k].j_from_i.Matrix(), weights[k]});
    chords.weight_of_view[i] += weights[k];
    chords.weight_of_view[j] += weights[k];
  }
  return chords;
}

// Axis times sine of the angle.
Eigen::Vector3d SineVector(const Eigen::Matrix3d& R) {
  return 0.5 * Eigen::Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
}

double Cost(const Chords& chords) {
  double cost = 0.0;
  for (const Chord& edge : chords.edges) {
    cost +=
        edge.weight * (chords.R_c_w[edge.j] - edge.j_from_i * chords.R_c_w[edge.i]).squaredNorm();
  }
  return cost;
}

// A quarter of the negative gradient by rotations in the world's frame.
Eigen::VectorXd Descent(const Chords& chords) {
  Eigen::VectorXd descent = Eigen::VectorXd::Zero(3 * chords.num_views());
  for (const Chord& edge : chords.edges) {
    const Eigen::Matrix3d difference =
        chords.R_c_w[edge.j].transpose() * edge.j_from_i * chords.R_c_w[edge.i];
    const Eigen::Vector3d pull = edge.weight * SineVector(difference);
    descent.segment<3>(3 * edge.j) += pull;
    descent.segment<3>(3 * edge.i) -= pull;
  }
  return descent;
}

void Turn(Chords& chords, const Eigen::VectorXd& turns) {
  for (int view = 0; view < chords.num_views(); ++view) {
    const Rotation turned =
        Rotation::FromMatrix(chords.R_c_w[view]) * Rotation::Exp(turns.segment<3>(3 * view));
    chords.R_c_w[view] = turned.Matrix();
  }
}

// Newton steps with the graph's Laplacian as Hessian, which is accurate for small residuals. Steps
// that would increase the cost are halved.
void Refine(Chords& chords) {
  std::vector<LaplacianEdge> laplacian;
  laplacian.reserve(chords.edges.size());
  for (const Chord& edge : chords.edges) {
    laplacian.push_back({edge.i, edge.j, edge.weight * Eigen::Matrix3d::Identity(), true});
  }
  LaplacianSolver solver(chords.num_views());
  double cost = Cost(chords);
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    Eigen::VectorXd turns = Descent(chords);
    if (!solver.Solve(laplacian, kLeastDamping, turns)) return;
    // A common rotation of all views is the gauge, so one view is fixed.
    const std::vector<Eigen::Matrix3d> before = chords.R_c_w;
    bool goes_down = false;
    for (double length = 1.0; length > 1e-3 && !goes_down; length *= 0.5) {
      chords.R_c_w = before;
      Turn(chords, length * turns);
      const double next = Cost(chords);
      goes_down = next <= cost * (1.0 + 1e-14);
      if (goes_down) cost = next;
    }
    if (!goes_down) chords.R_c_w = before;
    if (!goes_down || turns.cwiseAbs().maxCoeff() < kSmallestTurn_rad) return;
  }
}

// S = L - Lambda, lower triangle.
Eigen::SparseMatrix<double> DualMatrix(const Chords& chords) {
  std::vector<Eigen::Matrix3d> diagonal(chords.views.size(), Eigen::Matrix3d::Zero());
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(9 * (chords.views.size() + chords.edges.size()));
  const auto add = [&](int row, int column, const Eigen::Matrix3d& block) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        if (row > column || r >= c) entries.emplace_back(3 * row + r, 3 * column + c, block(r, c));
      }
    }
  };
  for (const Chord& edge : chords.edges) {
    // Block (j, i) of L is -w R_j_i; row i of L R is the sum of w (R_i - R_i_j R_j), and Lambda_i
    // is the symmetric part of that times R_i^T.
    const Eigen::Matrix3d block = -edge.weight * edge.j_from_i;
    const Eigen::Matrix3d predicted = chords.R_c_w[edge.j] * chords.R_c_w[edge.i].transpose();
    const Eigen::Matrix3d at_j = block * predicted.transpose();
    const Eigen::Matrix3d at_i = block.transpose() * predicted;
    diagonal[edge.j] -= 0.5 * (at_j + at_j.transpose());
    diagonal[edge.i] -= 0.5 * (at_i + at_i.transpose());
    if (edge.j > edge.i) {
      add(edge.j, edge.i, block);
    } else {
      add(edge.i, edge.j, block.transpose());
    }
  }
  for (int view = 0; view < chords.num_views(); ++view) add(view, view, diagonal[view]);
  Eigen::SparseMatrix<double> S(3 * chords.num_views(), 3 * chords.num_views());
  S.setFromTriplets(entries.begin(), entries.end());
  return S;
}

// The smallest eigenvalue of a symmetric matrix, from above, by Lanczos' method with full
// orthogonalisation: a hint only.
double EstimateSmallestEigenvalue(const Eigen::SparseMatrix<double>& S) {
  constexpr int kMaxBasis = 60;
  const Eigen::Index n = S.rows();
  const int size = static_cast<int>(std::min<Eigen::Index>(kMaxBasis, n));
  Eigen::MatrixXd basis(n, size);
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(size);
  Eigen::VectorXd beside = Eigen::VectorXd::Zero(size);
  Eigen::VectorXd v(n);
  // Any start that is not orthogonal to the eigenvector; the same in every run.
  for (Eigen::Index k = 0; k < n; ++k) v[k] = std::sin(1.0 + 1.7 * static_cast<double>(k));
  v.normalize();
  int used = 0;
  for (int k = 0; k < size; ++k) {
    basis.col(k) = v;
    ++used;
    Eigen::VectorXd w = S.selfadjointView<Eigen::Lower>() * v;
    diagonal[k] = w.dot(v);
    for (int pass = 0; pass < 2; ++pass) {
      w -= basis.leftCols(k + 1) * (basis.leftCols(k + 1).transpose() * w);
    }
    const double length = w.norm();
    if (!(length > 1e-14 * std::abs(diagonal[0])) || k + 1 == size) break;
    beside[k] = length;
    v = w / length;
  }
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen;
  eigen.computeFromTridiagonal(
      diagonal.head(used), beside.head(std::max(0, used - 1)), Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff();
}

// Rows and columns of S in an order of the views that keeps its factor sparse.
Eigen::SparseMatrix<double> InSparseOrder(const Eigen::SparseMatrix<double>& S,
                                          const Chords& chords,
                                          CertificateProgress& progress) {
  const int n = chords.num_views();
  std::vector<Eigen::Triplet<double>> pattern;
  pattern.reserve(chords.edges.size() + chords.views.size());
  for (int view = 0; view < n; ++view) pattern.emplace_back(view, view, 1.0);
  for (const Chord& edge : chords.edges) {
    pattern.emplace_back(std::max(edge.i, edge.j), std::min(edge.i, edge.j), 1.0);
  }
  Eigen::SparseMatrix<double> lower(n, n);
  lower.setFromTriplets(pattern.begin(), pattern.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
  std::vector<int> position(chords.views.size());
  for (int k = 0; k < n; ++k) position[order.indices()[k]] = k;
  for (Eigen::Triplet<double>& entry : pattern) {
    const int a = position[entry.row()];
    const int b = position[entry.col()];
    entry = Eigen::Triplet<double>(std::min(a, b), std::max(a, b), 1.0);
  }
  Eigen::SparseMatrix<double> upper(n, n);
  upper.setFromTriplets(pattern.begin(), pattern.end());
  const CholeskyFill fill = CountFill(upper, std::numeric_limits<double>::infinity());
  progress.entries = 9.0 * fill.entries;
  progress.products = 27.0 * fill.products;

  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(S.nonZeros()));
  for (int column = 0; column < S.outerSize(); ++column) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(S, column); entry; ++entry) {
      const int row = static_cast<int>(entry.row());
      const int a = 3 * position[row / 3] + row % 3;
      const int b = 3 * position[column / 3] + column % 3;
      entries.emplace_back(std::max(a, b), std::min(a, b), entry.value());
    }
  }
  Eigen::SparseMatrix<double> ordered(S.rows(), S.cols());
  ordered.setFromTriplets(entries.begin(), entries.end());
  return ordered;
}

// An epsilon for which S + epsilon I is positive definite, within a factor of two of the smallest.
double SmallestShift(const Eigen::SparseMatrix<double>& dual,
                     const Chords& chords,
                     const std::function<void(const CertificateProgress&)>& observe) {
  CertificateProgress progress;
  const Eigen::SparseMatrix<double> S = InSparseOrder(dual, chords, progress);
  if (observe) observe(progress);
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      ldlt;
  ldlt.analyzePattern(S);
  const double scale = std::max(S.diagonal().maxCoeff(), 1e-300);
  const auto is_definite = [&](double shift) {
    ldlt.setShift(shift * scale);
    ldlt.factorize(S);
    ++progress.factorisations;
    if (observe) observe(progress);
    return ldlt.info() == Eigen::Success && ldlt.vectorD().minCoeff() > 0.0;
  };
  if (is_definite(kFirstShift)) return kFirstShift * scale;
  double low = kFirstShift;
  double high = kLastShift;
  // The estimate is no larger in size than the eigenvalue: most often one more factorisation, at
  // somewhat more than it, is the last.
  const double estimate = -EstimateSmallestEigenvalue(dual) / scale;
  low = std::clamp(estimate, low, 0.5 * high);
  if (const double next = 2.0 * low; is_definite(next)) {
    high = next;
  } else {
    low = next;
  }
  while (high > 2.0 * low * (1.0 + 1e-9)) {
    const double middle = std::sqrt(low * high);
    (is_definite(middle) ? high : low) = middle;
  }
  return high * scale;
}

}  // namespace

AveragingCertificate CertifyAveraging(
    std::span<const RelativeRotation> edges,
    std::span<const double> weights,
    const RotationMap& cam_from_world,
    const std::function<void(const CertificateProgress&)>& observe) {
  Chords chords = MakeChords(edges, weights, cam_from_world);
  AveragingCertificate certificate;
  if (chords.edges.empty()) {
    certificate.cam_from_world = cam_from_world;
    return certificate;
  }
  Refine(chords);
  const Eigen::VectorXd descent = Descent(chords);
  for (int view = 0; view < chords.num_views(); ++view) {
    const double weight = chords.weight_of_view[view];
    if (weight == 0.0) continue;
    certificate.gradient =
        std::max(certificate.gradient, descent.segment<3>(3 * view).norm() / weight);
  }
  certificate.cost = Cost(chords);
  certificate.smallest_eigenvalue = -SmallestShift(DualMatrix(chords), chords, observe);
  // The sum of squares of all orientations' entries is 3 n.
  certificate.cost_bound =
      std::max(0.0, certificate.cost + 3.0 * chords.num_views() * certificate.smallest_eigenvalue);
  for (int view = 0; view < chords.num_views(); ++view) {
    certificate.cam_from_world.emplace_hint(certificate.cam_from_world.end(),
                                            chords.views[view],
                                            Rotation::FromMatrix(chords.R_c_w[view]));
  }
  return certificate;
}

}  // namespace rotslam
