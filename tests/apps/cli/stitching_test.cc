#include "apps/cli/commands/stitching.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

// A painted sphere: smooth, so that interpolation hardly matters; 60 to 190.
double GreyAt(const Eigen::Vector3d& direction) {
  return 125.0 + 40.0 * std::sin(5.0 * direction.x() + 2.0 * direction.y()) +
         25.0 * std::cos(7.0 * direction.z());
}

Camera SmallCamera() {
  Camera camera;
  camera.width = 120;
  camera.height = 90;
  camera.fx = camera.fy = 100.0;
  camera.cx = 59.5;
  camera.cy = 44.5;
  return camera;
}

cv::Mat Paint(const Camera& camera, const Rotation& world_from_cam, double gain) {
  cv::Mat image(camera.height, camera.width, CV_8UC1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d bearing = camera.Unproject(Eigen::Vector2d(x, y)).value();
      image.at<unsigned char>(y, x) =
          cv::saturate_cast<unsigned char>(gain * GreyAt(world_from_cam * bearing));
    }
  }
  return image;
}

// A camera that pans right round on a tilted tripod; world axes are those of the first view.
std::vector<Rotation> Pan(int num_views, double total_deg) {
  const Rotation tilt = Rotation::Exp({0.15, 0.0, 0.1});
  std::vector<Rotation> world_from_cam;
  for (int k = 0; k < num_views; ++k) {
    const double yaw = total_deg * kRadFromDeg * k / num_views;
    world_from_cam.push_back(tilt.Inverse() * Rotation::Exp({0.0, yaw, 0.0}) * tilt);
  }
  return world_from_cam;
}

struct Stitched {
  Panorama panorama;
  double largest_error = 0.0;
  double largest_step = 0.0;  // from a pixel to its right neighbour, round the whole circle
};

// Of a whole pan, compared with the painted sphere. The world's y axis is not the sphere's: the
// truth is asked for by the views themselves.
Stitched StitchPan(double gain_variation, const StitchOptions& options) {
  const Camera camera = SmallCamera();
  const std::vector<Rotation> views = Pan(24, 360.0);
  const auto read = [&](const ViewVisitor& visit) {
    for (int k = 0; k < static_cast<int>(views.size()); ++k) {
      visit(k, Paint(camera, views[k], 1.0 + gain_variation * std::sin(0.7 * k)));
    }
  };
  Stitched result;
  result.panorama = Stitch(camera, views, read, options);
  // The axis of the pan in the world: it is the sphere's vertical.
  const Rotation tilt = Rotation::Exp({0.15, 0.0, 0.1});
  const Eigen::Vector3d down = tilt.Inverse() * Eigen::Vector3d::UnitY();
  Eigen::Vector3d forward = Eigen::Vector3d::UnitZ() - down.z() * down;
  forward.normalize();
  const Eigen::Vector3d right = down.cross(forward);
  const cv::Mat& image = result.panorama.image;
  const int middle =
      static_cast<int>(result.panorama.top_deg / result.panorama.height_deg * image.rows);
  for (int column = 0; column < image.cols; ++column) {
    const double longitude =
        (result.panorama.left_deg + (column + 0.5) / image.cols * result.panorama.width_deg) *
        kRadFromDeg;
    const double latitude =
        (result.panorama.top_deg - (middle + 0.5) / image.rows * result.panorama.height_deg) *
        kRadFromDeg;
    const Eigen::Vector3d direction =
        std::cos(latitude) * (std::sin(longitude) * right + std::cos(longitude) * forward) -
        std::sin(latitude) * down;
    const double grey = image.at<cv::Vec3b>(middle, column)[0];
    const double next = image.at<cv::Vec3b>(middle, (column + 1) % image.cols)[0];
    result.largest_error = std::max(result.largest_error, std::abs(grey - GreyAt(direction)));
    result.largest_step = std::max(result.largest_step, std::abs(next - grey));
  }
  return result;
}

TEST(Stitch, ShowsTheSphereRightRound) {
  const Stitched stitched = StitchPan(0.0, {});
  EXPECT_EQ(stitched.panorama.image.cols, 628);  // 2 pi f
  EXPECT_DOUBLE_EQ(stitched.panorama.width_deg, 360.0);
  EXPECT_LT(stitched.panorama.height_deg, 80.0);
  EXPECT_LT(stitched.largest_error, 1.5);
  // 0.57 deg from pixel to pixel, at most 4 grey levels by the painting itself.
  EXPECT_LT(stitched.largest_step, 5.0);
}

TEST(Stitch, TakesOutTheExposure) {
  StitchOptions plain;
  plain.compensate_exposure = false;
  EXPECT_GT(StitchPan(0.15, plain).largest_error, 10.0);
  EXPECT_LT(StitchPan(0.15, {}).largest_error, 6.0);
}

TEST(Stitch, CutsToWhatWasSeenUnlessTold) {
  const Camera camera = SmallCamera();
  const std::vector<Rotation> views = Pan(10, 90.0);
  const auto read = [&](const ViewVisitor& visit) {
    for (int k = 0; k < static_cast<int>(views.size()); ++k) {
      if (k != 4) visit(k, Paint(camera, views[k], 1.0));  // one cannot be read
    }
  };
  StitchOptions options;
  options.width = 360;
  const Panorama cut = Stitch(camera, views, read, options);
  // 81 deg of turn and a view of 62 deg, the tilt taken in.
  EXPECT_NEAR(cut.width_deg, 148.0, 10.0);
  EXPECT_NEAR(cut.left_deg, -33.0, 6.0);
  options.full = true;
  const Panorama full = Stitch(camera, views, read, options);
  EXPECT_EQ(full.image.cols, 360);
  EXPECT_EQ(full.image.rows, 180);
  EXPECT_EQ(full.image.at<cv::Vec3b>(90, 10), cv::Vec3b(0, 0, 0));
  options.num_threads = 3;
  const Panorama again = Stitch(camera, views, read, options);
  EXPECT_TRUE(std::equal(full.image.begin<cv::Vec3b>(),
                         full.image.end<cv::Vec3b>(),
                         again.image.begin<cv::Vec3b>(),
                         again.image.end<cv::Vec3b>()));
}

// A roll has no horizon of its own: the first view's is taken.
TEST(Stitch, ARollKeepsTheFirstViewUpright) {
  const Camera camera = SmallCamera();
  std::vector<Rotation> views;
  for (int k = 0; k < 12; ++k) views.push_back(Rotation::Exp({0.0, 0.0, 0.26 * k}));
  const auto read = [&](const ViewVisitor& visit) {
    for (int k = 0; k < static_cast<int>(views.size()); ++k) {
      visit(k, Paint(camera, views[k], 1.0));
    }
  };
  const Panorama panorama = Stitch(camera, views, read, {});
  EXPECT_NEAR(panorama.left_deg + 0.5 * panorama.width_deg, 0.0, 1.0);
  EXPECT_NEAR(panorama.top_deg - 0.5 * panorama.height_deg, 0.0, 1.0);
  const cv::Vec3b middle =
      panorama.image.at<cv::Vec3b>(panorama.image.rows / 2, panorama.image.cols / 2);
  EXPECT_NEAR(middle[0], GreyAt(Eigen::Vector3d::UnitZ()), 2.0);
}

TEST(Stitch, RefusesNothing) {
  const auto none = [](const ViewVisitor&) {};
  EXPECT_THROW(Stitch(SmallCamera(), {}, none, {}), std::invalid_argument);
  EXPECT_THROW(Stitch(SmallCamera(), {Rotation()}, none, {}), std::invalid_argument);
  StitchOptions options;
  options.width = 4;
  EXPECT_EQ(options.Problem(), "width is 4, must be 0 or in [16, 32768]");
}

}  // namespace
}  // namespace rotslam
