#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"

namespace rotslam {

/// The pairs of images that a COLMAP database gets.
struct ColmapDatabaseOptions {
  // Pairs of images with fewer common tracks are left out: COLMAP does not look at them either
  // (its min_num_matches).
  int min_matches = 15;
  // A match belongs to its pair's geometry up to this distance from the epipolar line that the
  // poses draw, or, without a baseline, from where the turn puts it; pixels near the image centre.
  // The threshold of COLMAP's own verification.
  double max_error_px = 4.0;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("min_matches", min_matches);
    visit("max_error_px", max_error_px);
  }
};

/// Writes a COLMAP database (SQLite, its version 3.8; later ones take it over when they open it):
/// the cameras (one, unless the lens zooms), the frames as images with the ids of WriteColmapModel,
/// their sightings as keypoints in its order, and per pair of frames
/// - `matches`: all tracks that both show, and what the view-graph has verified between them;
/// - `two_view_geometries`: what the view-graph has verified, and the tracks that agree with the
///   poses, unless the track's point fits one of the two sightings only; E (of unit translation), F
///   where the camera has no distortion, and the pose of the second camera from the first. Pairs at
///   one place, and those that the view-graph saw no baseline in, have configuration 5 (PANORAMIC)
///   and the homography of the rotation at infinity; the others 2 (CALIBRATED).
/// @param map         keypoints of matches that none of its tracks has are left out with their
///                    matches: see AddKeypoints.
/// @param view_graph  may be empty.
/// There are no descriptors: matching is done.
/// Throws std::invalid_argument when options.Problem(), std::runtime_error when SQLite or the disk
/// refuse; never leaves half a file.
/// Cost:    quadratic in the length of tracks.
void WriteColmapDatabase(const std::filesystem::path& path,
                         const RunMap& map,
                         const ViewGraphMatches& view_graph,
                         const ColmapDatabaseOptions& options = {});

}  // namespace rotslam
