#include "apps/seams.h"

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

// A street of 40 frames a second apart as one map, and the same in another world as a part; which
// frames each of them holds, and which points, is up to the test.
struct Seam {
  Scene scene;
  std::vector<double> timestamps_s;
  std::vector<HeldStretch> held;
  ResectionOptions resection;
  Reconstruction placed;
  Reconstruction part;
  Similarity truth{0.2, Rotation::Exp({0.1, -0.5, 0.2}), {3.0, 1.0, -2.0}};  // part to placed

  Seam() {
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
    return PlaceBehind(
        placed,
        part,
        {scene.true_cam_from_world, timestamps_s, held, tracks, scene.camera, resection});
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

TEST(PlaceBehind, ThingsStayAsFarAwayWhateverTheSpeed) {
  Seam seam;
  seam.Cut(19, 20);
  const Similarity as_it_is = seam.Place({});
  EXPECT_NEAR(as_it_is.scale / seam.truth.scale, 1.0, 0.1);
  EXPECT_LT((as_it_is.turn * seam.truth.turn.Inverse()).AngleDeg(), 1e-9);
  for (double& time : seam.timestamps_s) {
    if (time > 19.0) time = 19.0 + 10.0 * (time - 19.0);
  }
  EXPECT_EQ(seam.Place({}).scale, as_it_is.scale);
}

TEST(PlaceBehind, FramesThatSeePointsOfBothTellThePlace) {
  Seam seam;
  seam.Cut(15, 25);
  const Similarity seen = seam.Place(seam.scene.tracks);
  // The scale, 4 % off here, moves the points that the frames stand by.
  EXPECT_LT(seam.ErrorOf(seen, 25), 0.4 * seam.Step());
  // With nothing in between ten steps at the last velocity, on a street that is not quite straight.
  EXPECT_GT(seam.ErrorOf(seam.Place({}), 25), 2.0 * seam.ErrorOf(seen, 25));
}

TEST(PlaceBehind, WithoutSuchFramesTheVelocityGoesOn) {
  Seam seam;
  seam.Cut(19, 22);
  EXPECT_LT(seam.ErrorOf(seam.Place({}), 22), 0.5 * seam.Step());
}

TEST(PlaceBehind, WhatLiesInBetweenGoesInBetween) {
  Seam seam;
  seam.placed = seam.Part(0, 39);
  seam.part = Moved(seam.Part(18, 21), seam.truth.Inverse());
  for (int n = 17; n <= 22; ++n) seam.placed.center_in_world.erase(FrameId{n});
  EXPECT_LT(seam.ErrorOf(seam.Place({}), 18), 0.5 * seam.Step());
}

TEST(PlaceBehind, APartBeforeAllElseGoesBefore) {
  Seam seam;
  seam.placed = seam.Part(20, 39);
  seam.part = Moved(seam.Part(0, 18), seam.truth.Inverse());
  const Similarity before = seam.Place({});
  EXPECT_NEAR(before.scale / seam.truth.scale, 1.0, 0.1);
  EXPECT_LT(seam.ErrorOf(before, 18), 0.5 * seam.Step());
}

TEST(PlaceBehind, WithinAHeldStretchItStandsWhereThatBegan) {
  Seam seam;
  seam.Cut(19, 24);
  seam.held.push_back({FrameId{19}, FrameId{24}, 1.0, {}});
  const Similarity held = seam.Place(seam.scene.tracks);
  EXPECT_LT((held.Move(seam.part.center_in_world.at(FrameId{24})) -
             seam.placed.center_in_world.at(FrameId{19}))
                .norm(),
            1e-9);
}

}  // namespace
}  // namespace rotslam
