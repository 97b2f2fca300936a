#pragma once

#include <array>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/features/view.h"

namespace rotslam {

/// A view and its angular velocity.
struct RotatingView {
  OrientedView oriented;
  Eigen::Vector3d rate;  // rad/s, in camera axes
};

/// Estimates the exposure time from the motion blur of a rotating camera.
///
/// Of two views at different rotation rates one is blurred more. With the right exposure time
/// AlignBlurredPatch makes their patches alike. The remaining dissimilarity, the logarithm of the
/// share of the variance that is not explained, is computed for several exposure times and many
/// patches. Blurring also reduces noise, which makes any two patches more alike; the result must
/// therefore be better than that of blurring each image by its own blur vector, which reduces noise
/// as much. For sharp images it is not. Older pairs are weighted down, since cameras adapt to the
/// light.
class ExposureMeter {
 public:
  /// Whether a pair of rates is informative: one is at least twice the other, and the difference is
  /// at least 100 px/s.
  static bool IsInformative(const Eigen::Vector3d& rate_i,
                            const Eigen::Vector3d& rate_j,
                            double focal_px);

  /// Adds a pair of views; both need their images.
  /// @param num_threads  does not change the result.
  /// Cost:  5 ms, one thread.
  void Add(const Camera& camera, const RotatingView& i, const RotatingView& j, int num_threads);

  /// Estimated exposure time, s; 0 where the images are sharp, and before there is an estimate.
  /// Error:   up to 5 % on rendered rotations with exposures of 8 to 30 ms, up to 12 % on rendered
  ///          walks (exposure tests).
  double Seconds() const;

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(dissimilarity_, dissimilarity_reversed_, weight_);
  }

 private:
  static constexpr int kNumCandidates = 17;
  using Dissimilarity = std::array<double, kNumCandidates>;

  // Weighted sums over all pairs, with the right blur vectors and with exchanged ones.
  Dissimilarity dissimilarity_ = {};
  Dissimilarity dissimilarity_reversed_ = {};
  double weight_ = 0.0;
};

}  // namespace rotslam
