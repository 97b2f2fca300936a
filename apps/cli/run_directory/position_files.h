#pragma once

#include <filesystem>

#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "output/map/ply.h"

namespace rotslam {

/// Writes trajectory_tum.txt, trajectory_kitti.txt, keyframes_tum.txt, cloud.ply, cameras.ply,
/// segments.csv, poses.csv and, where there are covariances, pose_covariance.csv.
void WritePositions(const std::filesystem::path& directory,
                    const Orientations& orientations,
                    const MapResult& positions,
                    PlyForm form);

/// Writes known_rotation.txt: the keyframes' orientations and tracks, which `rotslam solve` reads.
void WriteKnownRotationInput(const std::filesystem::path& directory,
                             const Orientations& orientations,
                             const MapResult& positions,
                             const Camera& camera);

/// Writes focal_lengths.csv where zooms were followed: the camera of every frame.
/// @param taken_out  the camera through which zooms were taken out; bundle adjustment may have
///                   refined it since.
void WriteFocalLengths(const std::filesystem::path& directory,
                       const Orientations& orientations,
                       const MapResult& positions,
                       const Camera& taken_out);

}  // namespace rotslam
