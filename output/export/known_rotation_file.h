#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "output/export/colmap_model.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// The parts of a known-rotation problem.
struct KnownRotationInput {
  std::string format;  // "rotslam", "COLMAP" or "BAL", for messages
  Camera camera;
  RotationMap cam_from_world;
  std::map<FrameId, double> timestamp_s;  // where the file has them
  std::map<FrameId, double> sigma_rad;    // standard deviations of the orientations, where known
  std::vector<Track> tracks;
  // The names of views and tracks in the file, where these are not their numbers here.
  std::map<FrameId, std::string> view_name;
  std::map<TrackId, std::string> track_name;
  std::vector<std::string> notes;             // what was merged or left out, one line each
  std::shared_ptr<const ColmapModel> colmap;  // null: another kind of file
};

/// The name of a view or track in its file.
std::string NameOf(const KnownRotationInput& input, FrameId view);
std::string NameOf(const KnownRotationInput& input, TrackId track);

/// The input with views numbered from 0 on, in their order, under the names that they had; a view
/// without a time has its name's number for it, or its own.
KnownRotationInput WithViewsInOrder(const KnownRotationInput& input);

/// Reads orientations, tracks and camera; positions and points that a file brings besides are not
/// looked at. What `path` is, is told by its content:
///   a run directory   its `known_rotation.txt`
///   ours              the text that WriteKnownRotation writes
///   COLMAP            a folder with cameras, images and points3D, as .bin or .txt. Pixel centres
///                     move from one half to whole numbers; several cameras as ColmapModel says.
///   BAL               `cameras points observations`, a line `camera point x y` per observation,
///                     then nine numbers per camera (rotation vector, translation, f, k1, k2) and
///                     three per point. The cameras' own lenses are taken out: the keypoints become
///                     those of one pinhole of the median focal length, axes turned from BAL's (y
///                     up, looking along -z) to ours.
/// Every observation gets its bearing; those that the lens cannot show are left out. Two of a track
/// in one view are merged where they are within a pixel, else both are left out; notes say so. Ids
/// are whole numbers up to 2^64 - 1; beyond 2^31 - 1 they are numbered anew, and stay as names.
/// Throws std::runtime_error in one line with file, line where there is one, and reason. Counts are
/// checked against the file's size before anything is made of them.
KnownRotationInput ReadKnownRotation(const std::filesystem::path& path);

/// Writes our text form, lines of words; '#' starts a comment:
///   rotslam_known_rotation 1
///   camera MODEL WIDTH HEIGHT FX FY CX CY D0 D1 D2 D3 D4     D0 to D7 for rational
///   views N
///   ID TIMESTAMP_S QX QY QZ QW SIGMA_DEG      N times; camera->world; sigma 0: not known
///   tracks M
///   ID R G B K  VIEW X Y SIGMA_PX  ...        M times, K groups of four; pixels
/// Numbers have as many digits as it takes to read the same values back, but for keypoints, which
/// have four behind the point.
void WriteKnownRotation(const std::filesystem::path& path, const KnownRotationInput& input);

}  // namespace rotslam
