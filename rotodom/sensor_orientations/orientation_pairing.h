#pragma once

#include <optional>
#include <vector>

#include "rotodom/sensor_orientations/orientation_series.h"
#include "rotodom/sensor_orientations/sensor_types.h"
#include "rotodom/types/rotation.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// The orientations of images and sensor at one time.
struct OrientationPair {
  int frame = 0;             // the nearest one
  double timestamp_s = 0.0;  // of the images' clock
  Rotation cam_from_world;
  Rotation sensor_from_world;  // of the sensor's world
};

/// Finds what images and sensor say of the same times, for any offset between their clocks.
class OrientationPairing {
 public:
  OrientationPairing(const ImageOrientations& images,
                     const std::vector<StampedRotation>& given,
                     double max_gap_s);

  /// In the order of time. The sensor's orientations are interpolated at the times of the frames,
  /// or averaged where there are several in the time of a frame, and those of them that lie farther
  /// apart than frames do are compared at their own times, with orientations interpolated between
  /// frames.
  std::vector<OrientationPair> At(double offset_s) const;

  /// The sensor's orientation at a time of its clock, interpolated over the largest gap allowed.
  std::optional<Rotation> SensorAt(double timestamp_s) const {
    return sparse_.AverageAt(timestamp_s, half_window_s_);
  }

  const OrientationSeries& images() const { return images_; }
  double frame_interval_s() const { return frame_interval_s_; }  // median

 private:
  int NearestFrame(double timestamp_s) const;

  double frame_interval_s_;
  double half_window_s_;
  std::vector<bool> is_alone_;  // by given orientation: farther from the others than frames are
  OrientationSeries images_;
  OrientationSeries dense_;   // interpolated over frame intervals only
  OrientationSeries sparse_;  // interpolated over the largest gap allowed
};

}  // namespace rotslam
