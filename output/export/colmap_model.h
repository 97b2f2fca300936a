#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "output/map/run_map.h"
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

/// A camera as COLMAP has it: kPinhole is PINHOLE, kRadtan OPENCV, or FULL_OPENCV where k3 is not
/// zero, kEquidistant OPENCV_FISHEYE, kRational FULL_OPENCV, kFov FOV; the principal point gains
/// 0.5. A FULL_OPENCV whose k4, k5 and k6 are zero reads back as kRadtan.
struct ColmapCamera {
  int model_id = 0;
  std::string model;
  std::vector<double> parameters;
};
ColmapCamera ToColmap(const Camera& camera);

/// Ids in COLMAP's files and database: they start from 1.
inline constexpr int kColmapCameraId = 1;
inline int ColmapImageId(FrameId frame) { return frame.value + 1; }
inline int ColmapPointId(TrackId track) { return track.value + 1; }

enum class ColmapForm { kBinary, kText };

/// Writes `cameras`, `images` and `points3D`, as .bin or .txt, into a folder, made where missing;
/// files of the other form are taken away, since readers would prefer one of them. Poses are
/// world->camera, quaternions w first. The keypoints of an image are all its sightings in the
/// order of ListKeypoints; those without a point are there, too, so that a database can have the
/// same. Text has 17 digits, so both read back the same.
/// Throws std::runtime_error when a file cannot be written.
void WriteColmapModel(const std::filesystem::path& folder, const RunMap& map, ColmapForm form);

}  // namespace rotslam
