#include "rotodom/camera/lens_sigmas.h"

#include <algorithm>

namespace rotslam {

LensParameters RelativeSigmas(const LensSigmas& sigmas, const Camera& camera) {
  LensParameters relative = LensParameters::Zero();
  relative[kLensFocal] = sigmas.focal_px / camera.fx;
  relative[kLensCenter] = sigmas.cx_px / camera.fx;
  relative[kLensCenter + 1] = sigmas.cy_px / camera.fy;
  std::copy_n(
      sigmas.distortion.begin(), NumLensCoefficients(camera.model), &relative[kLensDistortion]);
  return relative;
}

LensSigmas SigmasInPixels(const LensParameters& relative, const Camera& camera) {
  LensSigmas sigmas;
  sigmas.focal_px = camera.fx * relative[kLensFocal];
  sigmas.cx_px = camera.fx * relative[kLensCenter];
  sigmas.cy_px = camera.fy * relative[kLensCenter + 1];
  std::copy_n(
      &relative[kLensDistortion], NumLensCoefficients(camera.model), sigmas.distortion.begin());
  return sigmas;
}

}  // namespace rotslam
