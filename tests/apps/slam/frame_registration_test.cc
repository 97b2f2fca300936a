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

  explicit Street(int num_points) {
    SceneOptions options;
    options.path = ScenePath::kStreet;
    options.num_views = 51;
    options.num_points = num_points;
    options.noise_px = 1.0;
    scene = MakeScene(options);
    SceneRandom random(1);
    for (const auto& [frame, rotation] : scene.true_cam_from_world) {
      orientations.timestamps_s.push_back(0.1 * frame.value);
      const Eigen::Vector3d error = random.NormalVector(kOdometrySigmaDeg * kRadFromDeg);
      result.cam_from_world[frame] = IsKeyframe(frame) ? rotation : Rotation::Exp(error) * rotation;
      if (!IsKeyframe(frame)) continue;
      result.map.cam_from_world[frame] = rotation;
      result.map.center_in_world[frame] = scene.true_center_in_world.at(frame);
    }
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
      const double sigma = kOdometrySigmaDeg * kRadFromDeg / AveragingOptions().edge_error_factor;
      edge.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
      orientations.graph.AddEdge(edge);
    }
  }

  void Place() { RegisterFrames(orientations, scene.tracks, SlamOptions(), result); }

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

}  // namespace
}  // namespace rotslam
