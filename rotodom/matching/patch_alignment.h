#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Side of a patch in pixels. 11 keeps the aperture open at nearly all corners; smaller sides lose
/// accuracy faster than they gain time, larger ones straddle depth edges.
inline constexpr int kPatchSide = 11;

/// The grey values around a keypoint, prepared for alignment.
///
/// Gradients are made orthogonal to a constant and to the patch itself, so that neither a change
/// of brightness nor one of contrast moves the answer.
class PatchTemplate {
 public:
  /// Samples `image` around `center_px`.
  /// @param patch_from_view  2x2, maps offsets in `image` to offsets in the image that the patch
  /// will be sought in: the turn and segment between the two views.
  /// @return  nullopt where the patch leaves the image or has no structure in some direction.
  static std::optional<PatchTemplate> Sample(const cv::Mat& image,
                                             const Eigen::Vector2d& center_px,
                                             const Eigen::Matrix2d& patch_from_view);

 private:
  friend struct PatchAligner;

  // Rows are padded to whole vector registers; what is beyond kPatchSide is zero.
  static constexpr int kStride = 12;
  using Plane = std::array<float, static_cast<std::size_t>(kPatchSide) * kStride>;

  alignas(16) Plane values_;  // mean removed
  alignas(16) Plane gradient_x_;
  alignas(16) Plane gradient_y_;
  float energy_ = 0.0F;      // sum of squared values
  float noise_left_ = 1.0F;  // share of the image noise's variance that sampling has left
  Eigen::Matrix2f inverse_hessian_;
  // What is taken out of the gradients: a constant, and this share of the values.
  Eigen::Vector2f mean_gradient_;
  Eigen::Vector2f gradient_share_;
};

/// Where a patch was found.
struct PatchAlignment {
  Eigen::Vector2d center_px;
  double correlation = 0.0;    // zero-mean normalised, 1 is a perfect match
  Eigen::Matrix2d covariance;  // of center_px, px^2, from the patch's structure and the residual
};

/// Moves a patch from `start_px` to where `image` looks most like it.
/// @return  nullopt when it leaves the image, or more than `max_step_px` from the start.
/// Error:   about 0.02 px on clean images (patch alignment tests).
/// Source:  Baker & Matthews, Lucas-Kanade 20 Years On, IJCV 2004 (inverse compositional); ours
///          projects offset and gain out of the gradients.
std::optional<PatchAlignment> AlignPatch(const PatchTemplate& patch,
                                         const cv::Mat& image,
                                         const Eigen::Vector2d& start_px,
                                         double max_step_px);

/// What a translation of the camera does to a patch.
struct PatchParallax {
  Eigen::Vector2d flow_px;  // its motion beside that of a turn
  // Standard deviation of its segment and shear, before they are measured.
  double sigma = 0.0;
};

/// Moves `found` from where the patch as a whole fits best to where its centre is.
///
/// Parallax segments a patch, shears it along the flow where its depth varies, and bends it. The
/// half with more structure then counts for more; on ground that runs under the camera it is the
/// nearer half for nearly all patches, and the hundredths of a pixel that they have in common are
/// taken for a turn. Stretch and shear are measured; the bend of a plane follows from them.
/// @return  nullopt where the patch leaves the image or shows something else there.
/// Error:   on ground that comes nearer, 0.06 px common to all patches become 0.01 px (patch
///          alignment tests).
/// Cost:    about 0.5 us.
/// Source:  flow of a plane, Longuet-Higgins & Prazdny, The Interpretation of a Moving Retinal
///          Image, Proc. R. Soc. B 1980.
std::optional<PatchAlignment> CorrectForParallax(const PatchTemplate& patch,
                                                 const cv::Mat& image,
                                                 const PatchAlignment& found,
                                                 const PatchParallax& parallax);

/// The turn and stretch of a patch around `bearing` between two views that differ by a rotation.
/// @return  2x2, maps offsets in the view to offsets in the target; the identity where one of them
/// does not show the bearing.
Eigen::Matrix2d PatchWarp(const Camera& camera,
                          const Eigen::Vector3d& bearing,
                          const Rotation& target_from_view);

}  // namespace rotslam
