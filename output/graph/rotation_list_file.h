#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "output/graph/rotation_list.h"

namespace rotslam {

/// Reads rotations to average in any of the forms of output/rotation_graph_form.h, told apart by
/// the first line:
/// - `VERTEX_SE3:QUAT id x y z qx qy qz qw`, `EDGE_SE3:QUAT i j x y z qx qy qz qw` and the upper
///   triangle of the information, `FIX id ...`, as ReadG2o takes them;
/// - `VERTEX3 id x y z roll pitch yaw`, `EDGE3 i j x y z roll pitch yaw` and the upper triangle of
///   the information of (x, y, z, roll, pitch, yaw), R = Rz(yaw) Ry(pitch) Rx(roll), of which the
///   rotation's block is used; isotropic when it is missing;
/// - `i j qx qy qz qw`, and `i j` with the nine numbers of a rotation matrix by rows, more numbers
///   being ignored: j_from_i, x_j = R x_i, unless cycles of edges close far better in another
///   reading;
/// - 1DSfM's `i j R t`, R = R_i R_j^T, and GLOMAP's `name name qw qx qy qz tx ty tz`, likewise.
/// Ids are whole numbers from -2^63 to 2^64 - 1, or names in lists. Lines with other words in front
/// are skipped and counted in the notes; empty lines and those that start with '#' are skipped.
/// @param sigma_rad  standard deviation per axis of edges whose lines say none.
/// Throws std::runtime_error with file, line and reason.
/// Cost:    about 3 s for a million edges of a g2o file.
RotationList ReadRotationList(const std::filesystem::path& path, double sigma_rad);

/// Name of the form that a file would be read in; nullopt when it has no relative rotations.
/// Throws std::runtime_error when it cannot be read at all.
std::optional<std::string> RecogniseRotationList(const std::filesystem::path& path);

/// Writes a pose graph like WriteG2o, with the file's own ids and all of its edges, or, when the
/// name ends in anything but ".g2o", a line `id qx qy qz qw` (cam_from_world) per view. A pose
/// graph has numbers for ids: names are numbered there, and comments say which is which. Throws
/// std::runtime_error when the file cannot be written.
void WriteRotationList(const std::filesystem::path& path,
                       const RotationList& list,
                       const RotationMap& cam_from_world);

}  // namespace rotslam
