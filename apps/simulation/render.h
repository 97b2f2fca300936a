#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "apps/simulation/world.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// Options of the camera's sensor. Without noise, exposure changes and blur the grey value of a
/// surface point depends only on the point and the pixel's footprint.
struct RenderOptions {
  double noise_grey = 2.0;           // standard deviation of the sensor noise, in grey levels
  double exposure_variation = 0.05;  // gain wanders within 1 +- this, over a few seconds
  int blur_subframes = 1;    // pictures averaged over the time the shutter is open; 1: sharp
  double shutter_s = 0.012;  // that time; centred on the frame's timestamp
  bool color = false;        // BGR instead of grey
  int edge_samples = 3;      // per axis, in pixels that show more than one surface
  std::uint64_t seed = 1;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("noise_grey", noise_grey);
    visit("exposure_variation", exposure_variation);
    visit("blur_subframes", blur_subframes);
    visit("shutter_s", shutter_s);
    visit("color", color);
    visit("edge_samples", edge_samples);
    visit("seed", seed);
  }
};

/// Bearings of a camera's pixel centres and pixel corners, and when they are exposed, computed once
/// for all its pictures.
class PixelRays {
 public:
  /// Throws std::invalid_argument where camera.Problem() or the camera has no size.
  explicit PixelRays(const Camera& camera);

  int Width() const { return width_; }
  int Height() const { return height_; }
  /// Zero where the camera sees nothing (beyond the fold of its distortion).
  const Eigen::Vector3d& Center(int x, int y) const { return centers_[index(x, y, width_)]; }
  /// Top left corner of pixel (x, y); x up to Width(), y up to Height().
  const Eigen::Vector3d& Corner(int x, int y) const { return corners_[index(x, y, width_ + 1)]; }

  /// Seconds after the middle of the frame, in steps of half a row (or column, where the readout
  /// runs sideways): even ones are the edges between rows, odd ones their middles. One step, zero,
  /// with a global shutter.
  const std::vector<double>& ExposureTimes() const { return exposure_s_; }
  /// Index of the exposure time of a pixel centre or corner.
  int ExposureOfCenter(int x, int y) const { return ExposureStep(2 * x + 1, 2 * y + 1); }
  int ExposureOfCorner(int x, int y) const { return ExposureStep(2 * x, 2 * y); }

 private:
  static std::size_t index(int x, int y, int width) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }

  int ExposureStep(int half_columns, int half_rows) const {
    if (exposure_s_.size() == 1) return 0;
    return is_sideways_ ? half_columns : half_rows;
  }

  int width_ = 0;
  int height_ = 0;
  bool is_sideways_ = false;
  std::vector<double> exposure_s_ = {0.0};
  std::vector<Eigen::Vector3d> centers_;
  std::vector<Eigen::Vector3d> corners_;
};

struct Scenery {
  const World& world;
  const std::vector<MovingBox>& moving;
};

struct FrameInstant {
  double time_s = 0.0;  // mid-frame with a rolling shutter
  int frame = 0;        // number of the picture; determines its noise together with the seed
};

/// Renders the image of the camera at an instant; moving boxes stand still during the readout.
/// @param pose_at  pose as a function of time; evaluated at the instant and, with blur or a rolling
///                 shutter, around it.
/// @return  CV_8UC1, or CV_8UC3 with options.color. A pure function of its arguments.
/// Cost:    two to three tenths of a microsecond a pixel and sub-frame, one ray and about one
///          texture sample; more where surfaces meet.
cv::Mat RenderFrame(const Scenery& scenery,
                    const PixelRays& rays,
                    const std::function<StampedPose(double)>& pose_at,
                    const FrameInstant& instant,
                    const RenderOptions& options);

}  // namespace rotslam
