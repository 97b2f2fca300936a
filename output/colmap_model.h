#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// A COLMAP model as ours: image ids are frames, point ids tracks numbered anew in their order.
struct ColmapModel {
  Camera camera;
  Reconstruction reconstruction;
  std::map<FrameId, std::string> image_name;
};

/// Reads `cameras`, `images` and `points3D` of a folder, as .bin or, where there is no images.bin,
/// as .txt. Cameras of several ids must be equal. Keypoints lose 0.5: COLMAP's pixel centres lie at
/// one half. A second observation of one point in one image is left out, and so are those whose
/// bearing the lens does not have. World and camera axes are COLMAP's own, which are ours.
/// Throws std::runtime_error in one line with file and reason: missing, cut short, counts beyond
/// the file's size, ids that do not exist or are there twice, numbers that are not finite, a camera
/// model not known.
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

}  // namespace rotslam
