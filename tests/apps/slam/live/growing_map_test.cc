#include "apps/slam/live/growing_map.h"

#include <vector>

#include <gtest/gtest.h>

#include "apps/slam/live/place_links.h"

namespace rotslam {
namespace {

Eigen::Vector3d CenterOf(int keyframe) { return {0.5 * keyframe, 0.0, 0.0}; }

std::vector<Eigen::Vector3d> Points() {
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 30; ++k) points.emplace_back(0.3 * (k % 6), 0.2 * (k / 6), 4.0 + 0.1 * k);
  return points;
}

// A keyframe that looks along z and sees all points, point n with track `first_track` + n.
KeyframeInput Seeing(int keyframe, int first_track) {
  KeyframeInput input;
  input.frame = FrameId{keyframe};
  input.timestamp_s = keyframe;
  for (int k = 0; k <= keyframe; ++k) input.cam_from_world[FrameId{k}] = Rotation();
  input.features.frame = input.frame;
  for (const Eigen::Vector3d& point : Points()) {
    const auto track = first_track + static_cast<int>(input.features.tracks.size());
    input.features.tracks.push_back(TrackId{track});
    input.features.bearings.push_back((point - CenterOf(keyframe)).normalized());
    input.features.keypoints_px.push_back(Eigen::Vector2d::Zero());
    input.features.rgb.push_back({1, 2, 3});
    input.features.levels.push_back(0);
  }
  return input;
}

// Keyframes with true centres, and true points of tracks from `first_track` on.
Reconstruction Truth(int first, int last, int first_track) {
  Reconstruction truth;
  for (int k = first; k <= last; ++k) {
    truth.cam_from_world[FrameId{k}] = Rotation();
    truth.center_in_world[FrameId{k}] = CenterOf(k);
  }
  const std::vector<Eigen::Vector3d> points = Points();
  for (int n = 0; n < static_cast<int>(points.size()); ++n) {
    truth.point_in_world[TrackId{first_track + n}] = points[n];
  }
  return truth;
}

// Two keyframes see the points with tracks 0..29. Many later, which see other tracks, two more see
// the points again, with tracks 100..129 and in a map that has drifted by `drift`.
GrowingMap Revisiting(const Similarity& drift) {
  constexpr int kLast = GrowingMap::kActiveKeyframes + 4;
  GrowingMap map;
  for (int k = 0; k <= kLast; ++k) {
    map.AddKeyframe(Seeing(k, k < 2 ? 0 : k > kLast - 2 ? 100 : 1000 * k));
  }
  map.ReplaceFrom(FrameId{0}, Truth(0, 1, 0), 0);
  Reconstruction later = Truth(kLast - 1, kLast, 100);
  for (auto& [frame, center] : later.center_in_world) center = drift.Move(center);
  for (auto& [track, point] : later.point_in_world) point = drift.Move(point);
  map.ReplaceFrom(FrameId{kLast - 2}, later, 0);
  map.EndTracks();
  return map;
}

RevisitedPlace Place() {
  RevisitedPlace place;
  place.older = FrameId{1};
  const Features older = Seeing(1, 0).features;
  for (int n = 0; n < older.size(); ++n) {
    place.points.push_back(
        {TrackId{n}, TrackId{100 + n}, {{FrameId{1}, older.keypoints_px[n], older.bearings[n]}}});
  }
  return place;
}

TEST(GrowingMap, KeepsThePointsOfTracksThatHaveEnded) {
  const GrowingMap map = Revisiting({});
  EXPECT_FALSE(map.tracks().contains(TrackId{3}));
  ASSERT_NE(map.FindPoint(TrackId{3}), nullptr);
  EXPECT_LT((*map.FindPoint(TrackId{3}) - Points()[3]).norm(), 1e-12);
  EXPECT_EQ(map.FindPoint(TrackId{99}), nullptr);
  const LiveMap snapshot = map.Snapshot();
  EXPECT_EQ(snapshot.keyframes.size(), 4U);
  EXPECT_EQ(snapshot.points.size(), 60U);
}

TEST(GrowingMap, MovesPointsLikeTheNewestKeyframeThatSeesThem) {
  GrowingMap map = Revisiting({});
  const FrameId newest = map.keyframes().rbegin()->first;
  const Eigen::Vector3d shift(0.0, 1.0, 0.0);
  map.Move({{FrameId{0}, {}}, {newest, {1.0, Rotation(), shift}}});
  EXPECT_LT((*map.FindPoint(TrackId{3}) - Points()[3]).norm(), 1e-12);
  EXPECT_LT((*map.FindPoint(TrackId{103}) - (Points()[3] + shift)).norm(), 1e-12);
  const LiveMap snapshot = map.Snapshot();
  EXPECT_EQ(snapshot.num_corrections, 1);
  EXPECT_EQ(snapshot.moved.shift, shift);
}

TEST(GrowingMap, MergesPointsThatAreSeenAgain) {
  GrowingMap map = Revisiting({1.0, Rotation(), {0.3, 0.0, 0.0}});
  const RevisitedPlace place = Place();
  map.MergePoints({&place.points[3]});
  EXPECT_EQ(map.FindPoint(TrackId{3}), map.FindPoint(TrackId{103}));
  EXPECT_LT((*map.FindPoint(TrackId{103}) - Points()[3]).norm(), 1e-12);
  EXPECT_EQ(map.Snapshot().points.size(), 59U);
  // The older keyframe is one of those that adjustment gets.
  EXPECT_TRUE(map.Recent().center_in_world.contains(FrameId{1}));
}

TEST(GrowingMap, TakesThePlaceOfKeyframesThatAComponentLeavesOut) {
  GrowingMap map;
  for (int k = 0; k < 3; ++k) map.AddKeyframe(Seeing(k, 0));
  map.ReplaceFrom(FrameId{0}, Truth(0, 2, 0), 0);
  EXPECT_EQ(map.Chain().size(), 3U);
  map.ReplaceFrom(FrameId{0}, Truth(0, 1, 0), 0);
  EXPECT_EQ(map.Chain().size(), 2U);
}

TEST(FindPlaceLink, TellsPlaceAndScaleFromThePointsSeenAgain) {
  const GrowingMap map = Revisiting({0.8, Rotation(), {0.3, 0.0, 0.0}});
  const KeyframeChain chain = map.Chain();
  RotationMap rotations;
  for (const auto& [frame, keyframe] : chain) rotations[frame] = keyframe.cam_from_world;
  const auto found = FindPlaceLink(Place(), {map, chain, rotations, /*focal_px=*/500.0});
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->points.size(), 30U);
  EXPECT_NEAR(found->link.scale, 1.0 / 0.8, 1e-6);
  const Eigen::Vector3d expected = CenterOf(found->link.newer.value) - CenterOf(1);
  EXPECT_LT((found->link.newer_in_older - expected).norm(), 1e-6);
  EXPECT_TRUE(Contradicts(chain, rotations, {found->link}, /*depth=*/4.0));
  EXPECT_FALSE(Contradicts(chain, rotations, {}, /*depth=*/4.0));
}

TEST(FindPlaceLink, NeedsFifteenPoints) {
  const GrowingMap map = Revisiting({});
  const KeyframeChain chain = map.Chain();
  RotationMap rotations;
  for (const auto& [frame, keyframe] : chain) rotations[frame] = keyframe.cam_from_world;
  RevisitedPlace place = Place();
  place.points.resize(15);
  const PlaceLinkSources sources = {map, chain, rotations, /*focal_px=*/500.0};
  EXPECT_TRUE(FindPlaceLink(place, sources).has_value());
  place.points.pop_back();
  EXPECT_FALSE(FindPlaceLink(place, sources).has_value());
}

TEST(Contradicts, LeavesSmallDifferences) {
  const GrowingMap map = Revisiting({});
  const KeyframeChain chain = map.Chain();
  RotationMap rotations;
  for (const auto& [frame, keyframe] : chain) {
    rotations[frame] = Rotation::Exp({0.0, 0.1 * kRadFromDeg, 0.0}) * keyframe.cam_from_world;
  }
  EXPECT_FALSE(Contradicts(chain, rotations, {}, /*depth=*/4.0));
  rotations.begin()->second = Rotation::Exp({0.0, 0.3 * kRadFromDeg, 0.0});
  EXPECT_TRUE(Contradicts(chain, rotations, {}, /*depth=*/4.0));
}

}  // namespace
}  // namespace rotslam
