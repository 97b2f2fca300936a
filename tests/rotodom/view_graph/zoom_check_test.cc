#include "rotodom/view_graph/zoom_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr int kZoomFrames = 40;

Camera PinholeOf(double focal_px) {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = focal_px;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

// How a camera films: where it is, how it is turned, and its focal length as a share of 500 px.
struct Filming {
  std::function<Eigen::Vector3d(int frame)> center_in_world;
  double yaw_rad_per_frame = 0.01;
  std::function<double(int frame)> factor;
  double noise_px = 0.3;
};

double NoZoom(int) { return 1.0; }

// From 1 to 1.4 in the frames 15 to 25.
double ToTwoFifths(int frame) { return 1.0 + 0.4 * std::clamp((frame - 15) / 10.0, 0.0, 1.0); }

Eigen::Vector3d Sideways(int frame) { return {0.05 * frame, 0.0, 0.0}; }
Eigen::Vector3d Ahead(int frame) { return {0.0, 0.0, 0.1 * frame}; }
Eigen::Vector3d OnTheSpot(int) { return Eigen::Vector3d::Zero(); }

// The zooms in what a camera sees that is calibrated as it was in the first frame: points from 4 to
// 12 units away. The edges have the true rotations and directions.
std::vector<Zoom> ZoomsOf(const Filming& filming) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise_px(0.0, filming.noise_px);
  std::uniform_real_distribution<double> lateral(-8.0, 8.0);
  std::uniform_real_distribution<double> depth(4.0, 12.0);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 2000; ++n) {
    points.emplace_back(lateral(random), lateral(random), depth(random));
  }
  std::map<FrameId, Features> features;
  std::vector<Rotation> cam_from_world;
  ViewGraph graph;
  for (int k = 0; k < kZoomFrames; ++k) {
    const Camera camera = PinholeOf(500.0 * filming.factor(k));
    cam_from_world.push_back(Rotation::Exp({0.0, filming.yaw_rad_per_frame * k, 0.0}));
    Features& of_frame = features[FrameId{k}];
    of_frame.frame = FrameId{k};
    for (int n = 0; n < static_cast<int>(points.size()); ++n) {
      const auto px = camera.Project(cam_from_world[k] * (points[n] - filming.center_in_world(k)));
      if (!px || px->x() < 0.0 || px->y() < 0.0 || px->x() > 639.0 || px->y() > 479.0) continue;
      of_frame.tracks.push_back(TrackId{n});
      of_frame.keypoints_px.push_back(*px + Eigen::Vector2d(noise_px(random), noise_px(random)));
    }
    for (int before = std::max(0, k - 5); before < k; ++before) {
      RelativeRotation edge;
      edge.i = FrameId{before};
      edge.j = FrameId{k};
      edge.j_from_i = cam_from_world[k] * cam_from_world[before].Inverse();
      const Eigen::Vector3d way =
          cam_from_world[k] * (filming.center_in_world(before) - filming.center_in_world(k));
      if (way.norm() > 0.0) edge.translation_direction = way.normalized();
      edge.rotation_only = filming.center_in_world(k) == filming.center_in_world(before) &&
                           filming.factor(k) == filming.factor(before);
      graph.AddEdge(edge);
    }
  }
  return FindZooms(PinholeOf(500.0), features, graph, {});
}

TEST(FindZooms, FindsOneOfACameraThatMovesSideways) {
  const std::vector<Zoom> zooms = ZoomsOf({Sideways, 0.01, ToTwoFifths});
  ASSERT_EQ(zooms.size(), 1U);
  EXPECT_NEAR(zooms.front().first.value, 15, 3);
  EXPECT_NEAR(zooms.front().last.value, 25, 3);
  EXPECT_NEAR(zooms.front().factor, 1.4, 0.03);
}

// Moving ahead looks nearly the same.
TEST(FindZooms, FindsOneOfACameraThatMovesAhead) {
  const std::vector<Zoom> zooms = ZoomsOf({Ahead, 0.01, ToTwoFifths});
  ASSERT_EQ(zooms.size(), 1U);
  EXPECT_NEAR(zooms.front().first.value, 15, 3);
  EXPECT_NEAR(zooms.front().last.value, 25, 3);
  EXPECT_NEAR(zooms.front().factor, 1.4, 0.12);
}

TEST(FindZooms, FindsOneOfACameraThatOnlyTurns) {
  const std::vector<Zoom> zooms = ZoomsOf({OnTheSpot, 0.01, ToTwoFifths});
  ASSERT_EQ(zooms.size(), 1U);
  EXPECT_NEAR(zooms.front().factor, 1.4, 0.03);
}

TEST(FindZooms, FindsOneThatGoesBack) {
  const auto out = [](int frame) { return 1.4 / ToTwoFifths(frame); };
  const std::vector<Zoom> zooms = ZoomsOf({Sideways, 0.01, out});
  ASSERT_EQ(zooms.size(), 1U);
  EXPECT_NEAR(zooms.front().factor, 1.0 / 1.4, 0.03);
}

// The movement makes points expand while the zoom makes them contract. It is told, with about half
// of its size; what is left of it in the depths of later points may look like another one. With
// keypoints twice as noisy it is not told.
TEST(FindZooms, FindsOneThatGoesBackAgainstAMovementAhead) {
  const auto out = [](int frame) { return 1.4 / ToTwoFifths(frame); };
  const std::vector<Zoom> zooms = ZoomsOf({Ahead, 0.01, out, 0.15});
  const auto largest = std::min_element(
      zooms.begin(), zooms.end(), [](const Zoom& a, const Zoom& b) { return a.factor < b.factor; });
  ASSERT_NE(largest, zooms.end());
  EXPECT_NEAR(largest->first.value, 15, 3);
  EXPECT_NEAR(largest->last.value, 25, 3);
  EXPECT_LT(largest->factor, 0.88);  // 0.71 is right
  EXPECT_GT(largest->factor, 0.65);
}

// Half a percent from frame to frame.
TEST(FindZooms, FindsASlowOne) {
  const auto slow = [](int frame) { return 1.0 + 0.15 * std::clamp((frame - 5) / 30.0, 0.0, 1.0); };
  const std::vector<Zoom> zooms = ZoomsOf({Sideways, 0.01, slow});
  ASSERT_EQ(zooms.size(), 1U);
  EXPECT_NEAR(zooms.front().factor, 1.15, 0.05);
}

TEST(FindZooms, TellsTwoApart) {
  const auto twice = [](int frame) {
    return 1.0 + 0.2 * (std::clamp((frame - 6) / 6.0, 0.0, 1.0) +
                        std::clamp((frame - 27) / 6.0, 0.0, 1.0));
  };
  const std::vector<Zoom> zooms = ZoomsOf({Sideways, 0.01, twice});
  ASSERT_EQ(zooms.size(), 2U);
  EXPECT_NEAR(zooms[0].factor, 1.2, 0.03);
  EXPECT_NEAR(zooms[1].factor, 1.4 / 1.2, 0.03);
}

TEST(FindZooms, TakesNoMovementForOne) {
  for (const auto& center : {Sideways, Ahead, OnTheSpot}) {
    EXPECT_TRUE(ZoomsOf({center, 0.01, NoZoom}).empty());
    EXPECT_TRUE(ZoomsOf({center, 0.0, NoZoom}).empty());
  }
}

}  // namespace
}  // namespace rotslam
