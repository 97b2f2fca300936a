#pragma once

#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/matching/patch_loops.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// The grey values around a keypoint, prepared for alignment.
///
/// Gradients are orthogonal to a constant and to the patch itself, so that changes of brightness
/// and contrast have no effect.
class PatchTemplate {
 public:
  /// Samples `image` around `center_px`.
  /// @param patch_from_view  2x2, maps offsets in `image` to offsets in the image in which the
  ///                         patch is searched: rotation and scale between the two views.
  /// @return  nullopt where the patch leaves the image or has no structure in some direction.
  static std::optional<PatchTemplate> Sample(const cv::Mat& image,
                                             const Eigen::Vector2d& center_px,
                                             const Eigen::Matrix2d& patch_from_view);

 private:
  friend struct PatchAligner;

  PatchPlanes planes_;
  float energy_ = 0.0F;      // sum of squared values
  float noise_left_ = 1.0F;  // variance of the sampled values by that of the image noise
  Eigen::Matrix2f inverse_hessian_;
  // The gradients' components that were removed: a constant, and this multiple of the values.
  Eigen::Vector2f mean_gradient_;
  Eigen::Vector2f gradient_share_;
};

/// The position of a patch in the other image, and how well it fits there.
struct PatchAlignment {
  Eigen::Vector2d center_px;
  double correlation = 0.0;    // zero-mean normalised, 1 is a perfect match
  Eigen::Matrix2d covariance;  // of center_px, px^2, from the patch's structure and the residual
};

/// Aligns a patch with `image`, starting at `start_px`.
/// @return  nullopt when it leaves the image, or more than `max_step_px` from the start.
/// Error:   about 0.02 px on clean images (patch alignment tests).
/// Source:  Baker & Matthews, Lucas-Kanade 20 Years On, IJCV 2004 (inverse compositional); ours
///          projects offset and gain out of the gradients.
std::optional<PatchAlignment> AlignPatch(const PatchTemplate& patch,
                                         const cv::Mat& image,
                                         const Eigen::Vector2d& start_px,
                                         double max_step_px);

/// Effect of the camera's translation on a patch.
struct PatchParallax {
  Eigen::Vector2d flow_px;  // its motion less that of the rotation
  // Prior standard deviation of its stretch and shear.
  double sigma = 0.0;
};

/// Corrects `found`, the position at which the patch fits best as a whole, to the position of its
/// centre.
///
/// Parallax stretches and bends a patch, and shears it along the flow where its depth varies. The
/// position then follows the half with more structure. On ground below the camera that is the
/// nearer half of nearly all patches, so that the error, some hundredths of a pixel, is common to
/// them and looks like a rotation. Stretch and shear are measured; the bend of a plane follows from
/// them.
/// @return  nullopt where the patch leaves the image or no longer matches.
/// Error:   on approaching ground the error common to all patches falls from 0.06 px to 0.01 px
///          (patch alignment tests).
/// Cost:    about 0.5 us.
/// Source:  flow of a plane, Longuet-Higgins & Prazdny, The Interpretation of a Moving Retinal
///          Image, Proc. R. Soc. B 1980.
std::optional<PatchAlignment> CorrectForParallax(const PatchTemplate& patch,
                                                 const cv::Mat& image,
                                                 const PatchAlignment& found,
                                                 const PatchParallax& parallax);

/// Rotation and scale of a patch around `bearing` between two views that differ by a rotation.
/// @return  2x2, maps offsets in the view to offsets in the target; the identity where the bearing
///          is outside one of the images.
Eigen::Matrix2d PatchWarp(const Camera& camera,
                          const Eigen::Vector3d& bearing,
                          const Rotation& target_from_view);

}  // namespace rotslam
