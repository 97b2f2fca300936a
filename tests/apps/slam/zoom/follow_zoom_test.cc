#include "apps/slam/zoom/follow_zoom.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr int kNumFrames = 60;
constexpr int kZoomBegins = 25;

Camera PinholeOf500() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500.0;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

// How a camera films: where it is, and its focal length as a share of 500 px.
struct Filming {
  std::function<Eigen::Vector3d(int frame)> center_in_world;
  std::function<double(int frame)> scale;
};

// From one focal length to another in the frames 25 to 40: half a second.
std::function<double(int)> Ramp(double from, double to) {
  return [=](int frame) {
    return from + (to - from) * std::clamp((frame - kZoomBegins) / 15.0, 0.0, 1.0);
  };
}

Eigen::Vector3d Sideways(int frame) { return {0.05 * frame, 0.0, 0.0}; }
Eigen::Vector3d Ahead(int frame) { return {0.0, 0.0, 0.08 * frame}; }
Eigen::Vector3d OnTheSpot(int) { return Eigen::Vector3d::Zero(); }

struct Filmed {
  OdometryResult tracked;
  std::map<FrameId, ZoomedPose> poses;
};

// What it shows of points from 4 to 12 units away, with a noise of 0.3 px, and orientations as an
// odometry has them that does not know of the zoom: off by 0.3 deg.
Filmed FilmedBy(const Filming& filming) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise_px(0.0, 0.3);
  std::uniform_real_distribution<double> lateral(-8.0, 8.0);
  std::uniform_real_distribution<double> depth(4.0, 12.0);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 3000; ++n) {
    points.emplace_back(lateral(random), lateral(random), depth(random));
  }
  Filmed filmed;
  for (int k = 0; k < kNumFrames; ++k) {
    const FrameId frame{k};
    ZoomedPose& pose = filmed.poses[frame];
    pose.cam_from_world = Rotation::Exp({0.0, 0.005 * k, 0.0});
    pose.center_in_world = filming.center_in_world(k);
    pose.log_scale = std::log(filming.scale(k));
    Features& features = filmed.tracked.features[frame];
    features.frame = frame;
    for (int n = 0; n < static_cast<int>(points.size()); ++n) {
      const auto px = ProjectZoomed(PinholeOf500(), pose, points[n]);
      if (!px || px->x() < 0.0 || px->y() < 0.0 || px->x() > 639.0 || px->y() > 479.0) continue;
      features.tracks.push_back(TrackId{n});
      features.keypoints_px.push_back(*px + Eigen::Vector2d(noise_px(random), noise_px(random)));
    }
    const double error_deg = k < kZoomBegins ? 0.0 : 0.3;
    filmed.tracked.cam_from_world[frame] =
        Rotation::Exp({error_deg * kRadFromDeg, 0.0, 0.0}) * pose.cam_from_world;
  }
  return filmed;
}

// @param first  where the zoom is said to begin.
std::optional<FollowedZoom> Follow(const Filming& filming, int first = kZoomBegins) {
  const Filmed filmed = FilmedBy(filming);
  const auto map_of_part = [&](const OdometryResult& part, const Camera& /*camera*/) {
    FramesBeforeZoom before;
    before.camera = PinholeOf500();
    before.moves = filming.center_in_world(10) != filming.center_in_world(0);
    for (const auto& [frame, features] : part.features) {
      before.poses[frame] = filmed.poses.at(frame);
    }
    return std::optional(before);
  };
  return FollowZoom(
      filmed.tracked, PinholeOf500(), {FrameId{first}, FrameId{first + 10}, 1.1}, map_of_part);
}

struct ZoomCase {
  std::string name;
  Filming filming;
  double tolerance;  // of the focal length, in every frame
};

class FollowZoomTest : public testing::TestWithParam<ZoomCase> {};

TEST_P(FollowZoomTest, FindsTheFocalLengthOfEveryFrame) {
  const auto followed = Follow(GetParam().filming);
  ASSERT_TRUE(followed.has_value());
  for (int k = 0; k < kNumFrames; ++k) {
    const double expected = GetParam().filming.scale(k);
    EXPECT_NEAR(ScaleOf(followed->scales, FrameId{k}) / expected, 1.0, GetParam().tolerance)
        << "frame " << k;
  }
  EXPECT_NEAR(followed->zoom.first.value, kZoomBegins, 3);
  EXPECT_NEAR(followed->zoom.last.value, kZoomBegins + 15, 3);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    FollowZoomTest,
    testing::Values(ZoomCase{"Sideways", {Sideways, Ramp(1.0, 1.4)}, 0.005},
                    ZoomCase{"SidewaysThreefold", {Sideways, Ramp(1.0, 3.0)}, 0.005},
                    ZoomCase{"SidewaysBack", {Sideways, Ramp(1.0, 0.7)}, 0.005},
                    ZoomCase{"Ahead", {Ahead, Ramp(1.0, 1.4)}, 0.01},
                    ZoomCase{"AheadBack", {Ahead, Ramp(1.0, 0.7)}, 0.01},
                    ZoomCase{"OnTheSpot", {OnTheSpot, Ramp(1.0, 1.4)}, 0.005},
                    ZoomCase{"OnTheSpotThreefold", {OnTheSpot, Ramp(1.0, 3.0)}, 0.005}),
    [](const auto& instance) { return instance.param.name; });

TEST(FollowZoom, FollowsNoneThatIsNone) {
  EXPECT_FALSE(Follow({Sideways, [](int) { return 1.0; }}).has_value());
  EXPECT_FALSE(Follow({Ahead, [](int) { return 1.0; }}).has_value());
}

TEST(FollowZoom, TakesASmallChangeForNone) {
  EXPECT_FALSE(Follow({Sideways, Ramp(1.0, 1.07)}).has_value());
}

TEST(FollowZoom, NeedsFramesBeforeIt) {
  EXPECT_FALSE(Follow({Sideways, Ramp(1.0, 1.4)}, 8).has_value());
}

}  // namespace
}  // namespace rotslam
