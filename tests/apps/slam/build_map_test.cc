#include "apps/slam/build_map.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/slam/lens_estimation.h"
#include "rotodom/self_calibration/through_lens.h"
#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

using ::testing::ElementsAre;

constexpr int kReach = 4;  // a frame has edges to so many before it

// What the first stage would have said of a scene: features, matches from frame to frame, edges.
Orientations OrientationsOf(const Scene& scene, bool rotation_only) {
  Orientations orientations;
  orientations.camera = scene.camera;
  orientations.cam_from_world = scene.cam_from_world;
  for (const auto& [frame, rotation] : scene.cam_from_world) {
    orientations.timestamps_s.push_back(0.1 * frame.value);
    orientations.image_names.push_back(std::to_string(frame.value));
    orientations.features[frame].frame = frame;
    for (int before = std::max(0, frame.value - kReach); before < frame.value; ++before) {
      RelativeRotation edge{
          FrameId{before}, frame, rotation * scene.cam_from_world.at(FrameId{before}).Inverse()};
      edge.covariance = 1e-6 * Eigen::Matrix3d::Identity();
      edge.rotation_only = rotation_only;
      edge.parallax_px = rotation_only ? 0.2 : 20.0;
      edge.num_inliers = 100;
      orientations.graph.AddEdge(edge);
    }
  }
  std::map<std::pair<FrameId, FrameId>, std::vector<std::array<int, 2>>> matches;
  for (const Track& track : scene.tracks) {
    std::optional<std::pair<FrameId, int>> last;
    for (const Observation& observation : track.observations) {
      Features& features = orientations.features[observation.frame];
      const int index = features.size();
      features.keypoints_px.push_back(observation.keypoint_px);
      features.bearings.push_back(observation.bearing);
      features.rgb.push_back({10, 20, 30});
      if (last) matches[{last->first, observation.frame}].push_back({last->second, index});
      last = {observation.frame, index};
    }
  }
  for (auto& [frames, pairs] : matches) {
    orientations.edge_matches.push_back({frames.first, frames.second, std::move(pairs)});
  }
  return orientations;
}

Scene Street() {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 24;
  options.num_points = 1200;
  options.noise_px = 0.3;
  options.rotation_noise_deg = 0.04;
  return MakeScene(options);
}

// Largest error of the turn from one keyframe to the next.
double LargestTurnErrorDeg(const RotationMap& cam_from_world,
                           const RotationMap& truth,
                           const std::set<FrameId>& keyframes) {
  double largest = 0.0;
  FrameId before = *keyframes.begin();
  for (const FrameId frame : keyframes) {
    const Rotation found = cam_from_world.at(frame) * cam_from_world.at(before).Inverse();
    const Rotation expected = truth.at(frame) * truth.at(before).Inverse();
    largest = std::max(largest, (found * expected.Inverse()).AngleDeg());
    before = frame;
  }
  return largest;
}

// Notes which stages begin and end.
class StageObserver : public SlamObserver {
 public:
  void OnBegin(SlamStage stage, int /*num_steps*/) override { begun.push_back(stage); }
  void OnEnd(SlamStage stage, const MapResult& /*map*/) override { ended.push_back(stage); }

  std::vector<SlamStage> begun;
  std::vector<SlamStage> ended;
};

MapResult BuildFrom(const Orientations& orientations) {
  StageObserver observer;
  return BuildKeyframeMap(orientations, SlamOptions(), observer);
}

TEST(BuildKeyframeMap, FindsCentresAndPointsUpToSimilarity) {
  const Scene scene = Street();
  StageObserver observer;
  const MapResult result = BuildKeyframeMap(OrientationsOf(scene, false), SlamOptions(), observer);
  EXPECT_EQ(result.failure, "");
  EXPECT_FALSE(result.rotates_throughout);
  ASSERT_EQ(result.components.size(), 1U);
  EXPECT_FALSE(result.components[0].placed_by_default);
  EXPECT_EQ(result.bundles.size(), 1U);
  EXPECT_GE(result.keyframes.size(), 5U);
  EXPECT_LT(result.keyframes.size(), 24U);
  EXPECT_EQ(result.map.center_in_world.size(), result.keyframes.size());
  const CenterMap& truth = scene.true_center_in_world;
  const Similarity truth_from_map = AlignCenters(result.map.center_in_world, truth);
  EXPECT_LT(CompareCenters(result.map.center_in_world, truth, truth_from_map).max, 0.05)
      << "over 23 m";
  const RotationMap& true_rotations = scene.true_cam_from_world;
  EXPECT_LT(LargestTurnErrorDeg(result.map.cam_from_world, true_rotations, result.keyframes),
            0.5 * LargestTurnErrorDeg(scene.cam_from_world, true_rotations, result.keyframes))
      << "bundle adjustment improves orientations";
  EXPECT_GT(result.map.point_in_world.size(), 300U);
  const MapBracket& bracket = result.final_bracket;
  EXPECT_EQ(bracket.num_observations, NumObservations(result.map.tracks));
  EXPECT_GT(bracket.gamma_low, 0.0);
  EXPECT_LE(bracket.gamma_low, bracket.gamma_high);
  EXPECT_LE(bracket.gamma_high, bracket.largest_residual);
  EXPECT_LT(bracket.largest_residual * scene.camera.MeanFocal(), 6.0 * 0.3)
      << "six deviations of the noise, far from the bound of the start";
  EXPECT_TRUE(result.cloud.point_in_world.empty()) << "that is BuildMap's";
  using enum SlamStage;
  EXPECT_THAT(observer.begun,
              ElementsAre(kTracks, kKnownRotation, kBundleAdjustment, kPureRotation));
  EXPECT_THAT(observer.ended, ElementsAre(kTracks, kKnownRotation, kBundleAdjustment));
}

TEST(BuildMap, PlacesTheOtherFramesAndMakesACloud) {
  const Scene scene = Street();
  StageObserver observer;
  const MapResult result = BuildMap(OrientationsOf(scene, false), SlamOptions(), nullptr, observer);
  EXPECT_EQ(result.failure, "");
  ASSERT_EQ(result.center_in_world.size(), 24U);
  EXPECT_EQ(result.num_resected + result.num_interpolated + result.keyframes.size(), 24U);
  EXPECT_GT(result.num_resected, 0);
  const CenterMap& truth = scene.true_center_in_world;
  const Similarity truth_from_map = AlignCenters(result.center_in_world, truth);
  EXPECT_LT(CompareCenters(result.center_in_world, truth, truth_from_map).max, 0.1);
  EXPECT_GE(result.cloud.point_in_world.size(), result.map.point_in_world.size() / 2);
  EXPECT_EQ(result.cloud.cam_from_world.size(), 24U);
  EXPECT_GT(result.num_shallow_points, 0);
  EXPECT_EQ(result.cloud.tracks.front().rgb[2], 30);
  using enum SlamStage;
  EXPECT_THAT(observer.ended,
              ElementsAre(kTracks, kKnownRotation, kBundleAdjustment, kFrameRegistration, kCloud));
}

// What the first stage would have said through another lens.
Orientations SeenThrough(const Camera& camera, Orientations orientations) {
  orientations.graph = TurnedThroughLens(orientations.graph, orientations.camera, camera);
  for (auto& [frame, features] : orientations.features) {
    for (int k = 0; k < features.size(); ++k) {
      features.bearings[k] = *camera.Unproject(features.keypoints_px[k]);
    }
  }
  for (auto& [frame, rotation] : orientations.cam_from_world) {
    if (frame.value == 0) continue;
    const FrameId before{frame.value - 1};
    rotation = orientations.graph.FindEdge(before, frame)->j_from_i *
               orientations.cam_from_world.at(before);
  }
  orientations.camera = camera;
  return orientations;
}

TEST(BuildMap, GivesOrientationsThroughTheLensThatItFinds) {
  const Scene scene = Street();
  Camera start = scene.camera;
  start.fx *= 1.08;
  start.fy *= 1.08;
  Orientations orientations = SeenThrough(start, OrientationsOf(scene, false));
  const auto error_deg = [&](const RotationMap& cam_from_world) {
    double largest = 0.0;
    for (const auto& [frame, rotation] : scene.true_cam_from_world) {
      const Rotation from_first =
          cam_from_world.at(frame) * cam_from_world.at(FrameId{0}).Inverse();
      const Rotation truth = rotation * scene.true_cam_from_world.at(FrameId{0}).Inverse();
      largest = std::max(largest, (from_first * truth.Inverse()).AngleDeg());
    }
    return largest;
  };
  const double before_deg = error_deg(orientations.cam_from_world);
  StageObserver observer;
  SlamOptions options;
  EXPECT_FALSE(BuildMap(orientations, options, nullptr, observer).through_lens)
      << "a calibration stands";
  FreeLens(PlainLens(start), options.ba.lens);
  const MapResult map = BuildMap(orientations, options, nullptr, observer);
  ASSERT_TRUE(map.through_lens);
  EXPECT_NEAR(map.camera.fx / scene.camera.fx, 1.0, 0.02);
  EXPECT_TRUE(map.lens_covariance);
  TakeThroughLens(map, orientations);
  EXPECT_EQ(orientations.camera, map.camera);
  EXPECT_EQ(orientations.graph.edges().size(), map.through_lens->graph.edges().size());
  EXPECT_LT(error_deg(orientations.cam_from_world), 0.5 * before_deg);
  // What is written for `solve` belongs to that lens, too.
  const Observation& one = map.keyframe_tracks.front().observations.front();
  EXPECT_LT((one.bearing - *map.camera.Unproject(one.keypoint_px)).norm(), 1e-12);
}

Scene Pivot() {
  SceneOptions options;
  options.path = ScenePath::kPivot;
  options.num_views = 16;
  options.num_points = 500;
  options.noise_px = 0.3;
  return MakeScene(options);
}

void ExpectNoMapOfAPureRotation(const MapResult& result) {
  EXPECT_TRUE(result.rotates_throughout);
  EXPECT_EQ(result.failure, "");
  EXPECT_TRUE(result.components.empty());
  EXPECT_TRUE(result.map.point_in_world.empty());
  ASSERT_EQ(result.segments.size(), 1U);
  EXPECT_EQ(result.segments[0].first, FrameId{0});
  EXPECT_EQ(result.segments[0].last, FrameId{15});
  ASSERT_EQ(result.center_in_world.size(), 16U);
  for (const auto& [frame, center] : result.center_in_world) EXPECT_TRUE(center.isZero(0.0));
}

TEST(BuildKeyframeMap, FindsNoPlacesWhereTheCameraOnlyRotates) {
  ExpectNoMapOfAPureRotation(BuildFrom(OrientationsOf(Pivot(), true)));
}

// Through a lens that is off, pairs of frames take the rotation for movement; all together do not.
TEST(BuildKeyframeMap, FindsThatAnotherLensMakesItAPureRotation) {
  Scene scene = Pivot();
  Camera wrong = scene.camera;
  wrong.fx *= 1.05;
  wrong.fy *= 1.05;
  for (Track& track : scene.tracks) {
    for (Observation& one : track.observations) one.bearing = *wrong.Unproject(one.keypoint_px);
  }
  Orientations orientations = OrientationsOf(scene, false);
  orientations.camera = wrong;
  const MapResult result = BuildFrom(orientations);
  ExpectNoMapOfAPureRotation(result);
  EXPECT_NEAR(result.camera.fx / scene.camera.fx, 1.0, 5e-3);
  EXPECT_GT(result.num_rotation_observations, 1000);
}

TEST(BuildKeyframeMap, SaysWhyThereIsNoMap) {
  Orientations orientations = OrientationsOf(Street(), false);
  orientations.edge_matches.clear();
  const MapResult result = BuildFrom(orientations);
  EXPECT_NE(result.failure, "");
  EXPECT_FALSE(result.rotates_throughout);
  EXPECT_EQ(result.center_in_world.size(), 24U);
}

// A phone held still: pairs of frames show a baseline of some millimetres, which gives no map.
TEST(BuildKeyframeMap, IsAtRestWhereTheParallaxIsTheTremorOfAHand) {
  const Scene scene = Pivot();
  Orientations orientations = OrientationsOf(scene, false);
  ViewGraph graph;
  for (RelativeRotation edge : orientations.graph.edges()) {
    edge.parallax_px = 0.5;
    graph.AddEdge(edge);
  }
  orientations.graph = graph;
  orientations.edge_matches.clear();
  ExpectNoMapOfAPureRotation(BuildFrom(orientations));
  // With pieces that nothing ties there is something wrong.
  orientations.breaks = {FrameId{8}};
  EXPECT_NE(BuildFrom(orientations).failure, "");
}

// No track goes on from frame 11 to frame 12: two maps, put together by continuity.
TEST(BuildKeyframeMap, AlignsComponents) {
  Scene scene = Street();
  std::vector<Track> halves;
  for (const Track& track : scene.tracks) {
    for (const bool late : {false, true}) {
      Track half = track;
      std::erase_if(half.observations,
                    [&](const Observation& one) { return (one.frame.value >= 12) != late; });
      if (half.observations.size() >= 2) halves.push_back(std::move(half));
    }
  }
  scene.tracks = std::move(halves);
  const MapResult result = BuildFrom(OrientationsOf(scene, false));
  EXPECT_EQ(result.failure, "");
  ASSERT_EQ(result.components.size(), 2U);
  EXPECT_FALSE(result.components[0].placed_by_default);
  EXPECT_TRUE(result.components[1].placed_by_default);
  const CenterMap& truth = scene.true_center_in_world;
  CenterMap early = result.map.center_in_world;
  std::erase_if(early, [](const auto& entry) { return entry.first.value >= 12; });
  const Similarity truth_from_map = AlignCenters(early, truth);
  EXPECT_LT(CompareCenters(early, truth, truth_from_map).max, 0.05);
  // The second half goes on behind the first, about as large.
  EXPECT_LT(CompareCenters(result.map.center_in_world, truth, truth_from_map).max, 2.5)
      << "over 23 m";
}

}  // namespace
}  // namespace rotslam
