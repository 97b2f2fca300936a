#pragma once

#include <filesystem>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// The rotations of a g2o file with SE(3) vertices.
struct PoseGraph {
  ViewGraph graph;
  RotationMap cam_from_world;
  CenterMap center_in_world;  // may be empty: then vertices are written at the origin
};

/// Writes `VERTEX_SE3:QUAT` and `EDGE_SE3:QUAT` lines as g2o reads them.
///
/// - A vertex is `id x y z qx qy qz qw`: the pose world_from_cam; id is the FrameId's value.
///   Views without an orientation are left out, and so are their edges.
/// - An edge is `i j x y z qx qy qz qw` and the 21 numbers of the upper triangle of its 6x6
///   information, translation first. The measurement is X_i^-1 X_j, that is cam_i_from_cam_j: the
///   inverse of our j_from_i.
/// - g2o's edge error is Z^-1 X_i^-1 X_j, a rotation in camera j's frame equal to Exp(-delta) for
///   our delta, and the vector part of its quaternion stands for it: -delta / 2. The information of
///   its rotation is therefore 4 covariance^-1. Readers that take it for the rotation vector's see
///   every edge four times as certain, which changes no average.
/// - Relative rotations measure no translation: the edge repeats what its vertices say (zero
///   without centres) with an information of 1e-6, only so that a solver's matrix is not singular.
///
/// Throws std::invalid_argument when a covariance is not positive definite, std::runtime_error when
/// the file cannot be written.
void WriteG2o(const std::filesystem::path& path, const PoseGraph& pose_graph);

/// Reads what WriteG2o writes, and any other file of such lines; other line tags are skipped.
/// The covariance of an edge is 4 times the inverse of the rotation block of its information.
/// Throws std::runtime_error with file, line and reason.
PoseGraph ReadG2o(const std::filesystem::path& path);

}  // namespace rotslam
