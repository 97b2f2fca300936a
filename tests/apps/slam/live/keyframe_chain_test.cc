#include "apps/slam/live/keyframe_chain.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr int kCircleKeyframes = 41;

// Round a circle of 5 m, looking along it; the last keyframe stands where the first one does.
KeyframeChain Circle() {
  KeyframeChain chain;
  for (int k = 0; k < kCircleKeyframes; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / (kCircleKeyframes - 1);
    ChainedKeyframe& keyframe = chain[FrameId{3 * k}];
    keyframe.cam_from_world = Rotation::Exp({0.0, -angle, 0.0});
    keyframe.center_in_world = {5.0 - 5.0 * std::cos(angle), 0.0, 5.0 * std::sin(angle)};
  }
  return chain;
}

RotationMap RotationsOf(const KeyframeChain& chain) {
  RotationMap rotations;
  for (const auto& [frame, keyframe] : chain) rotations[frame] = keyframe.cam_from_world;
  return rotations;
}

// The chain as a map drifts: every step turns a little more, and is a little longer.
KeyframeChain Drifted(const KeyframeChain& truth, double turn_rad, double growth) {
  KeyframeChain drifted;
  const ChainedKeyframe* before = nullptr;
  const ChainedKeyframe* before_drifted = nullptr;
  double scale = 1.0;
  Rotation turn;  // of the true world
  for (const auto& [frame, keyframe] : truth) {
    ChainedKeyframe& moved = drifted[frame];
    moved = keyframe;
    if (before != nullptr) {
      const double next_scale = scale * growth;
      const Rotation next_turn = Rotation::Exp({0.0, turn_rad, 0.0}) * turn;
      const Eigen::Vector3d step = keyframe.center_in_world - before->center_in_world;
      moved.center_in_world =
          before_drifted->center_in_world +
          std::sqrt(scale * next_scale) * (0.5 * (turn * step + next_turn * step));
      moved.cam_from_world = keyframe.cam_from_world * next_turn.Inverse();
      scale = next_scale;
      turn = next_turn;
    }
    before = &keyframe;
    before_drifted = &moved;
  }
  return drifted;
}

double LargestError(const KeyframeChain& chain,
                    const std::map<FrameId, Similarity>& moves,
                    const KeyframeChain& truth) {
  double largest = 0.0;
  for (const auto& [frame, keyframe] : chain) {
    const Eigen::Vector3d moved = moves.at(frame).Move(keyframe.center_in_world);
    largest = std::max(largest, (moved - truth.at(frame).center_in_world).norm());
  }
  return largest;
}

TEST(CloseLinks, KeepsWhatIsRight) {
  const KeyframeChain truth = Circle();
  const auto moves = CloseLinks(truth, RotationsOf(truth), {}, {});
  EXPECT_LT(LargestError(truth, moves, truth), 1e-9);
  for (const auto& [frame, move] : moves) EXPECT_NEAR(move.scale, 1.0, 1e-12);
}

TEST(CloseLinks, TakesOutDriftOfRotationAndScale) {
  const KeyframeChain truth = Circle();
  const KeyframeChain drifted = Drifted(truth, 0.2 * kRadFromDeg, 1.005);
  PlaceLink link;
  link.older = truth.begin()->first;
  link.newer = truth.rbegin()->first;
  link.scale = std::pow(1.005, -(kCircleKeyframes - 1));
  const auto moves = CloseLinks(drifted, RotationsOf(truth), {}, {&link, 1});
  EXPECT_GT((drifted.rbegin()->second.center_in_world).norm(), 0.5);
  EXPECT_LT(LargestError(drifted, moves, truth), 0.05);
  // Where it was linked before, it stays.
  KeyframeChain closed = drifted;
  for (auto& [frame, keyframe] : closed) {
    keyframe.cam_from_world = moves.at(frame).Move(keyframe.cam_from_world);
    keyframe.center_in_world = moves.at(frame).Move(keyframe.center_in_world);
  }
  const std::vector<std::pair<FrameId, FrameId>> kept = {{link.older, link.newer}};
  const auto again = CloseLinks(closed, RotationsOf(closed), kept, {});
  EXPECT_LT(LargestError(closed, again, closed), 1e-9);
}

// A link tells the scale of a component whose scale is a guess, and leaves that of the one before
// it.
TEST(CloseLinks, FindsTheScaleOfAPart) {
  const KeyframeChain truth = Circle();
  KeyframeChain chain = truth;
  const FrameId boundary{60};
  const Eigen::Vector3d origin = truth.at(boundary).center_in_world;
  for (auto& [frame, keyframe] : chain) {
    if (frame <= boundary) continue;
    keyframe.component = 1;
    keyframe.center_in_world = origin + 1.5 * (keyframe.center_in_world - origin);
  }
  PlaceLink link;
  link.older = truth.begin()->first;
  link.newer = truth.rbegin()->first;
  link.scale = 1.0 / 1.5;
  const auto moves = CloseLinks(chain, RotationsOf(truth), {}, {&link, 1});
  EXPECT_NEAR(moves.begin()->second.scale, 1.0, 1e-3);
  EXPECT_NEAR(moves.rbegin()->second.scale, 1.0 / 1.5, 1e-2);
  EXPECT_LT(LargestError(chain, moves, truth), 0.2);
}

TEST(FollowAveraged, FollowsAveragedOrientationsAndKeepsNeighbours) {
  const KeyframeChain truth = Circle();
  const KeyframeChain drifted = Drifted(truth, 0.2 * kRadFromDeg, 1.0);
  // Averaged in another world, with an error of their own from one keyframe to the next.
  RotationMap averaged;
  const Rotation world = Rotation::Exp({0.3, -0.2, 0.9});
  int k = 0;
  for (const auto& [frame, keyframe] : truth) {
    const double error = k > 0 && k % 2 == 0 && k < kCircleKeyframes - 1 ? 0.1 * kRadFromDeg : 0.0;
    averaged[frame] = Rotation::Exp({error, 0.0, 0.0}) * keyframe.cam_from_world * world;
    ++k;
  }
  const RotationMap bent = FollowAveraged(averaged, drifted);
  EXPECT_LT((bent.rbegin()->second * truth.rbegin()->second.cam_from_world.Inverse()).AngleDeg(),
            1e-6);
  const auto middle = std::next(truth.begin(), kCircleKeyframes / 2);
  const auto after = std::next(middle);
  const Rotation step =
      bent.at(after->first) * bent.at(middle->first).Inverse() *
      (after->second.cam_from_world * middle->second.cam_from_world.Inverse()).Inverse();
  EXPECT_LT(step.AngleDeg(), 0.05);
  EXPECT_LT((bent.at(middle->first) * middle->second.cam_from_world.Inverse()).AngleDeg(), 0.1);
}

}  // namespace
}  // namespace rotslam
