#pragma once

#include <string>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Relative rotations from somebody else's file, their views numbered anew.
struct RotationList {
  // The file's ids, numbers ascending before names; FrameId k stands for ids[k]. Numbers are
  // written without signs and zeros that say nothing.
  std::vector<std::string> ids;
  std::vector<RelativeRotation> edges;  // as in the file, in its order and directions
  RotationMap cam_from_world;           // of vertices, where the file has them
  CenterMap center_in_world;
  std::vector<FrameId> fixed;
  bool is_pose_graph = false;      // g2o rather than a plain list
  std::string form;                // the form that the file was taken for: "g2o"
  std::vector<std::string> notes;  // what was assumed or left out, one line each
};

}  // namespace rotslam
