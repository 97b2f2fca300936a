#include "ba/problem/camera_blocks.h"

#include <algorithm>

namespace rotslam {
namespace {

// Whether some frame has a prior of its orientation.
bool HasPriors(const BundleState& state) {
  return std::any_of(state.frames.begin(), state.frames.end(), [](const FrameState& frame) {
    return frame.prior_sigma_rad > 0.0;
  });
}

// Whether some frames stand at one place.
bool SharesCenters(const BundleState& state) {
  std::vector<bool> taken(state.centers.size(), false);
  return std::any_of(state.frames.begin(), state.frames.end(), [&](const FrameState& frame) {
    const bool shared = taken[frame.center];
    taken[frame.center] = true;
    return shared;
  });
}

}  // namespace

CameraBlocks::CameraBlocks(const BundleState& state, const Camera& calibrated, bool turns)
    : layout_(!turns ? CameraLayout::kCenter
              // With priors one centre is held whose orientation is not.
              : SharesCenters(state) || HasPriors(state) ? CameraLayout::kApart
                                                         : CameraLayout::kPose),
      num_centers_(state.centers.size()),
      frame_of_center_(state.centers.size(), 0),
      numbers_(3 * state.centers.size() + (turns ? 3 * state.frames.size() : 0) + kLensSize),
      camera_(state.camera),
      calibrated_(calibrated) {
  LensParameters::Map(Lens()) = LensOf(state.camera, calibrated);
  rotations_.reserve(state.frames.size());
  for (std::size_t k = 0; k < state.frames.size(); ++k) {
    rotations_.emplace_back(state.frames[k].cam_from_world);
    frame_of_center_[state.frames[k].center] = k;
  }
  for (std::size_t c = 0; c < num_centers_; ++c) {
    std::copy_n(state.centers[c].data(), 3, Center(c));
  }
}

void CameraBlocks::Follow() {
  for (std::size_t k = 0; k < rotations_.size() && layout_ != CameraLayout::kCenter; ++k) {
    rotations_[k].Turn(TurnOf(k));
  }
  if (moves_lens_) camera_ = WithLens(calibrated_, LensParameters::Map(Lens()));
}

double* CameraBlocks::Turn(std::size_t frame) {
  switch (layout_) {
    case CameraLayout::kPose:
      return &numbers_[6 * frame];
    case CameraLayout::kApart:
      return &numbers_[3 * (num_centers_ + frame)];
    case CameraLayout::kCenter:
      break;
  }
  return nullptr;
}

std::vector<StrayPoints::Pose> CameraBlocks::Poses(const BundleState& state) {
  std::vector<StrayPoints::Pose> poses;
  poses.reserve(state.frames.size());
  for (std::size_t k = 0; k < state.frames.size(); ++k) {
    poses.push_back({rotations_[k].Matrix(), Eigen::Vector3d::Map(Center(state.frames[k].center))});
  }
  return poses;
}

}  // namespace rotslam
