#include "apps/relocalisation.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "rotodom/types/similarity.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

constexpr int kNumFrames = 14;
constexpr int kFirstLate = 10;  // the frames from there on do not know the points of those before
constexpr int kNumPoints = 400;

bool IsLate(FrameId frame) { return frame.value >= kFirstLate; }

// A walk past a rough wall, seen by `kNumFrames` frames, whose last ones have tracks of their own.
struct Walk {
  Walk() {
    for (int k = 0; k < kNumFrames; ++k) {
      const FrameId frame{k};
      truth.cam_from_world[frame] = Rotation::Exp({0.01 * k, 0.1 - 0.02 * k, 0.015 * k});
      truth.center_in_world[frame] = {0.2 * k - 1.0, 0.05 * k, 0.1 * k};
    }
    std::mt19937 random(5);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
    };
    cv::Mat descriptors(kNumPoints, 32, CV_8U);
    for (int k = 0; k < kNumPoints; ++k) {
      points.emplace_back(uniform(-5.0, 5.0), uniform(-1.5, 1.5), uniform(6.0, 9.0));
      for (int byte = 0; byte < 32; ++byte) {
        descriptors.at<std::uint8_t>(k, byte) = static_cast<std::uint8_t>(random());
      }
    }
    for (const bool late : {false, true}) {
      for (int k = 0; k < kNumPoints; ++k) {
        const TrackId id{late ? kNumPoints + k : k};
        Track track;
        track.id = id;
        for (const auto& [frame, center] : truth.center_in_world) {
          const auto px = PixelOf(frame, k);
          if (IsLate(frame) != late || !px) continue;
          const Eigen::Vector2d noisy_px =
              *px + Eigen::Vector2d(uniform(-0.5, 0.5), uniform(-0.5, 0.5));
          track.observations.push_back({frame, noisy_px, *camera.Unproject(noisy_px), 1.0});
          Features& place = places[frame];
          place.frame = frame;
          place.keypoints_px.push_back(noisy_px);
          place.bearings.push_back(track.observations.back().bearing);
          place.levels.push_back(0);
          place.angles_rad.push_back(0.0F);
          cv::Mat descriptor = descriptors.row(k).clone();
          for (int flip = 0; flip < 8; ++flip) {
            descriptor.at<std::uint8_t>(0, static_cast<int>(random() % 32)) ^=
                static_cast<std::uint8_t>(1U << (random() % 8));
          }
          place.descriptors.push_back(descriptor);
        }
        if (track.observations.size() < 2) continue;
        truth.tracks.push_back(track);
        truth.point_in_world[id] = points[k];
      }
    }
  }

  std::optional<Eigen::Vector2d> PixelOf(FrameId frame, int point) const {
    const auto px =
        camera.Project(truth.cam_from_world.at(frame) *
                       Eigen::Vector3d(points[point] - truth.center_in_world.at(frame)));
    const bool is_inside =
        px && px->x() >= 0.0 && px->x() < camera.width && px->y() >= 0.0 && px->y() < camera.height;
    return is_inside ? px : std::nullopt;
  }

  // The late frames and what only they see, elsewhere.
  Reconstruction LateMoved(const Similarity& move) const {
    Reconstruction map = truth;
    for (auto& [frame, rotation] : map.cam_from_world) {
      if (!IsLate(frame)) continue;
      rotation = move.Move(rotation);
      map.center_in_world[frame] = move.Move(map.center_in_world[frame]);
    }
    for (auto& [track, point] : map.point_in_world) {
      if (track.value >= kNumPoints) point = move.Move(point);
    }
    return map;
  }

  Camera camera = BaCamera();
  std::vector<Eigen::Vector3d> points;
  Reconstruction truth;
  std::map<FrameId, Features> places;
};

const Similarity kAway = {1.6, Rotation::Exp({0.1, 0.2, -0.1}), {0.7, -0.3, 0.5}};

// Of a map, those of its frames, tracks and points that are late, or the others.
Reconstruction PartOf(Reconstruction map, bool late) {
  std::erase_if(map.cam_from_world, [&](const auto& one) { return IsLate(one.first) != late; });
  std::erase_if(map.center_in_world, [&](const auto& one) { return IsLate(one.first) != late; });
  const auto is_other = [&](TrackId track) { return (track.value >= kNumPoints) != late; };
  std::erase_if(map.point_in_world, [&](const auto& one) { return is_other(one.first); });
  std::erase_if(map.tracks, [&](const Track& track) { return is_other(track.id); });
  return map;
}

std::vector<RelocalisedMap> RelocaliseIn(const Walk& walk,
                                         const std::vector<const Reconstruction*>& maps,
                                         const std::vector<Track>& tracks,
                                         const std::vector<Lookalike>& lookalikes,
                                         int num_threads = 1) {
  PlaceMatches places(walk.places, walk.camera);
  return Relocalise(maps, tracks, places, lookalikes, walk.camera, {}, 0, num_threads);
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
  EXPECT_GT(changed[0].sightings.size(), 100U);
  for (const auto& [track, observation] : changed[0].sightings) {
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
    EXPECT_GT(changed[0].sightings.size(), 30U);
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
  EXPECT_EQ(one[0].sightings.size(), four[0].sightings.size());
}

}  // namespace
}  // namespace rotslam
