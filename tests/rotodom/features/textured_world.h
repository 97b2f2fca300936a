#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

constexpr double kWorldFocalPx = 250.0;  // of SmallCamera, 65 deg wide

inline Camera SmallCamera() {
  Camera camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = camera.fy = kWorldFocalPx;
  camera.cx = 159.5;
  camera.cy = 119.5;
  return camera;
}

/// A wall of random grey rectangles, infinitely far away: views differ by rotation alone.
class TexturedWorld {
 public:
  explicit TexturedWorld(std::uint64_t seed = 1) : wall_(kHeight, kWidth, CV_8U, cv::Scalar(128)) {
    std::mt19937_64 random(seed);
    const auto draw = [&](int low, int high) {
      return low + static_cast<int>(random() % static_cast<std::uint64_t>(high - low));
    };
    for (int k = 0; k < 6000; ++k) {
      const cv::Rect box(draw(-20, kWidth), draw(-20, kHeight), draw(10, 60), draw(10, 60));
      cv::rectangle(wall_, box, cv::Scalar(draw(0, 256)), cv::FILLED);
    }
    cv::GaussianBlur(wall_, wall_, cv::Size(), 1.5);
  }

  /// What the camera sees when turned by `cam_from_world`; exact to a fiftieth of a pixel.
  cv::Mat View(const Camera& camera, const Rotation& cam_from_world) const {
    return ViewByRow(camera, [&](int) { return cam_from_world; });
  }

  /// What it sees on average while it is exposed, halfway at time_s.
  /// @param cam_from_world  of the time.
  template <class Motion>
  cv::Mat ExposedView(const Camera& camera,
                      const Motion& cam_from_world,
                      double time_s,
                      double exposure_s) const {
    constexpr int kSamples = 24;
    cv::Mat sum(camera.height, camera.width, CV_32F, cv::Scalar(0.0));
    for (int k = 0; k < kSamples; ++k) {
      const double late = (k + 0.5) / kSamples - 0.5;
      cv::accumulate(View(camera, cam_from_world(time_s + late * exposure_s)), sum);
    }
    cv::Mat view;
    sum.convertTo(view, CV_8U, 1.0 / kSamples);
    return view;
  }

  /// The same as View where each row has an orientation of its own: cam_from_world(row).
  template <class OrientationOfRow>
  cv::Mat ViewByRow(const Camera& camera, const OrientationOfRow& cam_from_world) const {
    cv::Mat x(camera.height, camera.width, CV_32F);
    cv::Mat y(camera.height, camera.width, CV_32F);
    for (int row = 0; row < camera.height; ++row) {
      const Rotation world_from_cam = cam_from_world(row).Inverse();
      for (int column = 0; column < camera.width; ++column) {
        const Eigen::Vector3d ray =
            world_from_cam * *camera.Unproject(Eigen::Vector2d(column, row));
        x.at<float>(row, column) = static_cast<float>(kFocal * ray.x() / ray.z() + kWidth / 2);
        y.at<float>(row, column) = static_cast<float>(kFocal * ray.y() / ray.z() + kHeight / 2);
      }
    }
    cv::Mat view;
    cv::remap(wall_, view, x, y, cv::INTER_LINEAR, cv::BORDER_REFLECT);
    return view;
  }

 private:
  // Twice as fine as SmallCamera, and wide enough for it to turn by 25 deg.
  static constexpr double kFocal = 2.0 * kWorldFocalPx;
  static constexpr int kWidth = 1600;
  static constexpr int kHeight = 1200;
  cv::Mat wall_;
};

}  // namespace rotslam
