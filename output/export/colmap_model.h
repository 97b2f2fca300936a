#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "output/map/run_map.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// An image of a COLMAP model, as the file has it.
struct ColmapImage {
  std::int64_t camera = 0;                    // its id
  std::vector<Eigen::Vector2d> keypoints_px;  // COLMAP's pixel centres
};

/// A COLMAP model as ours: image ids are frames, point ids tracks numbered anew in their order.
struct ColmapModel {
  // The camera of all images. Where they have several, one without distortion of the median focal
  // length: a pinhole, or equidistant where one of them is a fisheye. The tracks' keypoints are
  // moved to it, through their own lenses, with what a pixel of their image is there as deviation.
  Camera camera;
  Reconstruction reconstruction;
  std::map<FrameId, std::string> image_name;
  // The data needed to write the model again.
  std::map<std::int64_t, Camera> cameras;  // by id
  std::map<FrameId, ColmapImage> images;
  std::map<TrackId, std::uint64_t> point_id;
  std::map<TrackId, std::vector<int>> keypoints;  // of each observation, its place in its image
  int num_doubled = 0;  // observations left out: the second one of a point in an image

  bool HasSeveralCameras() const;
};

/// Reads `cameras`, `images` and `points3D` of a folder, as .bin or, where there is no images.bin,
/// as .txt. Keypoints lose 0.5: COLMAP's pixel centres lie at
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
inline constexpr int kColmapCameraId = 1;  // of the first one of ListCameras
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

/// The figures that COLMAP's model_analyzer gives for a model.
struct ColmapFigures {
  int num_images = 0;
  int num_points = 0;
  int num_observations = 0;
  // Over the points, of each one's mean over the observations that their cameras can see.
  double mean_error_px = 0.0;
  int num_seen = 0;  // points with such observations
};

/// The figures for poses and points in the frames and tracks of `model`, by the images' cameras.
ColmapFigures FiguresOf(const ColmapModel& model, const Reconstruction& map);

/// Writes a model that has been solved anew: ids, names, keypoints and cameras are those of
/// `model`, poses, points and what they are seen by those of `solved`. Images without a pose are
/// left out.
/// @param model   its `cameras` are written, with refined numbers where they have been refined.
/// @param solved  with the frames and tracks of `model`.
/// Throws std::runtime_error when a file cannot be written.
void WriteColmapModel(const std::filesystem::path& folder,
                      const ColmapModel& model,
                      const Reconstruction& solved,
                      ColmapForm form);

}  // namespace rotslam
