#pragma once

#include <array>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/features/view.h"

namespace rotslam {

/// A view and how fast it turned.
struct RotatingView {
  OrientedView oriented;
  Eigen::Vector3d rate;  // rad/s, in camera axes
};

/// Estimates the exposure time of images by the motion blur of a rotating camera.
///
/// Of two views that turn at different rates one is blurred farther. With the right time of
/// exposure AlignBlurredPatch makes their patches alike; how unlike they stay is found for a few
/// times and many patches, by the logarithm of the part of the variance that is left. Blurring
/// takes noise out, too, and makes anything more alike. So there must be a gain over blurring each
/// image by its own blur vector, which takes out as much noise: sharp images, noisy or not, have
/// none. Older views count less and less: cameras adapt to the light.
class ExposureMeter {
 public:
  /// Whether a pair of rates tells: one turns at least twice as fast, by 100 px/s and more.
  static bool Tells(const Eigen::Vector3d& rate_i, const Eigen::Vector3d& rate_j, double focal_px);

  /// Adds what a pair of views shows; both need their images.
  /// @param num_threads  does not change the result.
  /// Cost:  5 ms, one thread.
  void Add(const Camera& camera, const RotatingView& i, const RotatingView& j, int num_threads);

  /// 0 where the images are sharp, and while nothing is known.
  /// Error:  5 % and less on rendered turns exposed for 8 to 30 ms (exposure tests), up to 12 % on
  ///         rendered walks.
  double Seconds() const;

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(unlikeness_, unlikeness_reversed_, weight_);
  }

 private:
  static constexpr int kNumCandidates = 17;
  using Unlikeness = std::array<double, kNumCandidates>;

  // Of all pairs, weighted: with the blur vectors as they should be, and exchanged.
  Unlikeness unlikeness_ = {};
  Unlikeness unlikeness_reversed_ = {};
  double weight_ = 0.0;
};

}  // namespace rotslam
