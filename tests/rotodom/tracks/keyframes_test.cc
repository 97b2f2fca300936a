#include "rotodom/tracks/keyframes.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

struct Walk {
  RotationMap cam_from_world;
  std::vector<Track> tracks;
};

// Points ten ahead of a camera that walks sideways while it turns; all frames see all points.
// @param step_deg  parallax of one step.
Walk MakeWalk(int num_frames, double step_deg, const std::set<int>& standing = {}) {
  Walk walk;
  std::vector<double> x;
  for (int f = 0; f < num_frames; ++f) {
    walk.cam_from_world[FrameId{f}] = Rotation::Exp({0.0, 0.05 * f, 0.01 * f});
    const double step = standing.contains(f) ? 0.0 : 10.0 * step_deg * kRadFromDeg;
    x.push_back(f == 0 ? 0.0 : x.back() + step);
  }
  for (int p = 0; p < 21; ++p) {
    Track& track = walk.tracks.emplace_back();
    track.id = TrackId{p};
    for (int f = 0; f < num_frames; ++f) {
      // Every ray starts across the path of the camera, so that the parallax grows evenly.
      const Eigen::Vector3d point(x.back() / 2.0, 0.2 * (p - 10), 10.0);
      const Eigen::Vector3d ray = (point - Eigen::Vector3d(x[f], 0.0, 0.0)).normalized();
      track.observations.push_back(
          {FrameId{f}, Eigen::Vector2d(p, f), walk.cam_from_world[FrameId{f}] * ray, 1.0});
    }
  }
  return walk;
}

std::vector<int> Values(const std::set<FrameId>& frames) {
  std::vector<int> values;
  for (const FrameId frame : frames) values.push_back(frame.value);
  return values;
}

std::vector<int> Select(const Walk& walk,
                        const std::vector<PureRotationSegment>& held = {},
                        const KeyframeOptions& options = {
                            .min_parallax_deg = 1.0, .min_shared_ratio = 0.6, .min_keyframes = 0}) {
  return Values(SelectKeyframes(walk.cam_from_world, walk.tracks, held, options));
}

using List = std::vector<int>;

TEST(SelectKeyframes, TakesOneWheneverTheParallaxHasGrown) {
  EXPECT_EQ(Select(MakeWalk(13, 0.3)), (List{0, 4, 8, 12}));
  EXPECT_EQ(Select(MakeWalk(6, 1.5)), (List{0, 1, 2, 3, 4, 5}));
  KeyframeOptions wide;
  wide.min_parallax_deg = 2.0;
  wide.min_keyframes = 0;
  EXPECT_EQ(Select(MakeWalk(15, 0.3), {}, wide), (List{0, 7, 14}));
}

TEST(SelectKeyframes, AShortWalkIsAskedForLessParallax) {
  const Walk walk = MakeWalk(13, 0.12);
  KeyframeOptions options = {.min_parallax_deg = 2.0, .min_keyframes = 2};
  EXPECT_EQ(Select(walk, {}, options), (List{0, 12}));
  options.min_keyframes = 3;
  EXPECT_EQ(Select(walk, {}, options), (List{0, 9, 12}));
  options.min_keyframes = 4;
  EXPECT_EQ(Select(walk, {}, options), (List{0, 5, 10, 12}));
  // Not below a sixteenth.
  options.min_keyframes = 14;
  EXPECT_EQ(Select(walk, {}, options), (List{0, 2, 4, 6, 8, 10, 12}));
}

TEST(SelectKeyframes, TakesEveryNthWhenAsked) {
  KeyframeOptions every;
  every.every_frames = 3;
  EXPECT_EQ(Select(MakeWalk(8, 0.3), {}, every), (List{0, 3, 6, 7}));
  EXPECT_EQ(Select(MakeWalk(12, 0.3), {{FrameId{4}, FrameId{8}, 1.0}}, every),
            (List{0, 3, 4, 8, 11}));
}

TEST(SelectKeyframes, TurningAloneGivesNone) {
  EXPECT_EQ(Select(MakeWalk(12, 0.0)), (List{0, 11}));
}

TEST(SelectKeyframes, ForgetsTheWorldsOrientation) {
  Walk walk = MakeWalk(13, 0.3);
  const List before = Select(walk);
  for (auto& [frame, rotation] : walk.cam_from_world) {
    rotation = rotation * Rotation::Exp({1.0, -0.4, 2.0});
  }
  EXPECT_EQ(Select(walk), before);
}

TEST(SelectKeyframes, TheLastFrameThatSharesEnoughBecomesOne) {
  // Frame 5 sees a third of the points of frame 0, and of frame 4's, nothing else changing.
  Walk walk = MakeWalk(8, 0.0);
  for (int p = 7; p < 21; ++p) {
    std::erase_if(walk.tracks[p].observations,
                  [](const Observation& o) { return o.frame >= FrameId{5}; });
  }
  EXPECT_EQ(Select(walk), (List{0, 4, 5, 7}));
  KeyframeOptions lax;
  lax.min_shared_ratio = 0.3;
  EXPECT_EQ(Select(walk, {}, lax), (List{0, 7}));
}

TEST(SelectKeyframes, SlowLossOfTracksTakesTheFrameBefore) {
  // Two points of 21 go every frame: 60 % of frame 0's are left until frame 4, and of frame 4's 13
  // until frame 6.
  Walk walk = MakeWalk(9, 0.0);
  for (int p = 0; p < 21; ++p) {
    std::erase_if(walk.tracks[p].observations,
                  [&](const Observation& o) { return 2 * o.frame.value > p; });
  }
  EXPECT_EQ(Select(walk), (List{0, 4, 6, 7, 8}));
}

// Frame 3 is a keyframe. From frame 5 on, only one point is left that frames 0
// and 3 both saw; frame 4 is the last that sees what frame 3 does and what comes.
TEST(SelectKeyframes, PointsOfKnownDepthReachFromOneKeyframeToTheNext) {
  Walk walk = MakeWalk(7, 0.0);
  for (int p = 0; p < 21; ++p) {
    const bool old = p < 7;
    std::erase_if(walk.tracks[p].observations, [&](const Observation& o) {
      return p > 0 && (old ? o.frame >= FrameId{5} : o.frame < FrameId{3});
    });
  }
  KeyframeOptions options;
  options.min_parallax_deg = 1.0;
  options.min_shared_ratio = 0.1;
  options.min_keyframes = 0;
  std::vector<PureRotationSegment> held(1);
  held[0].first = held[0].last = FrameId{3};
  options.min_linked_ratio = 0.0;
  EXPECT_EQ(Select(walk, held, options), (List{0, 3, 6}));
  options.min_linked_ratio = 0.2;
  EXPECT_EQ(Select(walk, held, options), (List{0, 3, 4, 6}));
}

TEST(SelectKeyframes, PureRotationSegmentsKeepTheirEndsAlone) {
  Walk walk = MakeWalk(20, 0.3, {6, 7, 8, 9, 10, 11, 12, 13, 14});
  // The stretch begins at frame 5: the first step without motion leads to frame 6.
  EXPECT_EQ(Select(walk, {{FrameId{5}, FrameId{14}}}), (List{0, 4, 5, 14, 18, 19}));
  // Even if the rays inside disagree by more than a keyframe's parallax.
  walk = MakeWalk(20, 0.6);
  EXPECT_EQ(Select(walk, {{FrameId{5}, FrameId{14}}}), (List{0, 2, 4, 5, 14, 16, 18, 19}));
  EXPECT_EQ(Select(walk, {{FrameId{0}, FrameId{19}}}), (List{0, 19}));
  EXPECT_EQ(Select(walk, {{FrameId{0}, FrameId{9}}, {FrameId{10}, FrameId{19}}}),
            (List{0, 9, 10, 19}));
}

TEST(SelectKeyframes, LivesWithFramesThatSeeNothing) {
  Walk walk = MakeWalk(13, 0.3);
  for (Track& track : walk.tracks) {
    std::erase_if(track.observations, [](const Observation& o) { return o.frame == FrameId{4}; });
  }
  EXPECT_EQ(Select(walk), (List{0, 5, 9, 12}));  // 4 cannot be one
  EXPECT_EQ(Values(SelectKeyframes(walk.cam_from_world, {}, {}, {})), (List{0, 12}));
}

TEST(SelectKeyframes, NothingGivesNothing) {
  EXPECT_TRUE(SelectKeyframes({}, {}, {}, {}).empty());
  EXPECT_EQ(Values(SelectKeyframes({{FrameId{3}, Rotation()}}, {}, {}, {})), (List{3}));
}

TEST(SelectKeyframes, IgnoresObservationsInFramesWithoutOrientation) {
  Walk walk = MakeWalk(13, 0.3);
  const List expected = Select(walk);
  Observation stray = walk.tracks[0].observations.back();
  stray.frame = FrameId{90};
  for (Track& track : walk.tracks) track.observations.push_back(stray);
  EXPECT_EQ(Select(walk), expected);
}

TEST(KeyframeOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(KeyframeOptions{}.Problem());
  KeyframeOptions options;
  options.every_frames = -1;
  EXPECT_TRUE(options.Problem().value_or("none").starts_with("every_frames is -1"));
  options.min_keyframes = -1;
  EXPECT_TRUE(options.Problem().value_or("none").starts_with("min_keyframes is -1"));
  options.min_linked_ratio = 1.0;
  EXPECT_TRUE(options.Problem().value_or("none").starts_with("min_linked_ratio is 1"));
  options.min_shared_ratio = 1.0;
  EXPECT_TRUE(options.Problem().value_or("none").starts_with("min_shared_ratio is 1"));
  options.min_parallax_deg = 0.0;
  EXPECT_TRUE(options.Problem().value_or("none").starts_with("min_parallax_deg is 0"));
  EXPECT_THROW(SelectKeyframes({}, {}, {}, options), std::invalid_argument);
}

TEST(RestrictTracks, KeepsObservationsInTheFramesAndIds) {
  Walk walk = MakeWalk(5, 0.3);
  std::erase_if(walk.tracks[0].observations,
                [](const Observation& o) { return o.frame >= FrameId{2}; });
  const auto restricted = RestrictTracks(walk.tracks, {FrameId{0}, FrameId{2}, FrameId{4}}, 2);
  ASSERT_EQ(restricted.size(), 20u);  // track 0 is left with frame 0 alone
  for (std::size_t k = 0; k < restricted.size(); ++k) {
    EXPECT_EQ(restricted[k].id.value, static_cast<int>(k) + 1);
    ASSERT_EQ(restricted[k].observations.size(), 3u);
    EXPECT_EQ(restricted[k].observations[1].frame, FrameId{2});
  }
  EXPECT_EQ(RestrictTracks(walk.tracks, {FrameId{0}, FrameId{2}, FrameId{4}}, 1).size(), 21u);
  EXPECT_TRUE(RestrictTracks(walk.tracks, {}, 1).empty());
}

}  // namespace
}  // namespace rotslam
