#pragma once

#include <optional>
#include <span>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_parameters.h"
#include "rotodom/relative_rotation/relative_rotation_options.h"
#include "rotodom/types/ids.h"
#include "rotodom/types/rotation.h"
#include "rotodom/view_graph/shared_points.h"

namespace rotslam {

/// Two views of one camera and where they see the same scene points.
struct LensPair {
  FrameId i;
  FrameId j;
  Rotation j_from_i;                // predicted; may be far off
  std::vector<SharedPoint> points;  // with outliers
};

/// Prior knowledge of a lens.
struct LensPrior {
  Camera camera;          // expected
  LensParameters sigmas;  // standard deviations of its parameters; 0: held
};

/// How a lens is fitted.
struct LensPairsOptions {
  RelativeRotationOptions relative_rotation;
  bool rotates_only = false;  // all pairs are from one place
  bool is_rough = false;      // a few steps, to compare places to start from
  int num_threads = 1;
};

/// A lens that was fitted to pairs of views.
struct FittedLens {
  Camera camera;
  LensParameters sigmas;  // standard deviations of its parameters, the prior counted in
  int num_pairs = 0;      // with a relative rotation
  int num_points = 0;     // of all pairs
  int num_explained = 0;  // of them, within the relative rotation's inlier_px of the fit
  double cost = 0.0;  // mean robust squared distance of all points, in units of the loss: 0 to 1
};

/// Fits a lens and the relative pose of every pair of views to the pixels that they have in common:
/// the distances of all points from their epipolar lines, and for pairs from one place from where
/// the rotation leads them, through one lens for all. Each pair of a moving camera constrains the
/// lens by what an essential matrix has less freedom than a fundamental one; each turn in place by
/// more, but through a wrong lens turns in place look like motion: `rotates_only` says that they
/// are. Levenberg-Marquardt with Geman-McClure's loss; the poses are eliminated. Each round first
/// estimates the pairs' relative rotations anew through the lens of the round before.
/// @param start  of the prior's model; its focal length within 40 % of the true one.
/// @return  nullopt where fewer than three pairs have a relative rotation.
/// Error:   see tests/rotodom/self_calibration/lens_from_pairs_test.cc.
/// Source:  Hartley & Zisserman, Multiple View Geometry, chapter 19 (self-calibration); the Sampson
///          distance in the image as in chapter 11.4, through a general projection.
std::optional<FittedLens> FitLensToPairs(std::span<const LensPair> pairs,
                                         const LensPrior& prior,
                                         const Camera& start,
                                         const LensPairsOptions& options);

/// The mean robust squared distance of the pairs' points for a given camera, with the pairs'
/// relative rotations estimated from the points themselves, as in FittedLens::cost.
double CostOfLens(std::span<const LensPair> pairs,
                  const Camera& camera,
                  const LensPairsOptions& options);

}  // namespace rotslam
