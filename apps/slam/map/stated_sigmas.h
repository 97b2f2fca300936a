#pragma once

#include <optional>

#include "ba/bundle_adjustment.h"
#include "rotodom/camera/lens_sigmas.h"

namespace rotslam {

/// How well a lens is known after adjustment, as it is stated to people and in camera files: larger
/// than adjustment's own deviations, which take the errors of neighbouring observations for
/// independent. Parameters that were held, or that no adjustment has estimated, are as certain as
/// before.
/// @param refined  adjustment's own, zero for what was held; nullopt: nothing moved.
/// @param priors   what adjustment took for known.
/// @param camera   the lens itself.
/// Error:   errors are below 2.5 of them on simulations (docs/calibration.md).
LensSigmas StatedSigmas(const std::optional<LensSigmas>& refined,
                        const LensOptions& priors,
                        const Camera& camera);

/// The same for adjustment's own covariance of the parameters.
LensCovariance StatedCovariance(const LensCovariance& refined, const LensOptions& priors);

/// Lets adjustment move the parameters of a calibration as far as the deviations let it that came
/// with it.
/// @param stated  of `camera`, as StatedSigmas gives them; zero: held.
void TakeStatedSigmas(const LensSigmas& stated, const Camera& camera, LensOptions& lens);

}  // namespace rotslam
