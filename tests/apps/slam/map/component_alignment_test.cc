#include "apps/slam/map/component_alignment.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// A street of 40 frames a second apart as one map, and the same in another world as a part; which
// frames each of them holds, and which points, is up to the test.
struct Boundary {
  Scene scene;
  std::vector<double> timestamps_s;
  std::vector<PureRotationSegment> segments;
  ResectionOptions resection;
  Reconstruction placed;
  Reconstruction part;
  Similarity truth{0.2, Rotation::Exp({0.1, -0.5, 0.2}), {3.0, 1.0, -2.0}};  // part to placed

  Boundary() {
    SceneOptions options;
    options.path = ScenePath::kStreet;
    options.num_views = 40;
    options.num_points = 4000;
    options.noise_px = 0.1;
    scene = MakeScene(options);
    for (const auto& [frame, rotation] : scene.true_cam_from_world) {
      timestamps_s.push_back(frame.value);
    }
  }

  // The placed map holds the frames up to `last`, the part those from `first` on, each with the
  // points that two of its frames see.
  void Cut(int last, int first) {
    placed = Part(0, last);
    part = Moved(Part(first, 39), truth.Inverse());
  }

  Reconstruction Part(int first, int last) const {
    Reconstruction map;
    for (int n = first; n <= last; ++n) {
      map.cam_from_world[FrameId{n}] = scene.true_cam_from_world.at(FrameId{n});
      map.center_in_world[FrameId{n}] = scene.true_center_in_world.at(FrameId{n});
    }
    for (Track track : scene.tracks) {
      std::erase_if(track.observations, [&](const Observation& observation) {
        return !map.center_in_world.contains(observation.frame);
      });
      if (track.observations.size() < 2) continue;
      map.point_in_world[track.id] = scene.true_point_in_world.at(track.id);
      map.tracks.push_back(std::move(track));
    }
    return map;
  }

  Similarity Place(const std::vector<Track>& tracks) const {
    return AlignComponent(
        placed,
        part,
        {scene.true_cam_from_world, timestamps_s, segments, tracks, scene.camera, resection});
  }

  // How far the part's frame then is from where it was.
  double ErrorOf(const Similarity& similarity, int frame) const {
    return (similarity.Move(part.center_in_world.at(FrameId{frame})) -
            scene.true_center_in_world.at(FrameId{frame}))
        .norm();
  }
  double Step() const {
    return (scene.true_center_in_world.at(FrameId{20}) - scene.true_center_in_world.at(FrameId{19}))
        .norm();
  }
};

TEST(AlignComponent, ThingsStayAsFarAwayWhateverTheSpeed) {
  Boundary boundary;
  boundary.Cut(19, 20);
  const Similarity as_it_is = boundary.Place({});
  EXPECT_NEAR(as_it_is.scale / boundary.truth.scale, 1.0, 0.1);
  EXPECT_LT((as_it_is.turn * boundary.truth.turn.Inverse()).AngleDeg(), 1e-9);
  for (double& time : boundary.timestamps_s) {
    if (time > 19.0) time = 19.0 + 10.0 * (time - 19.0);
  }
  EXPECT_EQ(boundary.Place({}).scale, as_it_is.scale);
}

TEST(AlignComponent, FramesThatSeePointsOfBothTellThePlace) {
  Boundary boundary;
  boundary.Cut(15, 25);
  const Similarity seen = boundary.Place(boundary.scene.tracks);
  // The scale, 4 % off here, moves the points that the frames stand by.
  EXPECT_LT(boundary.ErrorOf(seen, 25), 0.4 * boundary.Step());
  // With nothing in between ten steps at the last velocity, on a street that is not quite straight.
  EXPECT_GT(boundary.ErrorOf(boundary.Place({}), 25), 2.0 * boundary.ErrorOf(seen, 25));
}

TEST(AlignComponent, WithoutSuchFramesTheVelocityGoesOn) {
  Boundary boundary;
  boundary.Cut(19, 22);
  EXPECT_LT(boundary.ErrorOf(boundary.Place({}), 22), 0.5 * boundary.Step());
}

TEST(AlignComponent, WhatLiesInBetweenGoesInBetween) {
  Boundary boundary;
  boundary.placed = boundary.Part(0, 39);
  boundary.part = Moved(boundary.Part(18, 21), boundary.truth.Inverse());
  for (int n = 17; n <= 22; ++n) boundary.placed.center_in_world.erase(FrameId{n});
  EXPECT_LT(boundary.ErrorOf(boundary.Place({}), 18), 0.5 * boundary.Step());
}

TEST(AlignComponent, APartBeforeAllElseGoesBefore) {
  Boundary boundary;
  boundary.placed = boundary.Part(20, 39);
  boundary.part = Moved(boundary.Part(0, 18), boundary.truth.Inverse());
  const Similarity before = boundary.Place({});
  EXPECT_NEAR(before.scale / boundary.truth.scale, 1.0, 0.1);
  EXPECT_LT(boundary.ErrorOf(before, 18), 0.5 * boundary.Step());
}

TEST(AlignComponent, WithinAPureRotationSegmentItStandsWhereThatBegan) {
  Boundary boundary;
  boundary.Cut(19, 24);
  boundary.segments.push_back({FrameId{19}, FrameId{24}, 1.0, {}});
  const Similarity held = boundary.Place(boundary.scene.tracks);
  EXPECT_LT((held.Move(boundary.part.center_in_world.at(FrameId{24})) -
             boundary.placed.center_in_world.at(FrameId{19}))
                .norm(),
            1e-9);
}

}  // namespace
}  // namespace rotslam
