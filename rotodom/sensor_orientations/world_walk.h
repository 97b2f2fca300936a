#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "rotodom/sensor_orientations/orientation_pairing.h"

namespace rotslam {

/// Frames that the images connect.
struct FrameChain {
  int first = 0;  // frames, `last` included
  int last = 0;
  std::size_t begin = 0;  // pairs on them
  std::size_t end = 0;
  Rotation reference;  // E of one of its pairs
};

/// Noise and drift of a sensor about each axis.
struct SensorNoise {
  double variance = 0.0;              // of each orientation by itself, rad^2
  double step_variance = 0.0;         // of its drift from one frame to the next, rad^2
  std::vector<bool> is_outlier = {};  // by pair
  int num_outliers = 0;
};

/// The rotations E = cam_from_world^-1 * cam_from_sensor * sensor_from_world between the worlds of
/// images and sensor, as vectors y with E = reference * Exp(y), which follow a random walk along
/// every chain of frames.
class WorldWalk {
 public:
  /// @param pairs          at most one per frame, by frame; kept by reference.
  /// @param step_variance  of the images, between frames; infinite between chains.
  WorldWalk(const std::vector<OrientationPair>& pairs,
            const Rotation& cam_from_sensor,
            const std::vector<double>& step_variance);

  const std::vector<FrameChain>& chains() const { return chains_; }  // those with pairs
  const Eigen::MatrixXd& vectors() const { return vectors_; }        // m x 3, m pairs

  /// The sensor's noise: the mean squared change of y over 1, 2, 4 ... pairs, less what the
  /// walk of the images accounts for.
  SensorNoise Noise() const;

  /// Values at the frames of a chain from values at its pairs, the walk being that of images and
  /// sensor together.
  /// @param weights  of the pairs, all m; times 1 / noise.variance.
  Eigen::MatrixXd Smooth(const FrameChain& chain,
                         const SensorNoise& noise,
                         const Eigen::VectorXd& weights,
                         const Eigen::MatrixXd& values,
                         std::vector<double>* variances = nullptr) const;

  /// Of all chains: m x c values less the smoothed ones.
  Eigen::MatrixXd Residuals(const SensorNoise& noise,
                            const Eigen::VectorXd& weights,
                            const Eigen::MatrixXd& values) const;

  /// Variance of the images' step after a frame, within the bounds that keep the equations finite.
  double ImageStep(int frame) const;

 private:
  const std::vector<OrientationPair>& pairs_;
  const std::vector<double>& step_variance_;
  std::vector<FrameChain> chains_;
  Eigen::MatrixXd vectors_;
};

}  // namespace rotslam
