#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "output/trajectory/orientation_file.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Orientations that come from elsewhere, and how they fit the images.
struct GivenRotations {
  std::string file;
  RotationMap cam_from_world;                     // of every frame
  std::map<FrameId, Eigen::Matrix3d> covariance;  // as in OdometryResult, where the file says
  double disagreement_deg = 0.0;                  // median angle between them and the edges
};

/// The file's orientations at the times of the frames, interpolated as `rotslam eval` does (over
/// gaps of at most 0.2 s).
/// @param timestamps_s  by frame id.
/// @param graph         what the images say of the turns between frames: when it fits the file far
///                      better in another convention, that is an error that names it.
/// Throws std::runtime_error in one line: the reader's reasons, frames that the file does not
/// cover, a convention that is not ours.
GivenRotations MatchGivenRotations(const std::string& file,
                                   const std::vector<StampedRotation>& given,
                                   const std::vector<double>& timestamps_s,
                                   const ViewGraph& graph);

}  // namespace rotslam
