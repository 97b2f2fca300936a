#include "krot/linear_start.h"

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>

#include "rotodom/types/rotation.h"

namespace rotslam {
namespace {

// Sine of the angle below which two rays give no depth.
constexpr double kMinSine = 1e-6;
constexpr int kInverseIterations = 30;

// One sighting of a point.
struct Ray {
  int view = 0;
  Eigen::Vector3d direction;  // unit, world axes
};

// A point on `left`'s ray, at the depth where `right`'s passes closest:
// X = c_left + u_left (depth . (c_right - c_left)).
struct Base {
  int left = -1;  // positions among the point's rays
  int right = -1;
  double sine = 0.0;
  Eigen::Vector3d depth;
};

// The two rays that tell the depth best.
Base ChooseBase(const std::vector<Ray>& rays) {
  Base base;
  for (int a = 0; a < static_cast<int>(rays.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(rays.size()); ++b) {
      const double sine = rays[a].direction.cross(rays[b].direction).norm();
      if (!(sine > kMinSine) || !(sine > base.sine)) continue;
      base.left = a;
      base.right = b;
      base.sine = sine;
    }
  }
  if (base.left < 0) return base;
  const Eigen::Vector3d& u = rays[base.right].direction;
  base.depth = u.cross(rays[base.left].direction).cross(u) / (base.sine * base.sine);
  return base;
}

class LinearStart {
 public:
  explicit LinearStart(const MinimaxProblem& problem)
      : num_views_(problem.num_views()), rays_of_(problem.num_points) {
    for (const ImageObservation& observation : problem.observations) {
      Ray ray;
      ray.view = observation.view;
      ray.direction =
          problem.R_c_w[observation.view].transpose() * observation.xy.homogeneous().normalized();
      rays_of_[observation.point].push_back(ray);
    }
    bases_.reserve(rays_of_.size());
    for (const std::vector<Ray>& rays : rays_of_) bases_.push_back(ChooseBase(rays));
  }

  std::optional<MinimaxStructure> Solve() {
    if (!SolveCenters()) return std::nullopt;
    PlacePoints();
    return std::move(structure_);
  }

 private:
  // Rays of one point as equations u x (X - c) = 0, each in three centres.
  void AddEquations(const std::vector<Ray>& rays,
                    const Base& base,
                    std::vector<Eigen::Triplet<double>>& triplets) const {
    const Ray& left = rays[base.left];
    const Ray& right = rays[base.right];
    const Eigen::Matrix3d by_right = left.direction * base.depth.transpose();
    const Eigen::Matrix3d by_left = Eigen::Matrix3d::Identity() - by_right;
    for (int k = 0; k < static_cast<int>(rays.size()); ++k) {
      if (k == base.left) continue;
      const Ray& ray = rays[k];
      // Taken out again what ChooseBase's depth has divided by.
      const double weight = base.sine * base.sine;
      const Eigen::Matrix3d cross = Skew(ray.direction);
      const std::array<int, 3> views = {left.view, right.view, ray.view};
      const std::array<Eigen::Matrix3d, 3> J = {
          Eigen::Matrix3d(cross * by_left), Eigen::Matrix3d(cross * by_right), -cross};
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b)
          AddBlock(views[a], views[b], weight * J[a].transpose() * J[b], triplets);
      }
    }
  }

  // The first view is the origin and has no unknowns.
  static void AddBlock(int view_a,
                       int view_b,
                       const Eigen::Matrix3d& block,
                       std::vector<Eigen::Triplet<double>>& triplets) {
    if (view_a == 0 || view_b == 0) return;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        triplets.emplace_back(
            3 * (view_a - 1) + row, 3 * (view_b - 1) + column, block(row, column));
      }
    }
  }

  // The centres of unit length that miss the equations least: an eigenvector.
  bool SolveCenters() {
    const int size = 3 * (num_views_ - 1);
    std::vector<Eigen::Triplet<double>> triplets;
    for (std::size_t i = 0; i < rays_of_.size(); ++i) {
      if (bases_[i].left >= 0) AddEquations(rays_of_[i], bases_[i], triplets);
    }
    Eigen::SparseMatrix<double> normal(size, size);
    normal.setFromTriplets(triplets.begin(), triplets.end());
    const double mean_diagonal = normal.diagonal().sum() / size;
    if (!(mean_diagonal > 0.0)) return false;
    Eigen::SparseMatrix<double> identity(size, size);
    identity.setIdentity();
    normal += 1e-12 * mean_diagonal * identity;
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(normal);
    if (factor.info() != Eigen::Success) return false;
    Eigen::VectorXd centers(size);
    for (int k = 0; k < size; ++k) centers[k] = std::sin(1.0 + k);
    for (int k = 0; k < kInverseIterations; ++k) {
      centers = factor.solve(centers.normalized()).eval();
      if (!centers.allFinite()) return false;
    }
    centers.normalize();
    structure_.center_in_world.assign(num_views_, Eigen::Vector3d::Zero());
    for (int view = 1; view < num_views_; ++view) {
      structure_.center_in_world[view] = centers.segment<3>(3 * (view - 1));
    }
    return true;
  }

  // Points, and the sign that puts most of them in front.
  void PlacePoints() {
    structure_.point_in_world.assign(rays_of_.size(), Eigen::Vector3d::Zero());
    int in_front = 0;
    for (std::size_t i = 0; i < rays_of_.size(); ++i) {
      const Base& base = bases_[i];
      if (base.left < 0) continue;
      const Ray& left = rays_of_[i][base.left];
      const Eigen::Vector3d& from = structure_.center_in_world[left.view];
      const Eigen::Vector3d& to = structure_.center_in_world[rays_of_[i][base.right].view];
      const double depth = base.depth.dot(to - from);
      in_front += depth > 0.0 ? 1 : -1;
      structure_.point_in_world[i] = from + depth * left.direction;
    }
    if (in_front >= 0) return;
    for (Eigen::Vector3d& center : structure_.center_in_world) center = -center;
    for (Eigen::Vector3d& point : structure_.point_in_world) point = -point;
  }

  int num_views_;
  std::vector<std::vector<Ray>> rays_of_;  // by point
  std::vector<Base> bases_;                // by point
  MinimaxStructure structure_;
};

}  // namespace

std::optional<MinimaxStructure> SolveLinearStart(const MinimaxProblem& problem) {
  CheckProblem(problem);
  if (problem.num_views() < 2) return std::nullopt;
  return LinearStart(problem).Solve();
}

}  // namespace rotslam
