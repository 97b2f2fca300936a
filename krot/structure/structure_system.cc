#include "krot/structure/structure_system.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "krot/structure/camera_system.h"

namespace rotslam {
namespace {

// Damping relative to the diagonal before elimination: the level of rounding in double arithmetic.
constexpr double kDamping = 1e-15;
// Largest damping; rounding may make the centres' system indefinite by more than kDamping.
constexpr double kMaxDamping = 1e-8;

// Lower Cholesky factor of a symmetric 3 x 3 matrix; pivots are at least `floor`.
Eigen::Matrix3d Cholesky3(const Eigen::Matrix3d& V, double floor) {
  Eigen::Matrix3d L = Eigen::Matrix3d::Zero();
  L(0, 0) = std::sqrt(std::max(V(0, 0), floor));
  L(1, 0) = V(1, 0) / L(0, 0);
  L(2, 0) = V(2, 0) / L(0, 0);
  L(1, 1) = std::sqrt(std::max(V(1, 1) - L(1, 0) * L(1, 0), floor));
  L(2, 1) = (V(2, 1) - L(2, 0) * L(1, 0)) / L(1, 1);
  L(2, 2) = std::sqrt(std::max(V(2, 2) - L(2, 0) * L(2, 0) - L(2, 1) * L(2, 1), floor));
  return L;
}

}  // namespace

PointGroups::PointGroups(const MinimaxProblem& problem)
    : begin(problem.num_points + 1, 0), observations(problem.observations.size()) {
  for (const ImageObservation& observation : problem.observations) ++begin[observation.point + 1];
  for (int i = 0; i < problem.num_points; ++i) begin[i + 1] += begin[i];
  std::vector<int> next(begin.begin(), begin.end() - 1);
  for (int o = 0; o < static_cast<int>(problem.observations.size()); ++o) {
    observations[next[problem.observations[o].point]++] = o;
  }
}

StructureSystem::StructureSystem(const MinimaxProblem& problem)
    : layout_{problem.num_views(), problem.num_points},
      groups_(problem),
      L_point_(problem.num_points) {
  view_of_.reserve(groups_.observations.size());
  for (const int o : groups_.observations) {
    const int view = problem.observations[o].view;
    view_of_.push_back(problem.ViewFixed(view) ? 0 : view);
  }
  for (int view = 1; view < problem.num_views(); ++view) {
    if (problem.ViewFixed(view)) fixed_views_.push_back(view);
  }
  point_fixed_.reserve(problem.num_points);
  for (int i = 0; i < problem.num_points; ++i) point_fixed_.push_back(problem.PointFixed(i));
  std::vector<std::vector<int>> members(problem.num_points);
  for (int i = 0; i < problem.num_points; ++i) {
    for (int k = groups_.begin[i]; k < groups_.begin[i + 1]; ++k) {
      if (view_of_[k] > 0) members[i].push_back(view_of_[k] - 1);
    }
  }
  cameras_ = std::make_unique<CameraSystem>(problem.num_views() - 1, members);
}

StructureSystem::~StructureSystem() = default;

bool StructureSystem::Factor(const std::vector<Eigen::Matrix3d>& S) {
  for (double damping = kDamping; damping < kMaxDamping; damping *= 100.0) {
    EliminatePoints(S, damping);
    if (cameras_->Factor()) return true;
  }
  return false;
}

void StructureSystem::EliminatePoints(const std::vector<Eigen::Matrix3d>& S, double damping) {
  cameras_->SetZero();
  std::vector<Eigen::Matrix3d> G;  // L^-1 S of one point's observations
  for (int i = 0; i < layout_.num_points; ++i) {
    const int begin = groups_.begin[i];
    const int end = groups_.begin[i + 1];
    if (point_fixed_[i]) {
      for (int k = begin; k < end; ++k) {
        const int a = view_of_[k] - 1;
        if (a >= 0) cameras_->Add(a, a, S[groups_.observations[k]]);
      }
      continue;
    }
    Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
    for (int k = begin; k < end; ++k) V += S[groups_.observations[k]];
    const double floor = std::max(kDamping * V.trace(), 1e-300);
    V.diagonal().array() += floor;
    L_point_[i] = Cholesky3(V, floor);
    G.clear();
    for (int k = begin; k < end; ++k) {
      const Eigen::Matrix3d& S_k = S[groups_.observations[k]];
      G.push_back(L_point_[i].triangularView<Eigen::Lower>().solve(S_k));
      const int a = view_of_[k] - 1;
      if (a < 0) continue;
      Eigen::Matrix3d reduced = S_k - G.back().transpose() * G.back();
      reduced.diagonal() += damping * S_k.diagonal();
      cameras_->Add(a, a, reduced);
      for (int l = begin; l < k; ++l) {
        const int b = view_of_[l] - 1;
        if (b < 0) continue;
        const Eigen::Matrix3d block = G.back().transpose() * G[l - begin];
        if (a == b) {
          cameras_->Add(a, a, -block - block.transpose());
        } else {
          cameras_->Add(a, b, -block);
        }
      }
    }
  }
}

Eigen::VectorXd StructureSystem::Solve(const std::vector<Eigen::Matrix3d>& S,
                                       const Eigen::VectorXd& b) const {
  const auto solve_point = [&](int i, Eigen::Vector3d right) -> Eigen::Vector3d {
    L_point_[i].triangularView<Eigen::Lower>().solveInPlace(right);
    L_point_[i].transpose().triangularView<Eigen::Upper>().solveInPlace(right);
    return right;
  };
  Eigen::VectorXd x(layout_.size());
  const int num_center_rows = 3 * (layout_.num_views - 1);
  Eigen::VectorXd reduced = b.head(num_center_rows);
  for (int i = 0; i < layout_.num_points; ++i) {
    if (point_fixed_[i]) continue;
    const Eigen::Vector3d from_point = solve_point(i, b.segment<3>(layout_.Point(i)));
    for (int k = groups_.begin[i]; k < groups_.begin[i + 1]; ++k) {
      if (view_of_[k] == 0) continue;
      reduced.segment<3>(layout_.Center(view_of_[k])) += S[groups_.observations[k]] * from_point;
    }
  }
  x.head(num_center_rows) = cameras_->Solve(reduced);
  for (const int view : fixed_views_) x.segment<3>(layout_.Center(view)).setZero();
  for (int i = 0; i < layout_.num_points; ++i) {
    if (point_fixed_[i]) {
      x.segment<3>(layout_.Point(i)).setZero();
      continue;
    }
    Eigen::Vector3d right = b.segment<3>(layout_.Point(i));
    for (int k = groups_.begin[i]; k < groups_.begin[i + 1]; ++k) {
      if (view_of_[k] == 0) continue;
      right += S[groups_.observations[k]] * x.segment<3>(layout_.Center(view_of_[k]));
    }
    x.segment<3>(layout_.Point(i)) = solve_point(i, right);
  }
  return x;
}

}  // namespace rotslam
