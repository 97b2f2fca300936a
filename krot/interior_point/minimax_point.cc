#include "krot/interior_point/minimax_point.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Dense>

#include "krot/interior_point/interior_start.h"
#include "krot/interior_point/step_rule.h"

namespace rotslam {
namespace {

using Six = Eigen::Array<double, 6, 1>;
using Sixes = std::vector<Six>;

// Bounds on the depths of one program, in units of the reference depths.
constexpr double kNearest = 0.1;
constexpr double kFarthest = 10.0;

// One program: min s  s.t.  +-(x, y) - gamma d <= s depth_o,  depth_o / 10 <= d <= 10 depth_o, in
// rows a_k . u - sigma_k s + r_k = b_k; the first four sigma are the reference depth, and the fifth
// where depths are still to be made positive.
class PointProgram {
 public:
  PointProgram(std::span<const AffineProjection> projections,
               double gamma,
               std::vector<double> depths,
               bool slack_on_depth)
      : projections_(projections),
        gamma_(gamma),
        depths_(std::move(depths)),
        slack_on_depth_(slack_on_depth) {}

  int size() const { return static_cast<int>(projections_.size()); }

  Six Sigma(int o) const {
    const double d = depths_[o];
    return {d, d, d, d, slack_on_depth_ ? d : 0.0, 0.0};
  }
  // a_k . u
  Six Apply(int o, const Eigen::Vector3d& u) const { return Rows(projections_[o].A * u); }
  // b_k
  Six Right(int o) const {
    Six right = -Rows(projections_[o].b);
    right[4] -= kNearest * depths_[o];
    right[5] += kFarthest * depths_[o];
    return right;
  }
  // sum y_k a_k
  Eigen::Vector3d Transposed(int o, const Six& y) const {
    return projections_[o].A.transpose() *
           Eigen::Vector3d(
               y[0] - y[1], y[2] - y[3], -gamma_ * (y[0] + y[1] + y[2] + y[3]) - y[4] + y[5]);
  }
  // sum D_k a_k a_k^T
  Eigen::Matrix3d Normal(int o, const Six& D) const {
    const double x = D[0] + D[1];
    const double y = D[2] + D[3];
    const double xz = gamma_ * (D[1] - D[0]);
    const double yz = gamma_ * (D[3] - D[2]);
    Eigen::Matrix3d weight;
    weight << x, 0.0, xz, 0.0, y, yz, xz, yz, gamma_ * gamma_ * (x + y) + D[4] + D[5];
    return projections_[o].A.transpose() * weight * projections_[o].A;
  }

 private:
  Six Rows(const Eigen::Vector3d& m) const {
    const double margin = gamma_ * m.z();
    return {m.x() - margin, -m.x() - margin, m.y() - margin, -m.y() - margin, -m.z(), m.z()};
  }

  std::span<const AffineProjection> projections_;
  double gamma_;
  std::vector<double> depths_;
  bool slack_on_depth_;
};

struct PointIterate {
  Eigen::Vector3d u;
  double s = 0.0;
  Sixes y;
  Sixes r;
};

void UpdateRows(const PointProgram& program, PointIterate& at) {
  for (int o = 0; o < program.size(); ++o) {
    at.r[o] = program.Right(o) + program.Sigma(o) * at.s - program.Apply(o, at.u);
  }
}

PointIterate Start(const PointProgram& program, const Eigen::Vector3d& u, double margin) {
  PointIterate at;
  at.u = u;
  StartRows(program, margin, UpdateRows, at);
  return at;
}

// Predictor and corrector on the four unknowns (u, s).
bool NewtonStep(const PointProgram& program, PointIterate& at) {
  const int m = program.size();
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  Eigen::Vector4d residual(0.0, 0.0, 0.0, 1.0);  // of dual feasibility
  for (int o = 0; o < m; ++o) {
    const Six D = at.y[o] / at.r[o];
    const Six sigma = program.Sigma(o);
    H.topLeftCorner<3, 3>() += program.Normal(o, D);
    H.topRightCorner<3, 1>() -= program.Transposed(o, D * sigma);
    H(3, 3) += (D * sigma * sigma).sum();
    residual.head<3>() -= program.Transposed(o, at.y[o]);
    residual[3] -= (sigma * at.y[o]).sum();
  }
  H.bottomLeftCorner<1, 3>() = H.topRightCorner<3, 1>().transpose();
  const Eigen::LDLT<Eigen::Matrix4d> factor(H);
  const double mu = Complementarity(at) / (6.0 * m);
  double target = 0.0;
  double trust = 0.0;
  Sixes dr(m, Six::Zero());
  Sixes dy(m, Six::Zero());
  Eigen::Vector4d step;
  for (const bool predict : {true, false}) {
    Eigen::Vector4d g(residual[0], residual[1], residual[2], -residual[3]);
    Sixes shift(m);
    for (int o = 0; o < m; ++o) {
      shift[o] = (target - trust * dr[o] * dy[o]) / at.r[o] - at.y[o];
      g.head<3>() -= program.Transposed(o, shift[o]);
      g[3] += (program.Sigma(o) * shift[o]).sum();
    }
    step = factor.solve(g);
    if (!step.allFinite()) return false;
    for (int o = 0; o < m; ++o) {
      dr[o] = program.Sigma(o) * step[3] - program.Apply(o, step.head<3>());
      dy[o] = shift[o] - at.y[o] / at.r[o] * dr[o];
    }
    if (!predict) break;
    const Reach reach = ReachOf(at.r, dr, at.y, dy);
    const double sum = ProductsAfter(at.r, dr, at.y, dy, reach);
    target = TargetProduct(std::pow(sum / (6.0 * m) / mu, 3), mu);
    trust = reach.primal * reach.dual;
  }
  const Reach reach = ReachOf(at.r, dr, at.y, dy);
  const double primal = kShareOfReach * reach.primal;
  const double dual = kShareOfReach * reach.dual;
  const Sixes before = at.r;
  at.u += primal * step.head<3>();
  at.s += primal * step[3];
  UpdateRows(program, at);
  for (int o = 0; o < m; ++o) {
    at.r[o] = KeptPositive(at.r[o], before[o], dr[o], primal);
    at.y[o] += dual * dy[o];
  }
  return true;
}

// True when the multipliers prove that no |u| <= extent has all residuals at most gamma: the rows
// say a_k . u <= b_k, so sum y a = e and sum y b < -extent |e| cannot both be.
bool Proves(std::span<const AffineProjection> projections,
            double gamma,
            const Sixes& multipliers,
            double extent) {
  constexpr double kEpsilon = 2.3e-16;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double absolute = 0.0;
  double right = 0.0;
  double absolute_right = 0.0;
  for (std::size_t o = 0; o < projections.size(); ++o) {
    const Six y = multipliers[o].max(0.0);
    const Eigen::Vector3d weights(
        y[0] - y[1], y[2] - y[3], -gamma * (y[0] + y[1] + y[2] + y[3]) - y[4]);
    const double size = y[0] + y[1] + y[2] + y[3] + y[4];
    sum += projections[o].A.transpose() * weights;
    absolute += size * (1.0 + gamma) * projections[o].A.cwiseAbs().maxCoeff();
    right -= projections[o].b.dot(weights);
    absolute_right += size * (1.0 + gamma) * projections[o].b.cwiseAbs().maxCoeff();
  }
  const double terms = 8.0 * (static_cast<double>(projections.size()) + 8.0);
  const double imbalance = sum.lpNorm<1>() + 3.0 * terms * kEpsilon * absolute;
  return right + extent * imbalance + 3.0 * terms * kEpsilon * absolute_right < 0.0;
}

double LeastDepth(std::span<const AffineProjection> projections, const Eigen::Vector3d& u) {
  double least = kInfinity;
  for (const AffineProjection& projection : projections) {
    least = std::min(least, projection.A.row(2).dot(u) + projection.b.z());
  }
  return least;
}

class PointSearch {
 public:
  PointSearch(std::span<const AffineProjection> projections, const MinimaxPointOptions& options)
      : projections_(projections), options_(options) {
    for (const AffineProjection& projection : projections) {
      scale_ = std::max(scale_, projection.b.cwiseAbs().maxCoeff());
    }
  }

  MinimaxPoint Run(const Eigen::Vector3d& start) {
    Offer(start);
    if (!Done()) Offer(LeastSquaresPoint(projections_));
    if (best_.gamma_high == kInfinity) MakeDepthsPositive(start);
    if (best_.gamma_high == kInfinity) return best_;
    double gamma = 0.9 * best_.gamma_high;
    for (int k = 0; k < options_.max_programs && !Done(); ++k) gamma = Improve(gamma);
    return best_;
  }

 private:
  bool Done() const {
    return best_.gamma_high <= options_.good_enough ||
           best_.gamma_high - best_.gamma_low <= options_.relative_gap * best_.gamma_high;
  }

  void Offer(const Eigen::Vector3d& u) {
    const double residual = MaxPointResidual(projections_, u);
    if (residual >= best_.gamma_high) return;
    best_.gamma_high = residual;
    best_.position = u;
  }

  // Solves the program at `gamma` around the best position. Returns the next gamma.
  double Improve(double gamma) {
    std::vector<double> depths;
    depths.reserve(projections_.size());
    for (const AffineProjection& projection : projections_) {
      depths.push_back(projection.A.row(2).dot(best_.position) + projection.b.z());
    }
    const PointProgram program(projections_, gamma, std::move(depths), false);
    PointIterate at = Start(program, best_.position, 0.3 * best_.gamma_high);
    constexpr int kMaxSteps = 40;
    for (int step = 0; step < kMaxSteps; ++step) {
      if (!NewtonStep(program, at)) break;
      const double gap = Complementarity(at);
      if (gap <= std::max(0.05 * options_.relative_gap * gamma, 0.05 * std::abs(at.s))) break;
    }
    Offer(at.u);
    if (at.s > 0.0) {
      const bool proven = gamma <= best_.gamma_low || ProvesRepaired(gamma, at.y);
      if (proven) best_.gamma_low = std::max(best_.gamma_low, gamma);
      // The next gamma is a little lower after each one that was not proven infeasible.
      num_unproven_ = proven ? 0 : num_unproven_ + 1;
      const double share = std::min(0.99, 0.8 + 0.05 * num_unproven_);
      return best_.gamma_high * (1.0 - share * options_.relative_gap);
    }
    return std::min(best_.gamma_high, gamma + at.s) * (1.0 - 0.4 * options_.relative_gap);
  }

  // Proves() after up to kMaxRepairs weighted least-squares steps towards sum y a = 0.
  bool ProvesRepaired(double gamma, Sixes y) const {
    const PointProgram program(projections_, gamma, {}, false);
    for (Six& of_row : y) of_row[5] = 0.0;
    constexpr int kMaxRepairs = 6;
    for (int round = 0; round < kMaxRepairs; ++round) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int o = 0; o < program.size(); ++o) {
        H += program.Normal(o, y[o]);
        sum += program.Transposed(o, y[o]);
      }
      const Eigen::Vector3d lambda = H.ldlt().solve(sum);
      if (!lambda.allFinite()) return false;
      for (int o = 0; o < program.size(); ++o) {
        y[o] = (y[o] * (1.0 - program.Apply(o, lambda))).max(0.0);
      }
      if (Proves(projections_, gamma, y, options_.max_extent * scale_)) return true;
    }
    return false;
  }

  void MakeDepthsPositive(const Eigen::Vector3d& start) {
    constexpr int kMaxSteps = 40;
    for (const double gamma : {1.0, 10.0, 100.0}) {
      const std::vector<double> depths(projections_.size(), std::max(1e-6, scale_));
      const PointProgram program(projections_, gamma, depths, true);
      PointIterate at = Start(program, start.allFinite() ? start : Eigen::Vector3d::Zero(), 1.0);
      for (int step = 0; step < kMaxSteps && NewtonStep(program, at); ++step) {
        if (LeastDepth(projections_, at.u) > 0.0) break;
      }
      Offer(at.u);
      if (best_.gamma_high < kInfinity) return;
    }
  }

  std::span<const AffineProjection> projections_;
  MinimaxPointOptions options_;
  double scale_ = 0.0;
  int num_unproven_ = 0;
  MinimaxPoint best_;
};

}  // namespace

AffineProjection ProjectionOfPoint(const Eigen::Matrix3d& R_c_w,
                                   const Eigen::Vector3d& center_in_world,
                                   const Eigen::Vector2d& xy) {
  AffineProjection projection;
  projection.A = R_c_w;
  projection.A.topRows<2>() -= xy * R_c_w.row(2);
  projection.b = -projection.A * center_in_world;
  return projection;
}

double MaxPointResidual(std::span<const AffineProjection> projections,
                        const Eigen::Vector3d& position) {
  double largest = 0.0;
  for (const AffineProjection& projection : projections) {
    const Eigen::Vector3d m = projection.A * position + projection.b;
    if (!(m.z() > 0.0)) return kInfinity;
    const double residual = m.head<2>().cwiseAbs().maxCoeff() / m.z();
    if (!(residual < kInfinity)) return kInfinity;
    largest = std::max(largest, residual);
  }
  return largest;
}

Eigen::Vector3d LeastSquaresPoint(std::span<const AffineProjection> projections) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  for (const AffineProjection& projection : projections) {
    const auto rows = projection.A.topRows<2>();
    H += rows.transpose() * rows;
    g -= rows.transpose() * projection.b.head<2>();
  }
  H.diagonal().array() += 1e-12 * H.trace();
  return H.ldlt().solve(g);
}

MinimaxPoint FindMinimaxPoint(std::span<const AffineProjection> projections,
                              const Eigen::Vector3d& start,
                              const MinimaxPointOptions& options) {
  return PointSearch(projections, options).Run(start);
}

}  // namespace rotslam
