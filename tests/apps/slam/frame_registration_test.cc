#include "apps/slam/frame_registration.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr int kKeyframeEvery = 5;
constexpr double kOdometrySigmaDeg = 0.01;

bool IsKeyframe(FrameId frame) { return frame.value % kKeyframeEvery == 0; }

// A street whose points and keyframes are known, with orientations between these that are a little
// off. Few points and much noise: alone they would trade turns for steps.
struct Street {
  Scene scene;
  Orientations orientations;
  MapResult result;
  SlamOptions options;

  explicit Street(int num_points) {
    SceneOptions scene_options;
    scene_options.path = ScenePath::kStreet;
    scene_options.num_views = 51;
    scene_options.num_points = num_points;
    scene_options.noise_px = 1.0;
    scene = MakeScene(scene_options);
    SceneRandom random(1);
    for (const auto& [frame, rotation] : scene.true_cam_from_world) {
      orientations.timestamps_s.push_back(0.1 * frame.value);
      const Eigen::Vector3d error = random.NormalVector(kOdometrySigmaDeg * kRadFromDeg);
      result.cam_from_world[frame] = IsKeyframe(frame) ? rotation : Rotation::Exp(error) * rotation;
      if (!IsKeyframe(frame)) continue;
      result.map.cam_from_world[frame] = rotation;
      result.map.center_in_world[frame] = scene.true_center_in_world.at(frame);
    }
    orientations.cam_from_world = result.cam_from_world;
    result.map.point_in_world = scene.true_point_in_world;
    result.camera = scene.camera;
  }

  // Each frame's edge to the keyframe before it says how well it is known.
  void AddEdges() {
    for (const auto& [frame, rotation] : result.cam_from_world) {
      const FrameId keyframe{frame.value - frame.value % kKeyframeEvery};
      if (frame == keyframe) continue;
      RelativeRotation edge{
          keyframe, frame, rotation * result.cam_from_world.at(keyframe).Inverse()};
      const double sigma =
          kOdometrySigmaDeg * kRadFromDeg / options.rotodom.averaging.edge_error_factor;
      edge.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
      orientations.graph.AddEdge(edge);
    }
  }

  void Place() { RegisterFrames(orientations, scene.tracks, options, result); }

  // Root mean square over the frames between keyframes.
  double AngleErrorDeg() const {
    double sum = 0.0;
    int count = 0;
    for (const auto& [frame, rotation] : result.cam_from_world) {
      if (IsKeyframe(frame)) continue;
      const double angle = (rotation * scene.true_cam_from_world.at(frame).Inverse()).AngleDeg();
      sum += angle * angle;
      ++count;
    }
    return std::sqrt(sum / count);
  }
};

TEST(RegisterFrames, KeepsNearTheOrientationsOfTheOdometry) {
  Street unknown(200);  // without an edge nothing says how good the orientations are
  const double odometry_deg = unknown.AngleErrorDeg();
  unknown.Place();
  Street known(200);
  known.AddEdges();
  known.Place();
  EXPECT_GT(known.result.num_resected, 30);
  EXPECT_LT(known.AngleErrorDeg(), odometry_deg);
  EXPECT_GT(unknown.AngleErrorDeg(), 3.0 * odometry_deg) << "the points alone are no better";
}

TEST(RegisterFrames, TakesThePlaceOfASegmentAndInterpolatesWithoutPoints) {
  Street whole(1000);
  whole.Place();
  Street street(1000);
  street.result.segments.push_back({FrameId{5}, FrameId{8}, 1.0});
  for (Track& track : street.scene.tracks) {
    std::erase_if(track.observations,
                  [](const Observation& sighting) { return sighting.frame == FrameId{12}; });
  }
  street.Place();
  const CenterMap& centers = street.result.center_in_world;
  ASSERT_EQ(centers.size(), street.scene.true_center_in_world.size());
  EXPECT_EQ(centers.at(FrameId{7}), centers.at(FrameId{5}));
  EXPECT_NE(centers.at(FrameId{9}), centers.at(FrameId{5}));
  EXPECT_EQ(street.result.num_interpolated, whole.result.num_interpolated + 1);
  const Eigen::Vector3d middle = 0.5 * (centers.at(FrameId{11}) + centers.at(FrameId{13}));
  EXPECT_TRUE(centers.at(FrameId{12}).isApprox(middle, 1e-9));
}

constexpr FrameId kFlipped{11};  // has an edge from the frame before

TEST(RegisterFrames, SaysWhichKeyframeLeavesTheOdometry) {
  Street street(1000);
  street.AddEdges();
  MapComponent component;
  for (const auto& [frame, rotation] : street.result.map.cam_from_world) {
    component.keyframes.insert(frame);
    if (frame.value == 0) continue;
    RelativeRotation edge = street.orientations.graph.edges().front();
    edge.i = FrameId{frame.value - kKeyframeEvery};
    edge.j = frame;
    edge.j_from_i = rotation * street.result.map.cam_from_world.at(edge.i).Inverse();
    street.orientations.graph.AddEdge(edge);
  }
  street.result.components.push_back(component);
  const FrameId turned{15};
  Rotation& rotation = street.result.map.cam_from_world.at(turned);
  rotation = Rotation::Exp({0.0, 3.0 * kRadFromDeg, 0.0}) * rotation;
  street.result.cam_from_world[turned] = rotation;
  street.Place();
  EXPECT_EQ(street.result.frame_poses.at(turned).note,
            "orientation leaves the odometry: by 3.0 deg since keyframe 10");
  EXPECT_EQ(street.result.frame_poses.at(FrameId{20}).note,
            "orientation leaves the odometry: by 3.0 deg since keyframe 15");
  EXPECT_EQ(street.result.frame_poses.at(FrameId{10}).note, "");
  EXPECT_EQ(street.result.frame_poses.at(FrameId{25}).note, "");
}

TEST(RegisterFrames, HoldsAFlipToTheOdometry) {
  Street street(1000);
  street.AddEdges();
  const Rotation odometry = street.result.cam_from_world.at(kFlipped);
  street.result.cam_from_world[kFlipped] = Rotation::Exp({0.0, 2.5 * kRadFromDeg, 0.0}) * odometry;
  for (Track& track : street.scene.tracks) {
    std::erase_if(track.observations,
                  [](const Observation& sighting) { return sighting.frame == kFlipped; });
  }
  street.Place();
  EXPECT_LT((street.result.cam_from_world.at(kFlipped) * odometry.Inverse()).AngleDeg(), 1e-6);
  const FramePose& pose = street.result.frame_poses.at(kFlipped);
  EXPECT_EQ(pose.state, PoseState::kInterpolated);
  EXPECT_EQ(pose.note, "orientation held to the odometry: the map's is 2.5 deg away");
}

TEST(RegisterFrames, GivesEveryFrameAStateAndADeviation) {
  Street street(1000);
  // Worlds of points are as wrong as their sigmas say.
  street.options.rotodom.averaging.edge_error_factor = 1.0;
  street.AddEdges();
  MapComponent component;
  for (const auto& [frame, center] : street.result.map.center_in_world) {
    component.keyframes.insert(frame);
  }
  street.result.components.push_back(component);
  street.Place();
  ASSERT_EQ(street.result.frame_poses.size(), street.result.cam_from_world.size());
  double sum = 0.0;
  int count = 0;
  for (const auto& [frame, pose] : street.result.frame_poses) {
    ASSERT_TRUE(pose.position_sigma.has_value()) << frame.value;
    if (IsKeyframe(frame) || pose.state != PoseState::kMeasured) continue;
    const Eigen::Vector3d error =
        street.result.center_in_world.at(frame) - street.scene.true_center_in_world.at(frame);
    sum += error.cwiseQuotient(*pose.position_sigma).squaredNorm() / 3.0;
    ++count;
  }
  EXPECT_GT(sum / count, 0.5) << "mean squared normalised error";
  EXPECT_LT(sum / count, 2.0);
}

}  // namespace
}  // namespace rotslam
