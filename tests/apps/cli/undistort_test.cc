// Images and keypoints without distortion.

#include "apps/cli/export/undistort.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "output/map/map_keypoints.h"
#include "tests/output/scene_map.h"

namespace rotslam {
namespace {

std::vector<Camera> Lenses() {
  Camera camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = 200.0;
  camera.fy = 205.0;
  camera.cx = 165.0;
  camera.cy = 118.0;
  std::vector<Camera> lenses(4, camera);
  lenses[0].model = CameraModel::kRadtan;
  lenses[0].distortion = {-0.3, 0.1, 1e-3, -1e-3, -0.01};
  lenses[1].model = CameraModel::kRadtan;  // a pincushion
  lenses[1].distortion = {0.2, 0.05};
  lenses[2].model = CameraModel::kEquidistant;
  lenses[2].distortion = {0.01, -0.02, 0.003, -4e-4};
  lenses[3].model = CameraModel::kFov;
  lenses[3].distortion = {0.9};
  return lenses;
}

// An image whose value at a pixel says what ray it shows: an angle to one of two planes.
cv::Mat RayImage(const Camera& camera, int axis) {
  cv::Mat image(camera.height, camera.width, CV_32F);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector3d bearing = camera.Unproject(Eigen::Vector2d(x, y)).value();
      image.at<float>(y, x) = static_cast<float>(std::atan2(bearing[axis], bearing.z()));
    }
  }
  return image;
}

TEST(Undistort, ShowsTheSameRaysWithoutEmptyBorders) {
  for (const Camera& from : Lenses()) {
    const Camera to = UndistortedCamera(from);
    EXPECT_EQ(to.model, CameraModel::kPinhole);
    EXPECT_NEAR(to.fx / to.fy, from.fx / from.fy, 1e-12);
    const ImageUndistorter undistort(from, to);
    for (const int axis : {0, 1}) {
      const cv::Mat undistorted = undistort(RayImage(from, axis));
      ASSERT_EQ(undistorted.size(), cv::Size(to.width, to.height));
      // Interpolation needs neighbours, which the border does not have.
      const cv::Rect inner(3, 3, to.width - 6, to.height - 6);
      EXPECT_LT(cv::norm(undistorted(inner), RayImage(to, axis)(inner), cv::NORM_INF), 7e-4)
          << Describe(from);
    }
    // A little wider, and a part of the border is not in the image.
    Camera wider = to;
    wider.fx *= 0.98;
    wider.fy *= 0.98;
    bool is_filled = true;
    for (int x = 0; x < to.width; ++x) {
      for (int y = 0; y < to.height; ++y) {
        const auto pixel = from.Project(wider.Unproject(Eigen::Vector2d(x, y)).value());
        is_filled = is_filled && pixel && pixel->minCoeff() >= -1e-6 &&
                    pixel->x() <= from.width - 1.0 && pixel->y() <= from.height - 1.0;
      }
    }
    EXPECT_FALSE(is_filled) << Describe(from);
  }
}

TEST(Undistort, MovesKeypointsToTheirRays) {
  RunMap map = MapOfScene(ExportScene());
  map.camera.model = CameraModel::kRadtan;
  map.camera.distortion = {-0.2, 0.03, 1e-3, -1e-3};
  for (MapTrack& entry : map.tracks) {
    for (Observation& seen : entry.track.observations) {
      seen.bearing = map.camera.Unproject(seen.keypoint_px).value();
    }
  }
  ViewGraphMatches matches;
  const Observation known = map.tracks[1].track.observations[0];
  matches.keypoints_px[known.frame] = {known.keypoint_px.cast<float>(), {0.0F, 0.0F}};
  const RunMap before = map;
  const Camera to = UndistortedCamera(map.camera);
  UndistortMap(to, map);
  UndistortMatches(before.camera, to, matches);
  EXPECT_EQ(map.camera, to);
  EXPECT_EQ(map.frames[0].image, "frame0.png");
  EXPECT_GT(map.tracks.size(), before.tracks.size() / 2);
  for (const MapTrack& entry : map.tracks) {
    ASSERT_EQ(entry.fits.size(), entry.track.observations.size());
    ASSERT_EQ(entry.levels.size(), entry.track.observations.size());
    for (const Observation& seen : entry.track.observations) {
      EXPECT_LT((to.Unproject(seen.keypoint_px).value() - seen.bearing).norm(), 1e-9);
      EXPECT_GE(seen.keypoint_px.minCoeff(), 0.0);
      EXPECT_LE(seen.keypoint_px.x(), to.width - 1.0);
    }
  }
  // Keypoints of matches stay those of the map, to the last bit.
  const MapTrack& moved =
      map.tracks[1].track.id == before.tracks[1].track.id ? map.tracks[1] : map.tracks[0];
  if (moved.track.id == before.tracks[1].track.id &&
      moved.track.observations[0].frame == known.frame) {
    EXPECT_EQ(matches.keypoints_px[known.frame][0],
              moved.track.observations[0].keypoint_px.cast<float>());
  }
  EXPECT_LT(matches.keypoints_px[known.frame][1].x(), -1e5F);  // the corner is cut off
}

}  // namespace
}  // namespace rotslam
