#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// Orientations from the images alone.
struct ImageOrientations {
  std::vector<double> timestamps_s;      // n frames, ascending
  std::vector<Rotation> cam_from_world;  // n
  // Variance about an axis of the rotation from each frame to the next, rad^2, n - 1 values;
  // infinite where the images do not connect the two.
  std::vector<double> step_variance;
  // Whether the images tell anything of a frame; empty: of all. What connects the frames before and
  // after those of which they do not is the largest variance of a step between.
  std::vector<bool> is_known = {};
};

/// How a sensor sits in time and on the camera.
struct SensorAlignment {
  // The sensor's orientation at its time t belongs to time t - offset_s of the images: positive if
  // the sensor is late.
  double offset_s = 0.0;
  double offset_sigma_s = 0.0;
  Rotation cam_from_sensor;
  // Of the error delta in Exp(delta) * cam_from_sensor, rad^2, in the camera's frame. A rotation
  // about one axis only does not tell the angle about it.
  Eigen::Matrix3d mounting_covariance = Eigen::Matrix3d::Zero();
  bool has_offset = false;    // it differs from zero by more than chance
  bool has_mounting = false;  // it differs from the identity by more than chance
};

struct SensorFusionOptions {
  // Take offset and mounting out, as far as they are more than chance. Off: they are estimated, and
  // the orientations are taken as they are.
  bool use_alignment = false;
  // Offsets up to this are looked for, s. Larger ones cost time, and need footage that is longer.
  double max_offset_s = 1.0;
  // Longest gap in the sensor's orientations over which they are interpolated, s. A sensor that
  // writes less often than there are frames is compared at its own times.
  double max_gap_s = 0.2;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("use_alignment", use_alignment);
    visit("max_offset_s", max_offset_s);
    visit("max_gap_s", max_gap_s);
  }
};

}  // namespace rotslam
