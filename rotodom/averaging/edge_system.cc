#include "rotodom/averaging/edge_system.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>

namespace rotslam {
namespace {

// Up to here the dense factorisation wins (averaging_bench: equal at about 25 views).
constexpr int kMostDenseViews = 20;
// Larger turns ask for new residuals: the linear ones are wrong by about half the product of turn
// and residual, which is below 1e-6 rad for residuals of a degree.
constexpr double kLinearTurn = 1e-4;
// Residuals smaller than this many standard deviations pull as least squares do.
constexpr double kSmallestL1 = 0.1;
// Weight of an edge whose residual is the loss' scale.
constexpr double kContradiction = 0.25;
// Share of the largest pivot added to all: a view whose edges have all lost their weight, or a
// piece of the graph without an anchor, stays where it is.
constexpr double kDamping = 1e-9;

// Rotation vector of a quaternion near the identity without trigonometry, exact to 1e-10.
Eigen::Vector3d LogOf(const Eigen::Quaterniond& q) {
  const Eigen::Vector3d v = q.w() < 0.0 ? Eigen::Vector3d(-q.vec()) : Eigen::Vector3d(q.vec());
  const double s = v.squaredNorm();
  // asin(x) / x with x = |v|.
  if (s < 1e-3) return (2.0 + s * (1.0 / 3.0 + s * (3.0 / 20.0 + s * (5.0 / 56.0)))) * v;
  const double sine = std::sqrt(s);
  return (2.0 * std::atan2(sine, std::abs(q.w())) / sine) * v;
}

}  // namespace

// The lower triangle by blocks of 3x3: pattern and elimination order found once, values written in
// place at every step.
struct EdgeSystem::Sparse {
  Eigen::SparseMatrix<double> H;
  std::vector<std::array<int, 3>> diagonal;      // per view: where its block's columns begin
  std::vector<std::array<int, 3>> off_diagonal;  // per term; -1 with a held end
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt;

  Sparse(int num_free, const std::vector<Term>& terms) {
    std::vector<std::vector<int>> rows(num_free);  // blocks below the diagonal, by block column
    for (const Term& term : terms) {
      if (std::max(term.i, term.j) >= num_free) continue;
      rows[std::min(term.i, term.j)].push_back(std::max(term.i, term.j));
    }
    H.resize(3 * num_free, 3 * num_free);
    std::vector<int> first(num_free);
    int count = 0;
    for (int view = 0; view < num_free; ++view) {
      std::sort(rows[view].begin(), rows[view].end());
      rows[view].erase(std::unique(rows[view].begin(), rows[view].end()), rows[view].end());
      first[view] = count;
      count += 9 * (1 + static_cast<int>(rows[view].size()));
    }
    H.resizeNonZeros(count);
    diagonal.resize(num_free);
    const auto height = [&](int view) { return 3 * (1 + static_cast<int>(rows[view].size())); };
    for (int view = 0; view < num_free; ++view) {
      for (int c = 0; c < 3; ++c) {
        const int begin = first[view] + c * height(view);
        H.outerIndexPtr()[3 * view + c] = begin;
        diagonal[view][c] = begin;
        int* inner = H.innerIndexPtr() + begin;
        for (int r = 0; r < 3; ++r) *inner++ = 3 * view + r;
        for (const int row : rows[view]) {
          for (int r = 0; r < 3; ++r) *inner++ = 3 * row + r;
        }
      }
    }
    H.outerIndexPtr()[3 * num_free] = count;
    off_diagonal.reserve(terms.size());
    for (const Term& term : terms) {
      off_diagonal.push_back({-1, -1, -1});
      if (std::max(term.i, term.j) >= num_free) continue;
      const int column = std::min(term.i, term.j);
      const std::vector<int>& in_column = rows[column];
      const auto place =
          std::lower_bound(in_column.begin(), in_column.end(), std::max(term.i, term.j));
      const int below = 3 * (1 + static_cast<int>(place - in_column.begin()));
      for (int c = 0; c < 3; ++c) {
        off_diagonal.back()[c] = first[column] + c * height(column) + below;
      }
    }
    std::fill_n(H.valuePtr(), count, 1.0);
    ldlt.analyzePattern(H);
  }
};

EdgeSystem::EdgeSystem(std::vector<Eigen::Quaterniond> cam_from_world,
                       int num_free,
                       double loss_sigmas)
    : num_free_(num_free),
      squared_scale_(loss_sigmas * loss_sigmas),
      cam_from_world_(std::move(cam_from_world)),
      turns_(Eigen::VectorXd::Zero(3 * num_free)),
      step_(3 * num_free),
      last_turn_(std::numeric_limits<double>::infinity()) {
  R_c_w_.resize(cam_from_world_.size());
  for (std::size_t k = 0; k < R_c_w_.size(); ++k) R_c_w_[k] = cam_from_world_[k].matrix();
}

EdgeSystem::EdgeSystem(EdgeSystem&&) noexcept = default;
EdgeSystem::~EdgeSystem() = default;

void EdgeSystem::AddEdge(int i,
                         int j,
                         const Rotation& j_from_i,
                         const Eigen::Matrix3d& covariance) {
  Term& term = terms_.emplace_back();
  term.i = i;
  term.j = j;
  term.i_from_j = j_from_i.Quaternion().conjugate();
  term.information_in_j = covariance.inverse();
}

void EdgeSystem::Linearize(EdgeLoss loss) {
  for (int view = 0; view < num_free_; ++view) {
    const Rotation turn = Rotation::Exp(turns_.segment<3>(3 * view));
    cam_from_world_[view] = (cam_from_world_[view] * turn.Quaternion()).normalized();
    R_c_w_[view] = cam_from_world_[view].matrix();
  }
  turns_.setZero();
  for (Term& term : terms_) {
    const Eigen::Quaterniond predicted =
        cam_from_world_[term.j] * cam_from_world_[term.i].conjugate();
    // Exp(residual) * measured = predicted, in the frame of camera j; then turned to the world's.
    const Eigen::Matrix3d& R_j_w = R_c_w_[term.j];
    term.residual.noalias() = R_j_w.transpose() * LogOf(predicted * term.i_from_j);
    term.information.noalias() = R_j_w.transpose() * term.information_in_j * R_j_w;
  }
  Reweight(loss);
}

// Weights and gradient for residual + turn_j - turn_i.
void EdgeSystem::Reweight(EdgeLoss loss) {
  step_.setZero();
  for (Term& term : terms_) {
    Eigen::Vector3d residual = term.residual;
    if (term.j < num_free_) residual += turns_.segment<3>(3 * term.j);
    if (term.i < num_free_) residual -= turns_.segment<3>(3 * term.i);
    const Eigen::Vector3d pull = term.information * residual;
    const double squared = residual.dot(pull);
    if (loss == EdgeLoss::kL1) {
      term.weight = 1.0 / std::sqrt(std::max(squared, kSmallestL1 * kSmallestL1));
      term.curvature = term.weight * term.information;
    } else {
      const double ratio = 1.0 + squared / squared_scale_;
      term.weight = 1.0 / (ratio * ratio);
      // The loss' own second derivative, not less than half of what plain re-weighting takes: then
      // no step goes beyond twice the re-weighted one, and the cost cannot grow.
      const double bend = std::min(4.0 / (squared_scale_ * ratio), 0.5 / std::max(squared, 1e-300));
      term.curvature = term.weight * (term.information - bend * pull * pull.transpose());
    }
    if (term.j < num_free_) step_.segment<3>(3 * term.j) -= term.weight * pull;
    if (term.i < num_free_) step_.segment<3>(3 * term.i) += term.weight * pull;
  }
}

double EdgeSystem::Step(EdgeLoss loss) {
  if (last_turn_ > kLinearTurn) {
    Linearize(loss);
  } else {
    Reweight(loss);
  }
  if (!(num_free_ <= kMostDenseViews ? SolveDense() : SolveSparse())) return -1.0;
  if (!step_.allFinite()) return -1.0;
  turns_ += step_;
  double largest = 0.0;
  for (int view = 0; view < num_free_; ++view) {
    largest = std::max(largest, step_.segment<3>(3 * view).squaredNorm());
  }
  last_turn_ = std::sqrt(largest);
  return last_turn_;
}

bool EdgeSystem::HasDoubtfulView() const {
  std::vector<int> balance(num_free_, 0);
  for (const Term& term : terms_) {
    const int vote = term.weight < kContradiction ? -1 : 1;
    if (term.i < num_free_) balance[term.i] += vote;
    if (term.j < num_free_) balance[term.j] += vote;
  }
  return std::any_of(balance.begin(), balance.end(), [](int votes) { return votes < 0; });
}

Rotation EdgeSystem::CamFromWorld(int view) const {
  const Rotation rotation(cam_from_world_[view]);
  return view < num_free_ ? rotation * Rotation::Exp(turns_.segment<3>(3 * view)) : rotation;
}

Eigen::MatrixXd EdgeSystem::DenseNormalMatrix() const {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * num_free_, 3 * num_free_);
  for (const Term& term : terms_) {
    const Eigen::Matrix3d& W = term.curvature;
    const bool free_i = term.i < num_free_;
    const bool free_j = term.j < num_free_;
    if (free_i) H.block<3, 3>(3 * term.i, 3 * term.i) += W;
    if (free_j) H.block<3, 3>(3 * term.j, 3 * term.j) += W;
    if (free_i && free_j) {
      H.block<3, 3>(3 * std::max(term.i, term.j), 3 * std::min(term.i, term.j)) -= W;
    }
  }
  const double damping = kDamping * H.diagonal().maxCoeff();
  H.diagonal().array() += damping;
  return H;
}

bool EdgeSystem::SolveDense() {
  dense_ = DenseNormalMatrix();
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(dense_);
  if (llt.info() != Eigen::Success) return false;
  llt.solveInPlace(step_);
  return true;
}

bool EdgeSystem::SolveSparse() {
  if (!sparse_) sparse_ = std::make_unique<Sparse>(num_free_, terms_);
  double* values = sparse_->H.valuePtr();
  std::fill_n(values, sparse_->H.nonZeros(), 0.0);
  const auto add = [&](const std::array<int, 3>& columns, double factor, const Eigen::Matrix3d& W) {
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) values[columns[c] + r] += factor * W(r, c);
    }
  };
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    const Term& term = terms_[k];
    if (term.i < num_free_) add(sparse_->diagonal[term.i], 1.0, term.curvature);
    if (term.j < num_free_) add(sparse_->diagonal[term.j], 1.0, term.curvature);
    if (sparse_->off_diagonal[k][0] >= 0) {
      add(sparse_->off_diagonal[k], -1.0, term.curvature);
    }
  }
  double largest = 0.0;
  for (const auto& columns : sparse_->diagonal) {
    for (int c = 0; c < 3; ++c) largest = std::max(largest, values[columns[c] + c]);
  }
  for (const auto& columns : sparse_->diagonal) {
    for (int c = 0; c < 3; ++c) values[columns[c] + c] += kDamping * largest;
  }
  sparse_->ldlt.factorize(sparse_->H);
  if (sparse_->ldlt.info() != Eigen::Success) return false;
  step_ = sparse_->ldlt.solve(step_);
  return true;
}

}  // namespace rotslam
