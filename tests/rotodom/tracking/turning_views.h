#pragma once

#include <algorithm>
#include <vector>

#include "tests/rotodom/tracking/world_views.h"

namespace rotslam {

/// A camera that starts to turn at time 0, faster and faster.
class Start {
 public:
  /// @param acceleration  rad/s^2, in camera axes.
  explicit Start(const Eigen::Vector3d& acceleration) : acceleration_(acceleration) {}

  Rotation operator()(double time_s) const {
    const double since_s = std::max(0.0, time_s);
    return Rotation::Exp(0.5 * since_s * since_s * acceleration_);
  }

 private:
  Eigen::Vector3d acceleration_;
};

/// Views of it, and where it looked.
struct FilmedStart {
  std::vector<View> views;
  std::vector<Rotation> cam_from_world;
};

/// Frames 0, 1, ... at 30 a second, the first one with corners of its own, the others with the same
/// points where the truth puts them.
inline FilmedStart FilmStart(const Start& motion, int num_frames, double exposure_s) {
  static const TexturedWorld world;
  FilmedStart film;
  for (int k = 0; k < num_frames; ++k) {
    const double time_s = k / 30.0;
    const cv::Mat image = world.ExposedView(SmallCamera(), motion, time_s, exposure_s);
    film.cam_from_world.push_back(motion(time_s));
    film.views.push_back(
        k == 0
            ? MakeView(image, FrameId{0}, time_s, 0)
            : CarryOver(film.views.front(), film.cam_from_world.back(), image, FrameId{k}, time_s));
  }
  return film;
}

}  // namespace rotslam
