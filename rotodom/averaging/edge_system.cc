#include "rotodom/averaging/edge_system.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <Eigen/Cholesky>

#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Largest number of free views for dense factorisation; both take the same time at about 25 views
// (averaging_bench).
constexpr int kMostDenseViews = 20;
// Largest change, rad, for which linearised residuals are used. Their error is about half the
// product of change and residual, below 1e-6 rad for residuals of a degree.
constexpr double kLinearTurn = 1e-4;
// Below this many standard deviations the L1 loss is quadratic.
constexpr double kSmallestL1 = 0.1;
// Weight of an edge whose residual equals the scale of the loss.
constexpr double kContradiction = 0.25;
// Damping relative to the largest pivot: a view whose edges have all lost their weight, or a
// component without an anchor, does not move.
constexpr double kDamping = 1e-9;
// Edges with smaller weights are left out of factorisations. Wrong edges join distant views and
// would cause fill-in.
constexpr double kStructuralWeight = 0.1;
constexpr int kTermsPerChunk = 4096;

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

EdgeSystem::EdgeSystem(std::vector<Eigen::Quaterniond> cam_from_world,
                       int num_free,
                       double loss_sigmas,
                       int num_threads)
    : num_free_(num_free),
      squared_scale_(loss_sigmas * loss_sigmas),
      num_threads_(num_threads),
      cam_from_world_(std::move(cam_from_world)),
      turns_(Eigen::VectorXd::Zero(3 * num_free)),
      step_(3 * num_free),
      last_turn_(std::numeric_limits<double>::infinity()) {
  R_c_w_.resize(cam_from_world_.size());
  for (std::size_t k = 0; k < R_c_w_.size(); ++k) R_c_w_[k] = cam_from_world_[k].matrix();
}

void EdgeSystem::AddEdge(int i,
                         int j,
                         const Rotation& j_from_i,
                         const Eigen::Matrix3d& covariance) {
  Term& term = terms_.emplace_back();
  term.i = i;
  term.j = j;
  term.i_from_j = j_from_i.Quaternion().conjugate();
  term.information_in_j = covariance.inverse();
  term.squared_scale = squared_scale_;
}

void EdgeSystem::LinearizeTerms() {
  const int num_terms = static_cast<int>(terms_.size());
  if (num_terms <= kTermsPerChunk) {
    for (Term& term : terms_) LinearizeTerm(term);
    return;
  }
  const int num_chunks = (num_terms + kTermsPerChunk - 1) / kTermsPerChunk;
  ParallelFor(num_chunks, num_threads_, [&](int chunk) {
    const int end = std::min(num_terms, (chunk + 1) * kTermsPerChunk);
    for (int k = chunk * kTermsPerChunk; k < end; ++k) LinearizeTerm(terms_[k]);
  });
}

void EdgeSystem::LinearizeTerm(Term& term) const {
  const Eigen::Quaterniond predicted =
      cam_from_world_[term.j] * cam_from_world_[term.i].conjugate();
  // Exp(residual) * measured = predicted, in the frame of camera j; then rotated to the world's.
  const Eigen::Matrix3d& R_j_w = R_c_w_[term.j];
  term.residual.noalias() = R_j_w.transpose() * LogOf(predicted * term.i_from_j);
  term.information.noalias() = R_j_w.transpose() * term.information_in_j * R_j_w;
}

void EdgeSystem::Linearize(EdgeLoss loss) {
  for (int view = 0; view < num_free_; ++view) {
    const Rotation turn = Rotation::Exp(turns_.segment<3>(3 * view));
    cam_from_world_[view] = (cam_from_world_[view] * turn.Quaternion()).normalized();
    R_c_w_[view] = cam_from_world_[view].matrix();
  }
  turns_.setZero();
  LinearizeTerms();
  Reweight(loss);
}

// Weight and curvature for residual + turn_j - turn_i.
Eigen::Vector3d EdgeSystem::ReweightTerm(Term& term, EdgeLoss loss) const {
  Eigen::Vector3d residual = term.residual;
  if (term.j < num_free_) residual += turns_.segment<3>(3 * term.j);
  if (term.i < num_free_) residual -= turns_.segment<3>(3 * term.i);
  Eigen::Vector3d pull = term.information * residual;
  const double squared = residual.dot(pull);
  if (loss == EdgeLoss::kL1) {
    term.weight = 1.0 / std::sqrt(std::max(squared, kSmallestL1 * kSmallestL1));
    term.curvature = term.weight * term.information;
  } else {
    const double ratio = 1.0 + squared / term.squared_scale;
    term.weight = 1.0 / (ratio * ratio);
    // Second derivative of the loss, at least half the curvature of plain re-weighting. A step is
    // then at most twice the re-weighted one, and the cost cannot grow.
    const double bend =
        std::min(4.0 / (term.squared_scale * ratio), 0.5 / std::max(squared, 1e-300));
    term.curvature = term.weight * (term.information - bend * pull * pull.transpose());
  }
  return pull;
}

// Weights, curvatures and gradient.
void EdgeSystem::Reweight(EdgeLoss loss) {
  step_.setZero();
  for (Term& term : terms_) {
    const Eigen::Vector3d pull = ReweightTerm(term, loss);
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

int EdgeSystem::CountInconsistentViews() const {
  std::vector<int> balance(num_free_, 0);
  for (const Term& term : terms_) {
    const int vote = term.weight < kContradiction ? -1 : 1;
    if (term.i < num_free_) balance[term.i] += vote;
    if (term.j < num_free_) balance[term.j] += vote;
  }
  return static_cast<int>(
      std::count_if(balance.begin(), balance.end(), [](int votes) { return votes < 0; }));
}

double EdgeSystem::AgreedTurn(double exceeding_share) const {
  std::vector<double> squared(static_cast<std::size_t>(num_free_) + 1, 0.0);
  for (const Term& term : terms_) {
    if (term.weight < kContradiction) continue;
    for (const int view : {term.i, term.j}) {
      if (view < num_free_) squared[view] = step_.segment<3>(3 * view).squaredNorm();
    }
  }
  const auto rank = static_cast<std::ptrdiff_t>(exceeding_share * num_free_);
  std::nth_element(squared.begin(), squared.begin() + rank, squared.end(), std::greater<>());
  return std::sqrt(squared[rank]);
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
  if (!solver_) solver_ = std::make_unique<LaplacianSolver>(num_free_);
  laplacian_.resize(terms_.size());
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    const Term& term = terms_[k];
    laplacian_[k] = {term.i, term.j, term.curvature, term.weight > kStructuralWeight};
  }
  return solver_->Solve(laplacian_, kDamping, step_);
}

}  // namespace rotslam
