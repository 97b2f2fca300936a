#include "apps/slam/live/live_mapper.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "apps/simulation/simulation.h"

namespace rotslam {
namespace {

// A room of 12 x 12 m with points on its walls, and a camera that walks round in a circle of 2 m,
// looking outwards. Points have a track for as long as they are in view.
class RoundWalk {
 public:
  static constexpr int kKeyframesPerRound = 72;

  // @param focal_error  of the calibration, as a share of the focal length.
  explicit RoundWalk(double focal_error = 0.0) {
    calibrated_.fx *= 1.0 + focal_error;
    calibrated_.fy *= 1.0 + focal_error;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> along(-6.0, 6.0);
    std::uniform_real_distribution<double> height(-2.0, 2.0);
    for (int k = 0; k < 2400; ++k) {
      const double side = k % 2 == 0 ? -6.0 : 6.0;
      const double a = along(random);
      points_.emplace_back(k % 4 < 2 ? a : side, height(random), k % 4 < 2 ? side : a);
    }
  }

  const Camera& camera() const { return calibrated_; }

  Rotation CamFromWorld(int k) const { return Rotation::Exp({0.0, -AngleOf(k), 0.0}); }
  Eigen::Vector3d Center(int k) const {
    return 2.0 * Eigen::Vector3d(std::sin(AngleOf(k)), 0.0, std::cos(AngleOf(k)));
  }

  // What keyframe k sees; call it in order.
  Features See(int k) {
    std::normal_distribution<double> noise(0.0, 0.3);
    Features features;
    features.frame = FrameId{k};
    std::map<TrackId, int> seen;
    for (std::size_t n = 0; n < points_.size(); ++n) {
      const Eigen::Vector3d point_in_cam = CamFromWorld(k) * (points_[n] - Center(k));
      const auto keypoint =
          point_in_cam.z() > 0.5 ? camera_.Project(point_in_cam.normalized()) : std::nullopt;
      const bool is_seen = keypoint && keypoint->x() > 0.0 && keypoint->y() > 0.0 &&
                           keypoint->x() < camera_.width && keypoint->y() < camera_.height;
      if (!is_seen) {
        track_of_.erase(static_cast<int>(n));
        continue;
      }
      const auto [track, is_new] = track_of_.try_emplace(static_cast<int>(n), TrackId{next_track_});
      next_track_ += is_new ? 1 : 0;
      seen[track->second] = static_cast<int>(n);
    }
    for (const auto& [track, n] : seen) {
      const Eigen::Vector3d point_in_cam = CamFromWorld(k) * (points_[n] - Center(k));
      const Eigen::Vector2d keypoint = *camera_.Project(point_in_cam.normalized()) +
                                       Eigen::Vector2d(noise(random_), noise(random_));
      features.tracks.push_back(track);
      features.keypoints_px.push_back(keypoint);
      features.bearings.push_back(*calibrated_.Unproject(keypoint));
      features.rgb.push_back({1, 2, 3});
      features.levels.push_back(0);
    }
    point_of_[k] = std::move(seen);
    seen_[k] = features;
    return features;
  }

  // A loop between two keyframes that have been seen.
  RevisitedPlace Loop(int older, int newer) const {
    std::map<int, TrackId> newer_tracks;
    for (const auto& [track, n] : point_of_.at(newer)) newer_tracks[n] = track;
    RevisitedPlace place;
    place.older = FrameId{older};
    for (const auto& [track, n] : point_of_.at(older)) {
      const auto match = newer_tracks.find(n);
      if (match == newer_tracks.end() || match->second == track) continue;
      RevisitedPoint point = {track, match->second, {}};
      for (int k = std::max(0, older - 2); k <= older + 2; ++k) {
        const Features& features = seen_.at(k);
        for (int m = 0; m < features.size(); ++m) {
          if (features.tracks[m] != track) continue;
          point.observations.push_back(
              {FrameId{k}, features.keypoints_px[m], features.bearings[m]});
        }
      }
      place.points.push_back(std::move(point));
    }
    return place;
  }

 private:
  static double AngleOf(int k) { return 2.0 * std::numbers::pi * k / kKeyframesPerRound; }

  Camera camera_ = CameraWithView(640, 480, 65.0);
  Camera calibrated_ = camera_;
  std::vector<Eigen::Vector3d> points_;
  std::mt19937 random_{2};
  std::map<int, TrackId> track_of_;  // of points in view
  int next_track_ = 0;
  std::map<int, std::map<TrackId, int>> point_of_;  // by keyframe
  std::map<int, Features> seen_;
};

// Orientations by an odometry that turns a little too little from keyframe to keyframe.
Rotation Drifting(const RoundWalk& walk, int k, double drift_deg) {
  return Rotation::Exp({0.0, k * drift_deg * kRadFromDeg, 0.0}) * walk.CamFromWorld(k);
}

KeyframeInput InputOf(RoundWalk& walk, int k, double drift_deg) {
  KeyframeInput input;
  input.frame = FrameId{k};
  input.timestamp_s = 0.2 * k;
  for (int j = std::max(0, k - 15); j <= k; ++j) {
    input.cam_from_world[FrameId{j}] = Drifting(walk, j, drift_deg);
  }
  input.features = walk.See(k);
  return input;
}

// Distance between two keyframes of a map, in units of that between its first two.
double RelativeDistance(const LiveMap& map, std::size_t i, std::size_t j) {
  return (map.keyframes[i].center_in_world - map.keyframes[j].center_in_world).norm() /
         (map.keyframes[0].center_in_world - map.keyframes[1].center_in_world).norm();
}

TEST(LiveMapper, BeginsWithThreeKeyframes) {
  RoundWalk walk;
  LiveMapper mapper(walk.camera(), {});
  EXPECT_EQ(mapper.AddKeyframe(InputOf(walk, 0, 0.0)), nullptr);
  EXPECT_EQ(mapper.AddKeyframe(InputOf(walk, 1, 0.0)), nullptr);
  const auto map = mapper.AddKeyframe(InputOf(walk, 2, 0.0));
  ASSERT_NE(map, nullptr);
  EXPECT_EQ(map->revision, 1);
  ASSERT_EQ(map->keyframes.size(), 3U);
  EXPECT_GT(map->points.size(), 100U);
  EXPECT_LT(map->keyframes[0].center_in_world.norm(), 1e-9);
  EXPECT_NEAR(RelativeDistance(*map, 0, 2), 2.0, 0.1);
}

TEST(LiveMapper, GrowsWithEveryKeyframe) {
  RoundWalk walk;
  LiveMapper mapper(walk.camera(), {});
  std::shared_ptr<const LiveMap> map;
  for (int k = 0; k < 19; ++k) map = mapper.AddKeyframe(InputOf(walk, k, 0.0));
  ASSERT_NE(map, nullptr);
  ASSERT_EQ(map->keyframes.size(), 19U);
  // A quarter of the circle.
  const double expected =
      (walk.Center(18) - walk.Center(0)).norm() / (walk.Center(1) - walk.Center(0)).norm();
  EXPECT_NEAR(RelativeDistance(*map, 0, 18) / expected, 1.0, 0.05);
  EXPECT_TRUE(std::is_sorted(
      map->points.begin(), map->points.end(), [](const LivePoint& a, const LivePoint& b) {
        return a.track < b.track;
      }));
  EXPECT_EQ(map->num_corrections, 0);
}

TEST(LiveMapper, KeepsThePlaceOfACameraThatTurns) {
  RoundWalk walk;
  LiveMapper mapper(walk.camera(), {});
  std::shared_ptr<const LiveMap> map;
  for (int k = 0; k < 6; ++k) map = mapper.AddKeyframe(InputOf(walk, k, 0.0));
  KeyframeInput turned = InputOf(walk, 6, 0.0);
  turned.only_rotated = true;
  map = mapper.AddKeyframe(turned);
  ASSERT_EQ(map->keyframes.size(), 7U);
  EXPECT_EQ(map->keyframes[6].center_in_world, map->keyframes[5].center_in_world);
}

TEST(LiveMapper, RefusesBadOptions) {
  SlamOptions options;
  options.krot.observations_per_view = -1;
  EXPECT_THROW(LiveMapper(RoundWalk().camera(), options), std::invalid_argument);
}

// A focal length that is wrong opens the circle; a loop closes it.
TEST(LiveMapper, ClosesALoop) {
  constexpr double kFocalError = 0.01;
  constexpr double kDriftDeg = kFocalError * 360.0 / RoundWalk::kKeyframesPerRound;
  constexpr int kNumSeen = RoundWalk::kKeyframesPerRound + 4;
  RoundWalk walk(kFocalError);
  LiveMapper mapper(walk.camera(), {});
  std::shared_ptr<const LiveMap> map;
  for (int k = 0; k < kNumSeen; ++k) map = mapper.AddKeyframe(InputOf(walk, k, kDriftDeg));
  ASSERT_EQ(map->keyframes.size(), static_cast<std::size_t>(kNumSeen));
  const auto gap = [&](const LiveMap& of) {
    return RelativeDistance(of, 2, RoundWalk::kKeyframesPerRound + 2);
  };
  const double before = gap(*map);
  LoopInput loop;
  for (int k = 0; k < kNumSeen; ++k) loop.cam_from_world[FrameId{k}] = walk.CamFromWorld(k);
  loop.places.push_back(walk.Loop(2, RoundWalk::kKeyframesPerRound + 2));
  ASSERT_GT(loop.places.front().points.size(), 50U);
  const auto closed = mapper.CloseLoops(loop);
  EXPECT_EQ(closed->num_corrections, 1);
  EXPECT_EQ(closed->keyframes.size(), map->keyframes.size());
  EXPECT_LT(gap(*closed), 0.3 * before);
  // How it has moved is told.
  const LiveKeyframe& newest = map->keyframes.back();
  const Rotation expected = closed->moved.Move(newest.cam_from_world);
  EXPECT_LT((expected * closed->keyframes.back().cam_from_world.Inverse()).AngleDeg(), 0.5);
  // The map goes on.
  const auto next = mapper.AddKeyframe(InputOf(walk, kNumSeen, 0.0));
  EXPECT_EQ(next->keyframes.size(), static_cast<std::size_t>(kNumSeen) + 1);
  EXPECT_LT(RelativeDistance(*next, 4, kNumSeen), 0.5 * before);
}

}  // namespace
}  // namespace rotslam
