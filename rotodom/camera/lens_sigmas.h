#pragma once

#include <array>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_parameters.h"

namespace rotslam {

/// Standard deviations of the parameters of a lens. In results, zero stands for what was held; in
/// camera files, for what is exact.
struct LensSigmas {
  double focal_px = 0.0;  // of fx and fy together; their ratio is taken for known
  double cx_px = 0.0;
  double cy_px = 0.0;
  std::array<double, 5> distortion = {};  // as DistortionNames(model) says

  bool operator==(const LensSigmas&) const = default;
};

/// The same in units of LensParameters relative to `camera`, whose sigmas they are.
LensParameters RelativeSigmas(const LensSigmas& sigmas, const Camera& camera);

/// The reverse of RelativeSigmas.
LensSigmas SigmasInPixels(const LensParameters& relative, const Camera& camera);

}  // namespace rotslam
