#include "apps/slam/map/pure_rotation_decision.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

// A camera that looks around in its place, or drives along a street.
BaScene MakeScene(bool turns) {
  return MakeBaScene({.num_frames = 24,
                      .num_points = 2200,
                      .noise_px = 0.5,
                      .outlier_ratio = 0.05,
                      .still_first = 0,
                      .still_last = turns ? 23 : -1});
}

Camera WithFocal(Camera camera, double factor) {
  camera.fx *= factor;
  camera.fy *= factor;
  return camera;
}

// The camera of a turn stands `arm` before its axis; points are 2 to some 15 away.
BaScene SceneOffAxis(double arm, double sigma_px) {
  BaScene scene = MakeScene(true);
  std::mt19937 random(5);
  std::normal_distribution<double> noise_px(0.0, sigma_px);
  for (auto& [frame, center] : scene.truth.center_in_world) {
    center = scene.truth.cam_from_world.at(frame).Inverse() * Eigen::Vector3d(0.0, 0.0, arm);
  }
  for (Track& track : scene.truth.tracks) {
    for (Observation& observation : track.observations) {
      const Eigen::Vector3d in_cam = scene.truth.cam_from_world.at(observation.frame) *
                                     (scene.truth.point_in_world.at(track.id) -
                                      scene.truth.center_in_world.at(observation.frame));
      observation.keypoint_px =
          *scene.camera.Project(in_cam) + Eigen::Vector2d(noise_px(random), noise_px(random));
      observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
    }
  }
  return scene;
}

// A point seen in two frames tells nothing that the pair's epipolar geometry has not; a direction
// does, and so does each further frame that sees the point.
TEST(Evidence, CountsNoCheckThatMatchesHadPassedBefore) {
  const double no_limit = 0.0;
  EXPECT_EQ(Evidence({.num_observations = 200, .num_tracks = 100, .redundancy = 100}, no_limit), 0);
  EXPECT_EQ(Evidence({.num_observations = 200, .num_tracks = 100, .redundancy = 200}, no_limit),
            100);
  EXPECT_EQ(Evidence({.num_observations = 300, .num_tracks = 100, .redundancy = 300}, no_limit),
            100);
}

TEST(DetectPureRotation, BelievesInATurnThatAnotherLensExplains) {
  const BaScene scene = MakeScene(true);
  const BundleProblem start = PerturbedProblem(scene, 0.3, 0.0);
  for (const double factor : {0.94, 1.06}) {
    const auto rotating = DetectPureRotation(
        WithFocal(scene.camera, factor), start.start.cam_from_world, start.start.tracks, {}, {});
    ASSERT_TRUE(rotating.has_value()) << factor;
    EXPECT_NEAR(rotating->camera.fx / scene.camera.fx, 1.0, 2e-3) << factor;
  }
}

// Rotations with a lens many times as long fit as well, and are fewer numbers.
TEST(DetectPureRotation, NeverBelievesThatAWallThatPassesIsATurn) {
  const BaScene scene = MakeScene(true);
  RotationMap cam_from_world;
  std::vector<Track> tracks(600);
  const Eigen::Vector2d centre_px(scene.camera.cx, scene.camera.cy);
  for (int k = 0; k < 24; ++k) {
    const FrameId frame{k};
    cam_from_world[frame] = Rotation();
    for (int n = 0; n < 600; ++n) {
      const Eigen::Vector3d point(0.4 * (n % 30) - 4.0, 0.4 * (n / 30) - 4.0, 10.0);
      const Eigen::Vector3d in_camera = point - Eigen::Vector3d(0.15 * k, 0.0, 0.0);
      const auto keypoint = scene.camera.Project(in_camera);
      if (!keypoint || (*keypoint - centre_px).cwiseAbs().maxCoeff() > centre_px.x()) continue;
      tracks[n].id = TrackId{n};
      tracks[n].observations.push_back({frame, *keypoint, in_camera.normalized()});
    }
  }
  std::erase_if(tracks, [](const Track& track) { return track.observations.size() < 3; });
  ASSERT_GT(tracks.size(), 200U);
  EXPECT_FALSE(DetectPureRotation(scene.camera, cam_from_world, tracks, {}, {}).has_value());
}

TEST(DetectPureRotation, LeavesAGoodCalibrationToTheTestOfPairs) {
  const BaScene scene = MakeScene(true);
  const Explanation poor_map{.num_observations = 500, .num_tracks = 100, .redundancy = 300};
  EXPECT_FALSE(
      DetectPureRotation(scene.camera, scene.truth.cam_from_world, scene.truth.tracks, poor_map, {})
          .has_value());
}

TEST(DetectPureRotation, BelievesInATurnWhereThereIsNoMap) {
  const BaScene scene = MakeScene(true);
  const auto rotating =
      DetectPureRotation(scene.camera, scene.truth.cam_from_world, scene.truth.tracks, {}, {});
  ASSERT_TRUE(rotating.has_value());
  EXPECT_FALSE(rotating->lens_refined);
  EXPECT_EQ(rotating->camera, scene.camera);
}

TEST(DetectPureRotation, NeverBelievesThatAStreetIsATurn) {
  const BaScene scene = MakeScene(false);
  for (const double factor : {1.0, 1.06}) {
    const Camera camera = WithFocal(scene.camera, factor);
    EXPECT_FALSE(DetectPureRotation(camera, scene.truth.cam_from_world, scene.truth.tracks, {}, {})
                     .has_value())
        << factor;
  }
}

// The camera stands off the axis of its turns, so that it moves by a fortieth to a fifth of the
// distances around it. With a longer lens rotations alone explain nearly all of that within the
// limit, and need one number less for each track, but not as closely.
TEST(DetectPureRotation, GivesWayToPositionsThatExplainMoreClosely) {
  const BaScene scene = SceneOffAxis(0.4, 0.2);
  const BundleResult moving = RefineBundle(PerturbedProblem(scene, 0.0, 0.0), {});
  ASSERT_TRUE(moving.Usable());
  const PureRotationResult rotating =
      RefinePureRotation(scene.camera, scene.truth.cam_from_world, scene.truth.tracks, {});
  const Explanation by_moving = ExplanationBy({moving.summary});
  EXPECT_GT(ExplanationBy(rotating).redundancy, by_moving.redundancy);
  EXPECT_FALSE(DetectPureRotation(
                   scene.camera, scene.truth.cam_from_world, scene.truth.tracks, by_moving, {})
                   .has_value());
}

TEST(DetectPureRotation, GivesWayToPositionsThatExplainMore) {
  const BaScene scene = MakeScene(true);
  const Camera camera = WithFocal(scene.camera, 1.06);
  const auto rotating =
      DetectPureRotation(camera, scene.truth.cam_from_world, scene.truth.tracks, {}, {});
  ASSERT_TRUE(rotating.has_value());
  EXPECT_FALSE(
      DetectPureRotation(
          camera, scene.truth.cam_from_world, scene.truth.tracks, ExplanationBy(*rotating), {})
          .has_value());
}

// Edges from each frame to the next two.
ViewGraph GraphOf(const BaScene& scene) {
  ViewGraph graph;
  const RotationMap& rotations = scene.truth.cam_from_world;
  for (const auto& [i, i_from_world] : rotations) {
    for (int step = 1; step <= 2; ++step) {
      const auto j = rotations.find(FrameId{i.value + step});
      if (j == rotations.end()) continue;
      graph.AddEdge({.i = i, .j = j->first, .j_from_i = j->second * i_from_world.Inverse()});
    }
  }
  return graph;
}

TEST(PairsAllowPureRotation, OfACameraThatTurns) {
  const BaScene scene = MakeScene(true);
  EXPECT_TRUE(
      PairsAllowPureRotation(GraphOf(scene), scene.truth.tracks, scene.camera.MeanFocal(), {}));
}

TEST(PairsAllowPureRotation, NotOfOneThatMoves) {
  const BaScene scene = MakeScene(false);
  EXPECT_FALSE(
      PairsAllowPureRotation(GraphOf(scene), scene.truth.tracks, scene.camera.MeanFocal(), {}));
}

TEST(PairsAllowPureRotation, WhereNoPairSharesTracks) {
  const BaScene scene = MakeScene(false);
  EXPECT_TRUE(PairsAllowPureRotation(GraphOf(scene), {}, scene.camera.MeanFocal(), {}));
  EXPECT_TRUE(PairsAllowPureRotation({}, scene.truth.tracks, scene.camera.MeanFocal(), {}));
}

// Whether the whole of the scene, called a turn in place, is one off the axis of rotation.
bool IsOffAxis(const BaScene& scene, const Camera& camera) {
  std::vector<Track> tracks = scene.truth.tracks;
  for (Track& track : tracks) {
    for (Observation& observation : track.observations) {
      observation.bearing = *camera.Unproject(observation.keypoint_px);
    }
  }
  const PureRotationSegment segment = {FrameId{0}, FrameId{23}};
  return WithoutOffAxisRotations(
             {segment}, {camera, GraphOf(scene), scene.truth.cam_from_world, tracks}, {}, {})
      .empty();
}

TEST(WithoutOffAxisRotations, SeesTheArmThroughAnyLens) {
  const BaScene scene = SceneOffAxis(0.2, 0.05);
  for (const double factor : {0.995, 1.0, 1.005}) {
    EXPECT_TRUE(IsOffAxis(scene, WithFocal(scene.camera, factor))) << factor;
  }
}

TEST(WithoutOffAxisRotations, SeesNoneWhereOnlyTheLensIsWrong) {
  const BaScene scene = SceneOffAxis(0.0, 0.05);
  for (const double factor : {0.99, 0.995, 1.0, 1.005, 1.01}) {
    EXPECT_FALSE(IsOffAxis(scene, WithFocal(scene.camera, factor))) << factor;
  }
}

TEST(WithoutOffAxisRotations, DoesNotAskACameraAtRest) {
  const BaScene scene = SceneOffAxis(0.2, 0.05);
  const PureRotationSegment rest = {FrameId{0}, FrameId{23}, 1.0, {{FrameId{2}, FrameId{21}}}};
  const ViewGraph graph = GraphOf(scene);
  EXPECT_EQ(
      WithoutOffAxisRotations(
          {rest}, {scene.camera, graph, scene.truth.cam_from_world, scene.truth.tracks}, {}, {})
          .size(),
      1U);
}

TEST(WithoutOffAxisRotations, NotWhereNothingIsSeen) {
  const BaScene scene = SceneOffAxis(0.2, 0.05);
  const PureRotationSegment segment = {FrameId{0}, FrameId{23}};
  const ViewGraph graph = GraphOf(scene);
  EXPECT_EQ(WithoutOffAxisRotations(
                {segment}, {scene.camera, graph, scene.truth.cam_from_world, {}}, {}, {})
                .size(),
            1U);
}

}  // namespace
}  // namespace rotslam
