#pragma once

#include <string>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// A lens of another model that shows the same rays at nearly the same pixels.
struct LensFit {
  Camera camera;
  // Distances between the pixels of a ray in the two, over the image: root of the mean square, and
  // the largest one. Infinite where the model cannot show a part of the image.
  double rms_px = 0.0;
  double largest_px = 0.0;
};

/// Fits focal lengths, principal point and the first `num_coefficients` of the distortion of
/// `model` to `camera`, by least squares over a grid of pixels; the other coefficients are zero.
/// Error:   exact where the model contains the camera's own, to 1e-6 px.
/// Source:  Levenberg-Marquardt with central differences; 4 + num_coefficients unknowns.
LensFit FitLens(const Camera& camera, CameraModel model, int num_coefficients);

/// "0.012 px root mean square, 0.08 px at most".
std::string DescribeResidual(const LensFit& fit);

}  // namespace rotslam
