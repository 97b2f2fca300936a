#include "rotodom/averaging/averaging.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// One edge with a free end, as the normal equations want it.
struct Term {
  const RelativeRotation* edge;
  int free_i;  // block of view i among the unknowns, -1 when held
  int free_j;
  Eigen::Matrix3d information;
};

class WindowProblem {
 public:
  WindowProblem(const ViewGraph& graph,
                const RotationMap& cam_from_world,
                const std::set<FrameId>& free_views,
                const AveragingOptions& options)
      : options_(options) {
    for (const FrameId view : free_views) {
      if (!cam_from_world.contains(view))
        throw std::invalid_argument("AverageRotations: a free view has no start");
    }
    std::vector<int> edge_indices;
    bool anchored = false;
    for (const FrameId view : free_views) {
      for (const int index : graph.EdgesOf(view)) {
        const RelativeRotation& edge = graph.edges()[index];
        if (!cam_from_world.contains(edge.i) || !cam_from_world.contains(edge.j)) continue;
        edge_indices.push_back(index);
        anchored |= !free_views.contains(edge.i) || !free_views.contains(edge.j);
      }
    }
    std::sort(edge_indices.begin(), edge_indices.end());
    edge_indices.erase(std::unique(edge_indices.begin(), edge_indices.end()), edge_indices.end());

    std::map<FrameId, int> block;
    for (const FrameId view : free_views) {
      if (!anchored && view == *free_views.begin()) continue;
      block.emplace(view, static_cast<int>(views_.size()));
      views_.push_back(view);
    }
    const double floor_rad = options.edge_floor_deg * kRadFromDeg;
    for (const int index : edge_indices) {
      const RelativeRotation& edge = graph.edges()[index];
      const auto i = block.find(edge.i);
      const auto j = block.find(edge.j);
      const Eigen::Matrix3d covariance =
          edge.covariance + floor_rad * floor_rad * Eigen::Matrix3d::Identity();
      terms_.push_back({&edge,
                        i == block.end() ? -1 : i->second,
                        j == block.end() ? -1 : j->second,
                        covariance.inverse()});
    }
  }

  const std::vector<FrameId>& views() const { return views_; }
  bool IsEmpty() const { return views_.empty() || terms_.empty(); }

  // One re-weighted Gauss-Newton step: a rotation vector for every free view, applied on the left.
  Eigen::VectorXd Step(const RotationMap& cam_from_world) const {
    const int size = 3 * static_cast<int>(views_.size());
    std::vector<Eigen::Triplet<double>> triplets;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
    const auto add_block = [&](int row, int column, const Eigen::Matrix3d& block) {
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) triplets.emplace_back(3 * row + r, 3 * column + c, block(r, c));
      }
    };
    for (const Term& term : terms_) {
      const Rotation& j_from_world = cam_from_world.at(term.edge->j);
      const Rotation& i_from_world = cam_from_world.at(term.edge->i);
      const Rotation predicted = j_from_world * i_from_world.Inverse();
      // Exp(residual) * measured = predicted: the edge's error in the frame of camera j.
      const Eigen::Vector3d residual = (predicted * term.edge->j_from_i.Inverse()).Log();
      const double squared = residual.dot(term.information * residual);
      const double ratio = 1.0 + squared / (options_.loss_sigmas * options_.loss_sigmas);
      const Eigen::Matrix3d W = term.information / (ratio * ratio);
      // Exp(a) R_j R_i^T Exp(-b) = Exp(a - R_ji b) R_ji to first order.
      const Eigen::Matrix3d J_i = -predicted.Matrix();
      if (term.free_j >= 0) {
        add_block(term.free_j, term.free_j, W);
        gradient.segment<3>(3 * term.free_j) += W * residual;
      }
      if (term.free_i >= 0) {
        add_block(term.free_i, term.free_i, J_i.transpose() * W * J_i);
        gradient.segment<3>(3 * term.free_i) += J_i.transpose() * W * residual;
      }
      if (term.free_i >= 0 && term.free_j >= 0) {
        add_block(term.free_j, term.free_i, W * J_i);
        add_block(term.free_i, term.free_j, J_i.transpose() * W);
      }
    }
    // A view without edges, or whose edges have all lost their weight, stays where it is.
    for (int k = 0; k < size; ++k) triplets.emplace_back(k, k, 1e-6);
    Eigen::SparseMatrix<double> H(size, size);
    H.setFromTriplets(triplets.begin(), triplets.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt(H);
    return -ldlt.solve(gradient);
  }

 private:
  const AveragingOptions& options_;
  std::vector<FrameId> views_;
  std::vector<Term> terms_;
};

}  // namespace

std::optional<std::string> AveragingOptions::Problem() const {
  if (window < 1) return OutOfRange("window", window, "at least 1");
  if (!(edge_floor_deg > 0.0)) return OutOfRange("edge_floor_deg", edge_floor_deg, "positive");
  if (!(loss_sigmas > 0.0)) return OutOfRange("loss_sigmas", loss_sigmas, "positive");
  if (!(min_step_deg > 0.0)) return OutOfRange("min_step_deg", min_step_deg, "positive");
  if (max_iterations < 1) return OutOfRange("max_iterations", max_iterations, "at least 1");
  return std::nullopt;
}

RotationMap AverageRotations(const ViewGraph& graph,
                             RotationMap cam_from_world,
                             const std::set<FrameId>& free_views,
                             const AveragingOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *problem);
  }
  const WindowProblem problem(graph, cam_from_world, free_views, options);
  if (problem.IsEmpty()) return cam_from_world;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    const Eigen::VectorXd step = problem.Step(cam_from_world);
    if (!step.allFinite()) break;
    double largest = 0.0;
    for (int k = 0; k < static_cast<int>(problem.views().size()); ++k) {
      const Eigen::Vector3d delta = step.segment<3>(3 * k);
      Rotation& rotation = cam_from_world.at(problem.views()[k]);
      rotation = Rotation::Exp(delta) * rotation;
      largest = std::max(largest, delta.norm());
    }
    if (largest < options.min_step_deg * kRadFromDeg) break;
  }
  return cam_from_world;
}

}  // namespace rotslam
