#include "apps/slam/live/keyframe_chain.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include <Eigen/Sparse>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Weights of scale differences, against one of neighbours within a component.
constexpr double kComponentWeight = 1e-4;
constexpr double kLinkWeight = 1e3;
// A step is known to a share of its length; a link to this share of the median step.
constexpr double kLinkShare = 0.1;
// The least deviation of a step, as a share of the median step: a camera that only rotates keeps
// its centre.
constexpr double kLeastShare = 0.01;

// value[j] - value[i] = difference, by a row each.
struct Difference {
  int i = 0;
  int j = 0;
  double weight = 1.0;
  Eigen::Vector3d difference = Eigen::Vector3d::Zero();
};

// The values that agree best with their differences; the first one is zero.
Eigen::MatrixX3d SolveDifferences(int num_values, const std::vector<Difference>& differences) {
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(num_values, 3);
  entries.emplace_back(0, 0, 1.0);
  for (const auto& [i, j, weight, difference] : differences) {
    if (i > 0) entries.emplace_back(i, i, weight);
    if (j > 0) entries.emplace_back(j, j, weight);
    if (i > 0 && j > 0) {
      entries.emplace_back(i, j, -weight);
      entries.emplace_back(j, i, -weight);
    }
    if (i > 0) right.row(i) -= weight * difference.transpose();
    if (j > 0) right.row(j) += weight * difference.transpose();
  }
  Eigen::SparseMatrix<double> system(num_values, num_values);
  system.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(system);
  return solver.solve(right);
}

// A chain with its keyframes by number, and new orientations.
struct IndexedChain {
  std::map<FrameId, int> index;
  std::vector<const ChainedKeyframe*> keyframes;
  std::vector<Rotation> turn;            // from the old world to the new one
  std::vector<Rotation> world_from_cam;  // new
  double step = 1.0;                     // median distance of neighbours

  IndexedChain(const KeyframeChain& chain, const RotationMap& cam_from_world) {
    std::vector<double> lengths;
    for (const auto& [frame, keyframe] : chain) {
      index[frame] = static_cast<int>(keyframes.size());
      if (!keyframes.empty()) {
        lengths.push_back((keyframe.center_in_world - keyframes.back()->center_in_world).norm());
      }
      keyframes.push_back(&keyframe);
      world_from_cam.push_back(cam_from_world.at(frame).Inverse());
      turn.push_back(world_from_cam.back() * keyframe.cam_from_world);
    }
    std::erase(lengths, 0.0);
    if (!lengths.empty()) step = Median(std::move(lengths));
  }
  int size() const { return static_cast<int>(keyframes.size()); }
};

// Logarithm of the scale of every keyframe.
Eigen::VectorXd LogScales(const IndexedChain& chain,
                          std::span<const std::pair<FrameId, FrameId>> kept,
                          std::span<const PlaceLink> links) {
  std::vector<Difference> scales;
  for (int k = 1; k < chain.size(); ++k) {
    const bool is_joined = chain.keyframes[k]->component == chain.keyframes[k - 1]->component;
    scales.push_back({k - 1, k, is_joined ? 1.0 : kComponentWeight});
  }
  for (const auto& [older, newer] : kept) {
    scales.push_back({chain.index.at(older), chain.index.at(newer), kLinkWeight});
  }
  for (const PlaceLink& link : links) {
    scales.push_back({chain.index.at(link.older),
                      chain.index.at(link.newer),
                      kLinkWeight,
                      {std::log(link.scale), 0.0, 0.0}});
  }
  return SolveDifferences(chain.size(), scales).col(0);
}

// Centre of every keyframe in the new world, from that of the first one.
Eigen::MatrixX3d CentersFromFirst(const IndexedChain& chain,
                                  const Eigen::VectorXd& log_scale,
                                  std::span<const std::pair<FrameId, FrameId>> kept,
                                  std::span<const PlaceLink> links) {
  std::vector<Difference> steps;
  const auto add_step = [&](int i, int j, double least_sigma, double share) {
    const Eigen::Vector3d old =
        chain.keyframes[j]->center_in_world - chain.keyframes[i]->center_in_world;
    const Eigen::Vector3d turned = 0.5 * (chain.turn[i] * old + chain.turn[j] * old);
    const Eigen::Vector3d moved = std::exp(0.5 * (log_scale[i] + log_scale[j])) * turned;
    const double sigma = std::max(share * moved.norm(), least_sigma);
    steps.push_back({i, j, 1.0 / (sigma * sigma), moved});
  };
  for (int k = 1; k < chain.size(); ++k) add_step(k - 1, k, kLeastShare * chain.step, 1.0);
  const double link_sigma = kLinkShare * chain.step;
  for (const auto& [older, newer] : kept) {
    add_step(chain.index.at(older), chain.index.at(newer), link_sigma, 0.0);
  }
  for (const PlaceLink& link : links) {
    const int i = chain.index.at(link.older);
    const Eigen::Vector3d moved =
        std::exp(log_scale[i]) * (chain.world_from_cam[i] * link.newer_in_older);
    steps.push_back({i, chain.index.at(link.newer), 1.0 / (link_sigma * link_sigma), moved});
  }
  return SolveDifferences(chain.size(), steps);
}

Rotation Mean(const std::vector<Rotation>& rotations, std::ptrdiff_t first, std::ptrdiff_t last) {
  const Rotation& reference = rotations[first];
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (auto k = first; k <= last; ++k) sum += (rotations[k] * reference.Inverse()).Log();
  return Rotation::Exp(sum / static_cast<double>(last - first + 1)) * reference;
}

}  // namespace

const Similarity& MoveAt(const KeyframeMoves& moves, FrameId frame) {
  auto after = moves.upper_bound(frame);
  return (after == moves.begin() ? after : std::prev(after))->second;
}

RotationMap FollowAveraged(const RotationMap& averaged, const KeyframeChain& chain) {
  // Neighbours on either side over which the difference is averaged: adjustment moves the newest
  // keyframes by less than matches err, averaging changes longer stretches.
  constexpr std::ptrdiff_t kNeighbours = 4;
  const auto& [first, begin] = *chain.begin();
  const Rotation averaged_from_world = averaged.at(first).Inverse() * begin.cam_from_world;
  std::vector<Rotation> new_from_old_world;
  for (const auto& [frame, keyframe] : chain) {
    const Rotation cam_from_new_world = averaged.at(frame) * averaged_from_world;
    new_from_old_world.push_back(cam_from_new_world.Inverse() * keyframe.cam_from_world);
  }
  RotationMap followed;
  std::ptrdiff_t k = 0;
  for (const auto& [frame, keyframe] : chain) {
    const auto reach = std::min({kNeighbours, k, std::ssize(new_from_old_world) - 1 - k});
    followed[frame] =
        keyframe.cam_from_world * Mean(new_from_old_world, k - reach, k + reach).Inverse();
    ++k;
  }
  return followed;
}

KeyframeMoves CloseLinks(const KeyframeChain& chain,
                         const RotationMap& cam_from_world,
                         std::span<const std::pair<FrameId, FrameId>> kept,
                         std::span<const PlaceLink> links) {
  const IndexedChain indexed(chain, cam_from_world);
  const Eigen::VectorXd log_scale = LogScales(indexed, kept, links);
  const Eigen::MatrixX3d from_first = CentersFromFirst(indexed, log_scale, kept, links);
  KeyframeMoves moves;
  const Eigen::Vector3d first = indexed.keyframes.front()->center_in_world;
  for (const auto& [frame, k] : indexed.index) {
    Similarity& move = moves[frame];
    move.scale = std::exp(log_scale[k]);
    move.turn = indexed.turn[k];
    const Eigen::Vector3d center = first + from_first.row(k).transpose();
    move.shift = center - move.scale * (move.turn * indexed.keyframes[k]->center_in_world);
  }
  return moves;
}

}  // namespace rotslam
