#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/matching/patch_alignment.h"

namespace rotslam {

/// Blur is matched where frames around tell how fast the camera turns; farther apart in time they
/// do not (a hand at 10 frames a second: half of the orientations were lost).
inline constexpr double kFarthestFrameForBlur_s = 0.09;

/// A patch of an image that moved while it was exposed.
struct BlurredPatch {
  const cv::Mat& image;  // 8-bit grey
  Eigen::Vector2d center_px;
  Eigen::Matrix2d target_from_view;  // PatchTemplate::Sample's patch_from_view
  Eigen::Vector2d blur_px;           // of what it shows, from the exposure's begin to its end
};

/// Whether blur vectors differ too little to show.
/// @param target_from_view  as of BlurredPatch, like the blur vectors in pixels.
bool AreBlurredAlike(const Eigen::Matrix2d& target_from_view,
                     const Eigen::Vector2d& blur_in_view,
                     const Eigen::Vector2d& blur_in_target);

/// AlignPatch between images that moved differently while they were exposed.
///
/// Exposure blurs an image along the blur vector, evenly and to both sides of where it is halfway.
/// Each of the two is blurred once more, by the other's blur vector; then they show the same,
/// whatever the scene. Blurring only the sharper one, up to the same variance, leaves a third of
/// the error.
/// @param blur_px  of the target, around `start_px`.
/// @return  as AlignPatch; nullopt, too, where blurring leaves no structure in some direction, and
///          for blur vectors of more than four patches.
/// Error:   0.04 px in the median between a sharp image and one blurred by 10 px (blur tests),
/// where
///          AlignPatch has 0.7.
/// Cost:    2 to 4 us, by the length of the blur vectors; AlignPatch takes 0.2 to 0.5.
std::optional<PatchAlignment> AlignBlurredPatch(const BlurredPatch& patch,
                                                const cv::Mat& target,
                                                const Eigen::Vector2d& start_px,
                                                const Eigen::Vector2d& blur_px,
                                                double max_step_px);

}  // namespace rotslam
