#pragma once

#include <string>
#include <vector>

#include "rotodom/types/view_graph.h"

namespace rotslam {

/// One way to read the rotations of a list of edges.
struct EdgeReading {
  std::string description;       // "x_j = R x_i"
  bool is_inverse = false;       // R^T is the rotation from i to j
  bool has_other_order = false;  // the first of the quaternion's numbers is its w
  bool has_y_up = false;         // cameras have y up and z backward, as Bundler's
};

/// The reading that was chosen.
struct EdgeChoice {
  std::size_t reading = 0;
  std::string note;  // one line: what was chosen and what cycles say of it
};

/// Lets cycles decide: only in the right reading, rotations along a cycle of edges multiply to the
/// identity (replacing every R_ij by its transpose reverses their order). Where the axes of a
/// cycle's rotations are alike, it closes in any reading, and a wrong edge opens it in any: two
/// readings are compared cycle by cycle, by the mean logarithm of the ratio of what they leave.
/// Another reading than the first must win beyond doubt.
/// @param edges     read with w last, as j_from_i.
/// @param readings  at least one; the first is that of the file's documentation.
EdgeChoice ChooseEdgeReading(const std::vector<RelativeRotation>& edges,
                             const std::vector<EdgeReading>& readings);

/// An edge's rotation in a reading.
Rotation ReadEdgeAs(const Rotation& rotation, const EdgeReading& reading);

}  // namespace rotslam
