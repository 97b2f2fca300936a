#pragma once

#include <optional>

#include <opencv2/core.hpp>

#include "apps/slam/frame_source.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// Focal length to begin with where nothing tells one, px: 1.2 times the longer side, 45 deg of
/// view, between a phone (0.7 to 0.9) and a moderate zoom lens.
double GuessFocalLength(const cv::Size& image_size);

/// A camera of that focal length: no distortion, principal point in the middle.
Camera UncalibratedCamera(const cv::Size& image_size, double focal_px);

/// Lets bundle adjustment move the focal length as far as the images want.
void FreeFocalLength(LensOptions& lens);

/// A camera by the beginning of a sequence.
struct FocalLengthEstimate {
  Camera camera;
  std::optional<ReadoutEstimate> readout;  // set: the images told it
  bool is_found = false;                   // else the camera's focal length is the one given
  bool interrupted = false;                // the observer asked to stop
};

/// Improves a guessed focal length: solves the beginning of the sequence, 600 frames, for
/// orientations and positions with the focal length free, until that changes it little. A wrong
/// focal length bends orientations (twice the right one loses KITTI 00 in its turn), positions tell
/// it all the same, and so does pure rotation.
/// @param frames  are at their beginning afterwards.
/// @param camera  see UncalibratedCamera.
/// Throws what FindOrientations throws.
FocalLengthEstimate FindFocalLength(FrameSource& frames,
                                    const Camera& camera,
                                    const SlamOptions& options,
                                    SlamObserver& observer);

}  // namespace rotslam
