#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "output/graph/rotation_list.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// Reads rotations to average in any of the forms of output/graph/rotation_graph_form.h, told apart
/// by the first line:
/// - `VERTEX_SE3:QUAT id x y z qx qy qz qw`, `EDGE_SE3:QUAT i j x y z qx qy qz qw` and the upper
///   triangle of the information, `FIX id ...`, as ReadG2o takes them;
/// - `VERTEX3 id x y z roll pitch yaw`, `EDGE3 i j x y z roll pitch yaw` and the upper triangle of
///   the information of (x, y, z, roll, pitch, yaw), R = Rz(yaw) Ry(pitch) Rx(roll), of which the
///   rotation's block is used; isotropic when it is missing;
/// - `i j qx qy qz qw`, and `i j` with the nine numbers of a rotation matrix by rows, more numbers
///   being ignored: j_from_i, x_j = R x_i, unless cycles of edges close far better in another
///   reading; `i j qx qy qz qw sigma_deg` has a standard deviation per axis of its own;
/// - 1DSfM's `i j R t`, R = R_i R_j^T, and GLOMAP's `name name qw qx qy qz tx ty tz`, likewise.
/// - `VERTEX_SE3:EULER`, `EDGE_SE3:EULER`: as VERTEX3 and EDGE3.
/// Ids are whole numbers of any size, or names: words that are no numbers. Other lines are skipped
/// and told in `unread` by kind and number; empty lines and those that start with '#' are skipped.
/// @param sigma_rad  standard deviation per axis of edges whose lines say none.
/// Throws std::runtime_error with file, line and reason; a graph whose edges are 2-D is refused.
/// Cost:    about 3 s for a million edges of a g2o file.
RotationList ReadRotationList(const std::filesystem::path& path, double sigma_rad);

/// Name of the form that a file would be read in; nullopt when it has no relative rotations.
/// Throws std::runtime_error when it cannot be read at all.
std::optional<std::string> RecogniseRotationList(const std::filesystem::path& path);

/// Orientations for the views of a list, to start averaging from: of the vertices of a pose graph,
/// or of lines `id qx qy qz qw` as WriteRotationList leaves them. Ids that the list does not have
/// are not looked at.
/// Throws std::runtime_error with file, line and reason, or the view that has no orientation there.
RotationMap ReadStartOrientations(const std::filesystem::path& path, const RotationList& list);

/// A graph whose orientations have been averaged, as it is written.
struct AveragedGraph {
  RotationMap cam_from_world;  // views without one are left out, and their edges
  CenterMap center_in_world;   // of a pose graph's vertices; those without one are at the origin
  // Deviations by axis of the camera, deg; empty, or of some of the views.
  std::map<FrameId, Eigen::Vector3d> sigma_deg;
};

/// Writes a pose graph like WriteG2o, with the file's own ids and edges, or, when the name ends in
/// anything but ".g2o", a line `id qx qy qz qw` (cam_from_world) per view, followed by
/// `sigma_x_deg sigma_y_deg sigma_z_deg` where deviations are given ("nan" for a view without). A
/// pose graph has numbers for ids: names are numbered there, and comments say which is which. Its
/// edges have the translations and the information of the list; where it has none, what the
/// vertices say, with an information of 1e-6. Throws std::runtime_error when the file cannot be
/// written.
void WriteRotationList(const std::filesystem::path& path,
                       const RotationList& list,
                       const AveragedGraph& averaged);

}  // namespace rotslam
