#include "apps/slam/map_correction/relocalisation.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "tests/apps/walk_scene.h"

namespace rotslam {
namespace {

std::vector<RelocalisedMap> RelocaliseIn(const Walk& walk,
                                         const std::vector<const Reconstruction*>& maps,
                                         const std::vector<Track>& tracks,
                                         const std::vector<Lookalike>& lookalikes,
                                         int num_threads = 1) {
  PlaceMatches places(walk.places, walk.camera);
  return Relocalise({maps, tracks, lookalikes, walk.camera}, {}, 0, num_threads, places);
}

void ExpectTruth(const RelocalisedMap& map, const Reconstruction& truth) {
  ASSERT_EQ(map.center_in_world.size(), truth.center_in_world.size());
  for (const auto& [frame, center] : truth.center_in_world) {
    // Depth against the points, 7 away, is seen to some per cent from one frame.
    EXPECT_LT((map.center_in_world.at(frame) - center).norm(), 0.1) << frame.value;
    const Rotation rest = map.cam_from_world.at(frame) * truth.cam_from_world.at(frame).Inverse();
    EXPECT_LT(rest.AngleDeg(), 0.5) << frame.value;
  }
}

TEST(Relocalise, MovesFramesToWhereOthersSeeThem) {
  Walk walk;
  walk.places.erase(FrameId{kNumFrames - 1});  // its corners are not known
  const Reconstruction map = walk.LateMoved(kAway);
  const auto changed = RelocaliseIn(walk, {&map}, map.tracks, {{FrameId{12}, FrameId{8}}});
  ASSERT_EQ(changed.size(), 1U);
  EXPECT_EQ(changed[0].parts, std::set<int>{0});
  EXPECT_EQ(changed[0].moved.size(), std::size_t{kNumFrames - kFirstLate});
  ExpectTruth(changed[0], walk.truth);
  for (int k = 0; k < kFirstLate; ++k) {
    EXPECT_EQ(changed[0].center_in_world.at(FrameId{k}), map.center_in_world.at(FrameId{k}));
  }
  EXPECT_GT(changed[0].observations.size(), 100U);
  for (const auto& [track, observation] : changed[0].observations) {
    EXPECT_LT(track.value, kNumPoints);
    EXPECT_TRUE(IsLate(observation.frame));
    const auto px = walk.PixelOf(observation.frame, track.value);
    ASSERT_TRUE(px);
    EXPECT_LT((observation.keypoint_px - *px).norm(), 4.0);
  }
}

TEST(Relocalise, JoinsMapsInTheWorldOfTheLargest) {
  const Walk walk;
  const Reconstruction map = walk.LateMoved(kAway);
  const Reconstruction early = PartOf(map, false);
  const Reconstruction late = PartOf(map, true);
  for (const Lookalike& pair : {Lookalike{FrameId{12}, FrameId{8}}, {FrameId{8}, FrameId{12}}}) {
    const auto changed = RelocaliseIn(walk, {&late, &early}, map.tracks, {pair});
    ASSERT_EQ(changed.size(), 1U);
    EXPECT_EQ(changed[0].parts, (std::set<int>{0, 1}));
    EXPECT_EQ(changed[0].moved.size(), std::size_t{kNumFrames - kFirstLate});
    ExpectTruth(changed[0], walk.truth);
    EXPECT_GT(changed[0].observations.size(), 30U);
  }
}

// The frames of a map up to `last` in one part, the rest in another, each in the world it is in.
std::vector<Reconstruction> CutBehind(FrameId last, const Reconstruction& map) {
  std::vector<Reconstruction> parts(2, map);
  for (const bool behind : {false, true}) {
    Reconstruction& part = parts[behind ? 1 : 0];
    const auto is_other = [&](FrameId frame) { return (frame > last) != behind; };
    std::erase_if(part.cam_from_world, [&](const auto& one) { return is_other(one.first); });
    std::erase_if(part.center_in_world, [&](const auto& one) { return is_other(one.first); });
    for (Track& track : part.tracks) {
      std::erase_if(track.observations, [&](const auto& one) { return is_other(one.frame); });
    }
    std::erase_if(part.tracks, [](const Track& track) { return track.observations.size() < 2; });
    PointMap seen;
    for (const Track& track : part.tracks) seen[track.id] = part.point_in_world.at(track.id);
    part.point_in_world = std::move(seen);
  }
  return parts;
}

TEST(Relocalise, JoinsThreeMapsByTheirLinks) {
  const Walk walk;
  const Reconstruction map = walk.LateMoved(kAway);
  const Reconstruction late = PartOf(map, true);
  std::vector<Reconstruction> early = CutBehind(FrameId{2}, PartOf(map, false));
  for (auto& [frame, rotation] : early[0].cam_from_world) rotation = kAway.Inverse().Move(rotation);
  for (auto& [frame, center] : early[0].center_in_world) center = kAway.Inverse().Move(center);
  for (auto& [track, point] : early[0].point_in_world) point = kAway.Inverse().Move(point);
  const std::vector<Lookalike> chain = {{FrameId{12}, FrameId{8}}, {FrameId{1}, FrameId{4}}};
  // Frames 3 to 9 are the largest part, wherever it stands.
  std::vector<const Reconstruction*> order = {&late, &early[0], &early[1]};
  for (int turn = 0; turn < 3; ++turn) {
    std::rotate(order.begin(), order.begin() + 1, order.end());
    const auto changed = RelocaliseIn(walk, order, map.tracks, chain);
    ASSERT_EQ(changed.size(), 1U);
    EXPECT_EQ(changed[0].parts, (std::set<int>{0, 1, 2}));
    EXPECT_EQ(changed[0].moved.size(), 3U + kNumFrames - kFirstLate);
    EXPECT_FALSE(changed[0].moved.contains(FrameId{3}));
    ExpectTruth(changed[0], walk.truth);
  }
}

TEST(PlaceMatches, AreMadeOnceForAPrediction) {
  Walk walk;
  PlaceMatches places(walk.places, walk.camera);
  const auto num_between = [&](const Rotation& predicted) {
    return places.Between(FrameId{3}, FrameId{5}, predicted).size();
  };
  const std::size_t num_matches = num_between(Rotation());
  EXPECT_GT(num_matches, 100U);
  walk.places[FrameId{5}] = Features();
  EXPECT_EQ(num_between(Rotation::Exp({0.0, 0.005, 0.0})), num_matches);
  EXPECT_EQ(num_between(Rotation::Exp({0.0, 0.02, 0.0})), 0U);
  EXPECT_EQ(num_between(Rotation()), 0U);
}

TEST(Relocalise, LeavesWhatIsRight) {
  const Walk walk;
  EXPECT_TRUE(
      RelocaliseIn(walk, {&walk.truth}, walk.truth.tracks, {{FrameId{12}, FrameId{8}}}).empty());
}

TEST(Relocalise, LeavesWhatIsNearItsPlaceWhenThoseBesideItMove) {
  const Walk walk;
  Reconstruction map = walk.LateMoved(kAway);
  // Where it stands explains two thirds of what it sees to the limit of 4 px.
  const FrameId near{13};
  map.cam_from_world[near] = Rotation::Exp({0.0, 0.0, 0.014}) * walk.truth.cam_from_world.at(near);
  map.center_in_world[near] = walk.truth.center_in_world.at(near);
  const auto changed =
      RelocaliseIn(walk,
                   {&map},
                   map.tracks,
                   {{FrameId{12}, FrameId{8}}, {FrameId{11}, FrameId{8}}, {near, FrameId{8}}});
  ASSERT_EQ(changed.size(), 1U);
  EXPECT_EQ(changed[0].moved, (std::set<FrameId>{FrameId{10}, FrameId{11}, FrameId{12}}));
}

TEST(Relocalise, LeavesWhatOnlyLooksAlike) {
  Walk walk;
  const Reconstruction map = walk.LateMoved(kAway);
  std::mt19937 random(9);
  for (auto& [frame, place] : walk.places) {
    if (IsLate(frame)) std::shuffle(place.keypoints_px.begin(), place.keypoints_px.end(), random);
  }
  EXPECT_TRUE(RelocaliseIn(walk, {&map}, map.tracks, {{FrameId{12}, FrameId{8}}}).empty());
}

TEST(Relocalise, IsTheSameOnAnyNumberOfThreads) {
  const Walk walk;
  const Reconstruction map = walk.LateMoved(kAway);
  const std::vector<Lookalike> pairs = {{FrameId{12}, FrameId{8}}, {FrameId{11}, FrameId{3}}};
  const auto one = RelocaliseIn(walk, {&map}, map.tracks, pairs);
  const auto four = RelocaliseIn(walk, {&map}, map.tracks, pairs, 4);
  ASSERT_EQ(one.size(), 1U);
  ASSERT_EQ(four.size(), 1U);
  EXPECT_EQ(one[0].center_in_world, four[0].center_in_world);
  EXPECT_EQ(one[0].observations.size(), four[0].observations.size());
}

}  // namespace
}  // namespace rotslam
