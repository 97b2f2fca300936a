#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "ba/cost/reprojection_cost.h"
#include "ba/problem/bundle_state.h"
#include "ba/problem/stray_points.h"
#include "rotodom/camera/lens_parameters.h"

namespace rotslam {

/// The cameras' numbers and the lens', in one piece of memory: Ceres sorts the blocks of a group by
/// address, and with it the order of elimination, which must not depend on where an allocation
/// lands. Poses are one block each, for which Ceres has its specialised elimination of points; only
/// frames that share a centre need those.
class CameraBlocks {
 public:
  /// @param turns  whether rotations move.
  CameraBlocks(const BundleState& state, const Camera& calibrated, bool turns);

  /// Computes the values that many observations share, for the present parameters.
  void Follow();

  CameraLayout layout() const { return layout_; }
  /// Of a frame; with kPose the whole pose, with kCenter null.
  double* Turn(std::size_t frame);
  double* Center(std::size_t center) {
    if (layout_ == CameraLayout::kPose) return Turn(frame_of_center_[center]) + 3;
    return &numbers_[3 * center];
  }
  /// The parameter block that has a centre in it.
  double* BlockOfCenter(std::size_t center) {
    if (layout_ == CameraLayout::kPose) return Turn(frame_of_center_[center]);
    return Center(center);
  }
  /// As of the last evaluation.
  std::vector<StrayPoints::Pose> Poses(const BundleState& state);
  /// LensParameters: two blocks of kLensBlockSize.
  double* Lens() { return &numbers_[numbers_.size() - kLensSize]; }
  void FreeLens() { moves_lens_ = true; }

  /// As of the last evaluation.
  const Camera& camera() const { return camera_; }
  const TurnedRotation& RotationOf(std::size_t frame) const { return rotations_[frame]; }
  /// A frame's orientation for the present parameters.
  Rotation Turned(std::size_t frame) { return rotations_[frame].At(TurnOf(frame)); }

 private:
  Eigen::Vector3d TurnOf(std::size_t frame) { return Eigen::Vector3d::Map(Turn(frame)); }

  CameraLayout layout_;
  std::size_t num_centers_;
  std::vector<std::size_t> frame_of_center_;
  std::vector<double> numbers_;
  std::vector<TurnedRotation> rotations_;
  Camera camera_;
  const Camera& calibrated_;
  bool moves_lens_ = false;
};

}  // namespace rotslam
