#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/features/features.h"
#include "rotodom/self_calibration/lens_from_pairs.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// Pairs of frames for FitLensToPairs, from all parts of a sequence: of frames at equal distances,
/// each with the farthest later one that still sees a part of its points.
/// @param features        of the frames, with tracks.
/// @param cam_from_world  of the frames; a guess.
std::vector<LensPair> ChooseLensPairs(const std::map<FrameId, Features>& features,
                                      const RotationMap& cam_from_world);

/// A lens of which nothing is known but its model and about its focal length: undistorted, with the
/// principal point in the middle of the image.
/// @param focal_sigma  standard deviation of the focal length, as a share of it.
LensPrior UnknownLens(CameraModel model,
                      const cv::Size& image_size,
                      double focal_px,
                      double focal_sigma);

/// A lens that the images have told.
struct FoundLens {
  FittedLens fit;
  // Costs of the best lens of either projection, on points that were left out of the fits; 1: none.
  double cost_of_pinhole = 1.0;
  double cost_of_fisheye = 1.0;
};

/// Finds a lens from nothing: fits of pinhole lenses with radial distortion and of equidistant ones
/// start from focal lengths over the whole range of cameras, on a part of the pairs; the best lens
/// of either projection is fitted to half of all points; the projection that explains the other
/// half clearly better is fitted to all. In doubt that is the pinhole. Where rotations alone
/// explain the points through some such lens, that is the lens of a camera that only turns.
/// @param focal_px  about the focal length, from EXIF data; nullopt: nothing is known.
/// Error:   focal length within 10 % where the camera turns and moves, 0.5 % where it turns in
///          place (tests): where bundle adjustment starts.
/// @return  nullopt where too few pairs have a relative rotation through any lens.
/// Cost:    about a second for 40 pairs.
std::optional<FoundLens> FindLens(std::span<const LensPair> pairs,
                                  const cv::Size& image_size,
                                  std::optional<double> focal_px,
                                  const LensPairsOptions& options);

}  // namespace rotslam
