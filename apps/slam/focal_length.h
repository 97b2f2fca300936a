#pragma once

#include <optional>

#include <opencv2/core.hpp>

#include "apps/slam/frame_source.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// First guess of the focal length of an unknown camera, px: 1.2 times the longer side of the
/// image, 45 deg of view. It lies between phones (0.7 to 0.9 times) and moderate zoom lenses.
double GuessFocalLength(const cv::Size& image_size);

/// A camera of that focal length without distortion, with the principal point in the middle of the
/// image.
Camera UncalibratedCamera(const cv::Size& image_size, double focal_px);

/// Lets bundle adjustment refine the focal length without a prior.
void FreeFocalLength(LensOptions& lens);

/// The camera estimated from the beginning of a sequence.
struct FocalLengthEstimate {
  Camera camera;
  std::optional<ReadoutEstimate> readout;  // set: it was estimated from the images
  bool is_found = false;                   // false: `camera` has the focal length given
  bool interrupted = false;                // the observer asked to stop
};

/// Improves a guessed focal length. The first 600 frames of the sequence are solved for
/// orientations and positions with the focal length free, repeatedly, until it changes little.
/// Orientations alone are not enough: with a wrong focal length they are wrong, too. Positions
/// determine the focal length all the same, and so does a pure rotation.
/// @param frames  rewound to the first frame at the end.
/// @param camera  see UncalibratedCamera.
/// Throws what FindOrientations throws.
FocalLengthEstimate FindFocalLength(FrameSource& frames,
                                    const Camera& camera,
                                    const SlamOptions& options,
                                    SlamObserver& observer);

}  // namespace rotslam
