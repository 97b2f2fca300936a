#pragma once

#include <stdexcept>
#include <string>

#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The camera of a sequence, with the size of its images.
/// @param file  calibration; empty: the one that lies with the images. Throws std::runtime_error
/// where
///              there is none.
inline Camera CameraOfSequence(const Sequence& sequence, const std::string& file) {
  if (file.empty() && !sequence.camera_reference()) {
    throw std::runtime_error("no calibration lies with the sequence, give --camera");
  }
  return MatchToImages(
      ReadCamera(file.empty() ? *sequence.camera_reference() : ParseCameraReference(file)),
      sequence.image_size());
}

}  // namespace rotslam
