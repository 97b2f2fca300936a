#include "rotodom/averaging/orientation_covariance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "rotodom/averaging/edge_system.h"

namespace rotslam {
namespace {

// Variance of a view without an edge to earlier views, rad^2: its orientation is unknown.
constexpr double kUnknownVariance = std::numbers::pi * std::numbers::pi;

std::vector<std::uint64_t> Bits(std::span<const std::array<int, 2>> pairs, int end) {
  std::vector<std::uint64_t> bits;
  for (const std::array<int, 2>& pair : pairs) {
    const std::size_t word = static_cast<std::size_t>(pair[end]) / 64;
    if (word >= bits.size()) bits.resize(word + 1, 0);
    bits[word] |= std::uint64_t{1} << (pair[end] % 64);
  }
  return bits;
}

int CountCommon(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b) {
  int count = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k)
    count += std::popcount(a[k] & b[k]);
  return count;
}

Eigen::Matrix3d Symmetric(const Eigen::Matrix3d& matrix) {
  return 0.5 * (matrix + matrix.transpose());
}

Eigen::Matrix3d SymmetricRoot(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose();
}

}  // namespace

OrientationCovariance::OrientationCovariance(const AveragingOptions& options) : options_(options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *problem);
  }
}

void OrientationCovariance::AddView(FrameId view,
                                    std::span<const SupportedEdge> edges,
                                    const RotationMap& cam_from_world,
                                    const std::set<FrameId>& free_views) {
  for (int slot = 0; slot < static_cast<int>(views_.size()); ++slot) {
    // Views that were free in the last solve and are fixed in this one.
    if (views_[slot].is_used && !views_[slot].is_settled && !free_views.contains(views_[slot].id)) {
      Settle(slot);
    }
  }
  const int slot = NewView(view);
  for (const SupportedEdge& supported : edges) AddEdge(supported, cam_from_world);
  const bool is_tied = std::any_of(edges_.begin(), edges_.end(), [&](const Edge& edge) {
    return edge.is_used && (edge.i == slot || edge.j == slot);
  });
  if (!is_tied) {
    views_[slot].is_settled = true;
    anchor_covariance_[slot * view_capacity_ + slot] =
        (num_added_ == 1 ? 0.0 : kUnknownVariance) * Eigen::Matrix3d::Identity();
  }
  DropOldViews();
  BuildSystem(cam_from_world, free_views);
}

std::optional<Eigen::Matrix3d> OrientationCovariance::Of(FrameId view) const {
  const int slot = SlotOf(view);
  if (slot < 0) return std::nullopt;
  const Row row = RowOf(slot);
  const Eigen::Matrix3d& R_c_w = views_[slot].R_c_w;
  return Symmetric(R_c_w * Covariance(row, row) * R_c_w.transpose());
}

std::optional<Eigen::Matrix3d> OrientationCovariance::Between(FrameId i, FrameId j) const {
  const int slot_i = SlotOf(i);
  const int slot_j = SlotOf(j);
  if (slot_i < 0 || slot_j < 0) return std::nullopt;
  const Row row_i = RowOf(slot_i);
  const Row row_j = RowOf(slot_j);
  const Eigen::Matrix3d cross = Covariance(row_i, row_j);
  const Eigen::Matrix3d in_world =
      Covariance(row_i, row_i) + Covariance(row_j, row_j) - cross - cross.transpose();
  const Eigen::Matrix3d& R_c_w = views_[slot_j].R_c_w;
  return Symmetric(R_c_w * in_world * R_c_w.transpose());
}

int OrientationCovariance::SlotOf(FrameId view) const {
  for (int slot = 0; slot < static_cast<int>(views_.size()); ++slot) {
    if (views_[slot].is_used && views_[slot].id == view) return slot;
  }
  return -1;
}

int OrientationCovariance::NewView(FrameId view) {
  if (SlotOf(view) >= 0) {
    throw std::invalid_argument("OrientationCovariance: a view comes a second time");
  }
  ++num_added_;
  int slot = 0;
  while (slot < static_cast<int>(views_.size()) && views_[slot].is_used) ++slot;
  if (slot == static_cast<int>(views_.size())) views_.emplace_back();
  if (slot >= view_capacity_) {
    const int capacity = std::max(32, 2 * view_capacity_);
    std::vector<Eigen::Matrix3d> covariance(capacity * capacity, Eigen::Matrix3d::Zero());
    std::vector<Eigen::Matrix3d> gains(edges_.size() * capacity, Eigen::Matrix3d::Zero());
    for (int a = 0; a < view_capacity_; ++a) {
      for (int b = 0; b < view_capacity_; ++b) {
        covariance[a * capacity + b] = anchor_covariance_[a * view_capacity_ + b];
      }
      for (std::size_t e = 0; e < edges_.size(); ++e) {
        gains[e * capacity + a] = gains_[e * view_capacity_ + a];
      }
    }
    anchor_covariance_ = std::move(covariance);
    gains_ = std::move(gains);
    view_capacity_ = capacity;
  }
  for (int other = 0; other < view_capacity_; ++other) {
    anchor_covariance_[slot * view_capacity_ + other].setZero();
    anchor_covariance_[other * view_capacity_ + slot].setZero();
  }
  for (int edge = 0; edge < static_cast<int>(edges_.size()); ++edge) Gain(slot, edge).setZero();
  views_[slot] = View{};
  views_[slot].id = view;
  views_[slot].is_used = true;
  views_[slot].number = num_added_;
  views_[slot].last_edge = num_added_;
  return slot;
}

void OrientationCovariance::AddEdge(const SupportedEdge& supported,
                                    const RotationMap& cam_from_world) {
  const int i = SlotOf(supported.edge.i);
  const int j = SlotOf(supported.edge.j);
  if (i < 0 || j < 0) return;
  int slot = 0;
  while (slot < static_cast<int>(edges_.size()) && edges_[slot].is_used) ++slot;
  if (slot == static_cast<int>(edges_.size())) {
    edges_.emplace_back();
    gains_.resize(edges_.size() * view_capacity_, Eigen::Matrix3d::Zero());
  }
  Edge& edge = edges_[slot];
  edge = Edge{};
  edge.is_used = true;
  edge.i = i;
  edge.j = j;
  edge.j_from_i = supported.edge.j_from_i;
  edge.covariance_in_j = supported.edge.covariance;
  const Eigen::Matrix3d R_j_w = cam_from_world.at(supported.edge.j).Matrix();
  const Eigen::Matrix3d in_world = R_j_w.transpose() * supported.edge.covariance * R_j_w;
  edge.root =
      SymmetricRoot(0.5 * options_.edge_error_factor * options_.edge_error_factor * in_world);
  edge.begin = views_[i].number;
  edge.end = views_[j].number;
  edge.num_keypoints = static_cast<int>(supported.keypoint_pairs.size());
  edge.keypoints_i = Bits(supported.keypoint_pairs, 0);
  edge.keypoints_j = Bits(supported.keypoint_pairs, 1);
  // Each of its two views contributes one unit of noise.
  edge.shared.push_back({slot, 2.0});
  for (int other = 0; other < static_cast<int>(edges_.size()); ++other) {
    Edge& neighbour = edges_[other];
    if (other == slot || !neighbour.is_used) continue;
    const double share = Share(edge, neighbour);
    // Small correlations would cost time without an effect.
    if (std::abs(share) < 0.1) continue;
    edge.shared.push_back({other, share});
    neighbour.shared.push_back({slot, share});
  }
  views_[i].last_edge = num_added_;
  views_[j].last_edge = num_added_;
}

double OrientationCovariance::LastingIntegral(int views) {
  for (int n = static_cast<int>(lasting_integrals_.size()); n <= views; ++n) {
    const double u = n / options_.lasting_views;
    lasting_integrals_.push_back(u + std::expm1(-u));
  }
  return lasting_integrals_[views];
}

double OrientationCovariance::LastingCorrelation(const Edge& a, const Edge& b) {
  // Correlations are negligible after this time.
  const double gap = std::max(a.begin - b.end, b.begin - a.end);
  if (gap > 4.0 * options_.lasting_views) return 0.0;
  const double common =
      LastingIntegral(std::abs(a.end - b.begin)) - LastingIntegral(std::abs(a.begin - b.begin)) -
      LastingIntegral(std::abs(a.end - b.end)) + LastingIntegral(std::abs(a.begin - b.end));
  return common / (2.0 * std::sqrt(LastingIntegral(std::abs(a.end - a.begin)) *
                                   LastingIntegral(std::abs(b.end - b.begin))));
}

double OrientationCovariance::Share(const Edge& a, const Edge& b) {
  double share = 0.0;
  if (options_.lasting_share > 0.0) share = 2.0 * options_.lasting_share * LastingCorrelation(a, b);
  int common = 0;
  // Noise in a frame has opposite signs in edges that end and in edges that begin there.
  if (a.i == b.i) common += CountCommon(a.keypoints_i, b.keypoints_i);
  if (a.j == b.j) common += CountCommon(a.keypoints_j, b.keypoints_j);
  if (a.i == b.j) common -= CountCommon(a.keypoints_i, b.keypoints_j);
  if (a.j == b.i) common -= CountCommon(a.keypoints_j, b.keypoints_i);
  if (common != 0) {
    share += (1.0 - options_.lasting_share) * options_.shared_noise * common /
             std::sqrt(static_cast<double>(a.num_keypoints) * static_cast<double>(b.num_keypoints));
  }
  return share;
}

void OrientationCovariance::DropOldViews() {
  for (int slot = 0; slot < static_cast<int>(views_.size()); ++slot) {
    View& view = views_[slot];
    if (!view.is_used || !view.is_settled || view.last_edge + options_.window >= num_added_) {
      continue;
    }
    view.is_used = false;
    for (Edge& edge : edges_) {
      if (edge.i == slot) edge.i = -1;
      if (edge.j == slot) edge.j = -1;
    }
  }
  // An edge is kept while new edges may share its views.
  for (int slot = 0; slot < static_cast<int>(edges_.size()); ++slot) {
    Edge& edge = edges_[slot];
    if (!edge.is_used || edge.i >= 0 || edge.j >= 0) continue;
    for (const Shared& shared : edge.shared) {
      if (shared.edge == slot) continue;
      std::erase_if(edges_[shared.edge].shared,
                    [&](const Shared& back) { return back.edge == slot; });
    }
    edge.is_used = false;
    edge.shared.clear();
    for (int view = 0; view < view_capacity_; ++view) Gain(view, slot).setZero();
  }
}

void OrientationCovariance::BuildSystem(const RotationMap& cam_from_world,
                                        const std::set<FrameId>& free_views) {
  std::vector<int> free;
  std::vector<int> held;
  for (int slot = 0; slot < static_cast<int>(views_.size()); ++slot) {
    View& view = views_[slot];
    view.position = -1;
    if (!view.is_used) continue;
    const bool is_free = !view.is_settled && free_views.contains(view.id);
    (is_free ? free : held).push_back(slot);
  }
  std::vector<Eigen::Quaterniond> orientations;
  std::vector<int> position(views_.size(), -1);
  for (const std::vector<int>* slots : {&free, &held}) {
    for (const int slot : *slots) {
      const Rotation& rotation = cam_from_world.at(views_[slot].id);
      position[slot] = static_cast<int>(orientations.size());
      if (slots == &free) {
        views_[slot].position = position[slot];
        views_[slot].R_c_w = rotation.Matrix();
      }
      orientations.push_back(rotation.Quaternion());
    }
  }
  const int num_free = static_cast<int>(free.size());
  EdgeSystem system(std::move(orientations), num_free, options_.loss_sigmas);
  system_edges_.clear();
  const double floor_rad = options_.edge_floor_deg * kRadFromDeg;
  for (int slot = 0; slot < static_cast<int>(edges_.size()); ++slot) {
    const Edge& edge = edges_[slot];
    if (!edge.is_used || edge.i < 0 || edge.j < 0) continue;
    if (std::min(position[edge.i], position[edge.j]) >= num_free) continue;
    system.AddEdge(position[edge.i],
                   position[edge.j],
                   edge.j_from_i,
                   edge.covariance_in_j + floor_rad * floor_rad * Eigen::Matrix3d::Identity());
    system_edges_.push_back(slot);
  }
  if (num_free == 0) return;
  system.Linearize();
  for (std::size_t k = 0; k < system_edges_.size(); ++k) {
    edges_[system_edges_[k]].curvature = system.terms()[k].curvature;
  }
  normal_root_ = system.DenseNormalMatrix();
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(normal_root_);
}

OrientationCovariance::Row OrientationCovariance::RowOf(int slot) const {
  const std::size_t num_edges = edges_.size();
  Row row;
  row.from_anchor.assign(views_.size(), Eigen::Matrix3d::Zero());
  row.gain.assign(num_edges, Eigen::Matrix3d::Zero());
  row.inherited.assign(num_edges, Eigen::Matrix3d::Zero());
  row.pull.assign(num_edges, Eigen::Matrix3d::Zero());
  if (views_[slot].is_settled) {
    row.from_anchor[slot].setIdentity();
    for (std::size_t e = 0; e < num_edges; ++e) {
      row.inherited[e] = Gain(slot, static_cast<int>(e));
    }
    return row;
  }

  Eigen::Matrix<double, Eigen::Dynamic, 3> response =
      Eigen::Matrix<double, Eigen::Dynamic, 3>::Zero(normal_root_.rows(), 3);
  response.middleRows<3>(3 * views_[slot].position).setIdentity();
  normal_root_.triangularView<Eigen::Lower>().solveInPlace(response);
  normal_root_.triangularView<Eigen::Lower>().transpose().solveInPlace(response);

  for (const int k : system_edges_) {
    const Edge& edge = edges_[k];
    const int free_i = views_[edge.i].position;
    const int free_j = views_[edge.j].position;
    Eigen::Matrix3d direct = Eigen::Matrix3d::Zero();
    if (free_j >= 0) direct += response.middleRows<3>(3 * free_j);
    if (free_i >= 0) direct -= response.middleRows<3>(3 * free_i);
    const Eigen::Matrix3d gain = direct.transpose() * edge.curvature;
    if (free_i < 0) row.from_anchor[edge.i] += gain;
    if (free_j < 0) row.from_anchor[edge.j] -= gain;
    row.gain[k].noalias() = gain * edge.root;
    for (const Shared& shared : edge.shared) {
      row.pull[shared.edge] += shared.share * row.gain[k];
    }
  }
  for (std::size_t a = 0; a < views_.size(); ++a) {
    if (row.from_anchor[a].isZero(0.0)) continue;
    for (std::size_t e = 0; e < num_edges; ++e) {
      row.inherited[e].noalias() +=
          row.from_anchor[a] * Gain(static_cast<int>(a), static_cast<int>(e));
    }
  }
  return row;
}

Eigen::Matrix3d OrientationCovariance::Covariance(const Row& row, const Row& other) const {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::vector<std::size_t> anchors;
  for (std::size_t a = 0; a < views_.size(); ++a) {
    if (!row.from_anchor[a].isZero(0.0)) anchors.push_back(a);
  }
  for (std::size_t b = 0; b < views_.size(); ++b) {
    if (other.from_anchor[b].isZero(0.0)) continue;
    Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
    for (const std::size_t a : anchors) {
      cross.noalias() += row.from_anchor[a] * anchor_covariance_[a * view_capacity_ + b];
    }
    covariance.noalias() += cross * other.from_anchor[b].transpose();
  }
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    if (!edges_[e].is_used) continue;
    covariance.noalias() += (row.inherited[e] + row.gain[e]) * other.pull[e].transpose();
    covariance.noalias() += row.pull[e] * other.inherited[e].transpose();
  }
  return covariance;
}

void OrientationCovariance::Settle(int slot) {
  const Row row = RowOf(slot);
  const auto covariance = [&](std::size_t a, std::size_t b) -> Eigen::Matrix3d& {
    return anchor_covariance_[a * view_capacity_ + b];
  };
  for (std::size_t b = 0; b < views_.size(); ++b) {
    if (!views_[b].is_used || !views_[b].is_settled) continue;
    Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
    for (std::size_t a = 0; a < views_.size(); ++a) {
      if (!row.from_anchor[a].isZero(0.0)) {
        cross.noalias() += row.from_anchor[a] * covariance(a, b);
      }
    }
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      cross.noalias() += row.pull[e] * Gain(static_cast<int>(b), static_cast<int>(e)).transpose();
    }
    covariance(slot, b) = cross;
    covariance(b, slot) = cross.transpose();
  }
  covariance(slot, slot) = Symmetric(Covariance(row, row));
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    Gain(slot, static_cast<int>(e)) = row.gain[e] + row.inherited[e];
  }
  views_[slot].is_settled = true;
}

}  // namespace rotslam
