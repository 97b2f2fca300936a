#pragma once

#include <opencv2/core.hpp>

#include "apps/slam/input/frame_source.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "apps/slam/orientations.h"
#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_sigmas.h"

namespace rotslam {

/// First guess of the focal length of an unknown camera, px: 1.2 times the longer side of the
/// image, 45 deg of view. It lies between phones (0.7 to 0.9 times) and moderate zoom lenses.
double GuessFocalLength(const cv::Size& image_size);

/// A camera of that focal length without distortion, with the principal point in the middle of the
/// image.
Camera UncalibratedCamera(const cv::Size& image_size, double focal_px);

/// Lets bundle adjustment estimate all parameters of an uncalibrated lens. Priors are wide, except
/// those of the tangential coefficients.
/// @param expected  the principal point and the distortion that most lenses of this kind have.
void FreeLens(const Camera& expected, LensOptions& lens);

/// The expected lens for an estimate: the same model and focal length, without distortion and with
/// the principal point in the middle of the image.
Camera PlainLens(const Camera& estimate);

/// The first guess of an unknown camera, before its images are used.
struct LensGuess {
  Camera camera;             // see UncalibratedCamera
  bool knows_focal = false;  // its focal length is right within 15 %, as from EXIF data
};

/// The camera estimated from the beginning of a sequence.
struct LensEstimate {
  Camera camera;
  LensSigmas sigmas;             // of its lens, see StatedSigmas
  StaticContent static_content;  // found on the picture
  bool is_found = false;         // false: `camera` is the guess
  bool interrupted = false;      // the observer asked to stop
};

/// The purpose of an estimate.
enum class LensPurpose {
  kCameraFile,  // as accurate as 600 frames allow
  kStart,       // start values of a run, which refines them: from as few frames as suffice
};

/// Estimates an unknown lens from the first 600 frames, or less: model, focal length, principal
/// point and distortion. The frames are tracked once, through the guess. Pairs of views then tell
/// the model and about the focal length (FindLens); bundle adjustment of the keyframes, of
/// positions or of a pure rotation, tells the rest, with orientations computed again through the
/// lens of the round before until it changes little.
/// @param frames  rewound to the first frame at the end.
/// @param inputs  masks, and whether static content is looked for.
/// Throws what FindOrientations throws. Six parameters: those of FindOrientations, and the purpose.
LensEstimate EstimateLens(FrameSource& frames,
                          const LensGuess& guess,
                          const SlamOptions& options,
                          SlamObserver& observer,
                          const OrientationInputs& inputs = {},
                          LensPurpose purpose = LensPurpose::kCameraFile);

}  // namespace rotslam
