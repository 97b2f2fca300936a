#pragma once

#include <optional>
#include <vector>

#include "rotodom/sensor_orientations/sensor_types.h"
#include "rotodom/types/rotation.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// Whose an orientation is.
enum class OrientationSource {
  kImages,   // the sensor is silent there
  kSensor,   // no match connects the frame with the one before
  kBoth,     // of the images, corrected by the sensor
  kNothing,  // neither: to be interpolated
};

/// Orientations of images and sensor together.
struct SensorFusion {
  SensorAlignment alignment;  // estimated, whether or not it was taken out
  // Median angle between the frame to frame rotations of images and sensor, rad: as written, and
  // with the alignment estimated.
  double disagreement_rad = 0.0;
  double aligned_disagreement_rad = 0.0;
  // Standard deviations of the sensor's orientations, from their agreement with the images: of each
  // about an axis, rad, and of their drift from one frame to the next.
  double sigma_rad = 0.0;
  double drift_rad = 0.0;
  bool drifts_less = false;  // than the images do, by the medians of the steps
  // Error that all orientations of the sensor have in common, by what the deviations of offset and
  // mounting leave open: about an axis, rad, where the motion is as it is on average.
  double systematic_rad = 0.0;
  int num_outliers = 0;  // orientations that stand alone against those beside them
  // One entry per frame.
  std::vector<Rotation> cam_from_world;  // in the sensor's world
  std::vector<double> variance;          // about an axis, rad^2, against that world
  std::vector<OrientationSource> source;
};

/// Finds how a sensor's orientations (a gimbal, an IMU, motion capture) lie in time and against the
/// camera, how good they are, and the orientations that both together give.
///
/// With C_k the images' cam_from_world, B(t) the sensor's sensor_from_world, X the mounting and d
/// the offset, E_k = C_k^-1 X B(t_k + d) is the rotation between the two worlds. It would be the
/// same for all frames but for the drift of the images, which is a random walk of known variance,
/// that of the sensor, another one, and the sensor's own noise.
/// - d and X: a search over d with X in closed form (Kabsch, of rotation vectors over 0.3 s, L1);
///   then both by Gauss-Newton steps that minimise the deviations of E from a random walk, wrong
///   orientations having a smaller weight. A deviation follows from the normal equations.
/// - noise and drift of the sensor: the mean squared change of E over 1, 2, 4 ... frames where the
///   images are at their best, less what their walk accounts for, bounds 2 sigma^2 + drift^2 *
///   frames. Orientations that are late, mounted wrong or drifting therefore count for little,
///   however they err.
/// - the result: E smoothed accordingly (a tridiagonal system), each step of it shared out to
///   images and sensor by their variances. Frames without the sensor follow the images; where the
///   images are not connected, the sensor alone counts.
/// @param given  timestamps ascending, two or more; camera->world of the sensor.
/// @return  nullopt where fewer than three of the orientations fall between frames.
/// Throws std::invalid_argument where sizes differ or an option is out of range.
/// Error:   simulated rigs at 100 Hz with 0.05 deg of noise, 40 ms late, mounted 1.7 deg wrong:
///          offset to 2 ms, mounting to 0.05 deg (sensor_orientations_test.cc).
/// Cost:    O(frames) per offset tried, some hundred offsets.
/// Source:  Furgale et al., Unified Temporal and Spatial Calibration for Multi-Sensor Systems, IROS
///          2013 (Kalibr), estimates both with splines; the random walk instead of them is ours.
std::optional<SensorFusion> FuseOrientations(const ImageOrientations& images,
                                             const std::vector<StampedRotation>& given,
                                             const SensorFusionOptions& options);

}  // namespace rotslam
