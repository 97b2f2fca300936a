#include "apps/slam/map/stated_sigmas.h"

#include <algorithm>

namespace rotslam {
namespace {

// Times adjustment's own deviations, where priors are not weighed by the residuals. What the images
// say counts as that much less certain, and what was known before counts in adjustment as that much
// more certain than it is.
constexpr double kScale = 2.5;
// Of the focal length, as a share of it, where nobody has told it.
constexpr double kUnknownFocal = 0.5;

}  // namespace

LensSigmas StatedSigmas(const std::optional<LensSigmas>& refined,
                        const LensOptions& priors,
                        const Camera& camera) {
  LensOptions all = priors;
  all.refine_focal = all.refine_principal_point = true;
  all.refine_distortion = all.refine_higher_terms = true;
  LensParameters sigmas = all.Sigmas(camera.model);
  if (refined) {
    const LensParameters by_images = RelativeSigmas(*refined, camera);
    sigmas = (by_images.array() > 0.0).select(by_images, sigmas);
  }
  if (!priors.weighs_by_residuals) sigmas *= kScale;
  sigmas[kLensFocal] = std::min(sigmas[kLensFocal], kUnknownFocal);
  return SigmasInPixels(sigmas, camera);
}

LensCovariance StatedCovariance(const LensCovariance& refined, const LensOptions& priors) {
  return priors.weighs_by_residuals ? refined : kScale * kScale * refined;
}

void TakeStatedSigmas(const LensSigmas& stated, const Camera& camera, LensOptions& lens) {
  lens.given_sigmas = RelativeSigmas(stated, camera);
  lens.weighs_by_residuals = true;
}

}  // namespace rotslam
