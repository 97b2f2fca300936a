#include "rotodom/view_graph/fisheye_check.h"

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/rotodom/self_calibration/filmed_room.h"

namespace rotslam {
namespace {

struct Footage {
  std::map<FrameId, Features> features;
  ViewGraph graph;
};

// Points all around, seen by a camera that rotates and translates a little, with a noise of 0.2 px.
Footage Film(const Camera& camera) {
  constexpr int kFrames = 20;
  constexpr int kReach = 8;
  std::mt19937 random(3);
  std::normal_distribution<double> noise_px(0.0, 0.2);
  std::normal_distribution<double> place(0.0, 3.0);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 1500; ++n) points.emplace_back(place(random), place(random), place(random));
  Footage footage;
  std::vector<Rotation> cam_from_world;
  for (int k = 0; k < kFrames; ++k) {
    cam_from_world.push_back(Rotation::Exp({0.01 * k, 0.03 * k, 0.0}));
    const Eigen::Vector3d center_in_world(0.02 * k, 0.01 * k, 0.0);
    Features& features = footage.features[FrameId{k}];
    features.frame = FrameId{k};
    for (int n = 0; n < static_cast<int>(points.size()); ++n) {
      const auto px = camera.Project(cam_from_world[k] * (points[n] - center_in_world));
      if (!px || px->x() < 0.0 || px->y() < 0.0 || px->x() > camera.width - 1.0 ||
          px->y() > camera.height - 1.0) {
        continue;
      }
      features.tracks.push_back(TrackId{n});
      features.keypoints_px.push_back(*px + Eigen::Vector2d(noise_px(random), noise_px(random)));
    }
    for (int before = std::max(0, k - kReach); before < k; ++before) {
      RelativeRotation edge;
      edge.i = FrameId{before};
      edge.j = FrameId{k};
      edge.j_from_i = cam_from_world[k] * cam_from_world[before].Inverse();
      footage.graph.AddEdge(edge);
    }
  }
  return footage;
}

FisheyeCheck Check(const Camera& given, const Camera& true_camera) {
  const Footage footage = Film(true_camera);
  return CheckForFisheye(given, footage.features, footage.graph, {});
}

TEST(CheckForFisheye, NoticesOneThatIsGivenAsAPinhole) {
  const Camera fisheye = LensOfModel(CameraModel::kEquidistant, 200.0);
  for (const double focal_px : {180.0, 200.0, 250.0}) {
    const FisheyeCheck check = Check(LensOfModel(CameraModel::kPinhole, focal_px), fisheye);
    EXPECT_TRUE(check.IsFisheye()) << focal_px << ": " << check.num_by_camera << " and "
                                   << check.num_by_fisheye << " of " << check.num_points;
  }
}

TEST(CheckForFisheye, RefusesNoRightCamera) {
  Camera barrel = LensOfModel(CameraModel::kRadtan, 300.0);
  barrel.distortion = {-0.25, 0.06};
  for (const Camera& camera : {LensOfModel(CameraModel::kPinhole, 300.0),
                               barrel,
                               LensOfModel(CameraModel::kEquidistant, 200.0)}) {
    EXPECT_FALSE(Check(camera, camera).IsFisheye()) << Describe(camera);
  }
  // Nor one whose focal length is off.
  EXPECT_FALSE(
      Check(LensOfModel(CameraModel::kPinhole, 360.0), LensOfModel(CameraModel::kPinhole, 300.0))
          .IsFisheye());
}

TEST(CheckForFisheye, TakesNoPairsOfANarrowView) {
  const Camera narrow = LensOfModel(CameraModel::kPinhole, 900.0);
  EXPECT_EQ(Check(narrow, narrow).num_pairs, 0);
}

}  // namespace
}  // namespace rotslam
