#pragma once

#include <string>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// The numbers of an edge of a pose graph beside its rotation.
struct EdgeTranslation {
  Eigen::Vector3d j_in_i = Eigen::Vector3d::Zero();  // view j's position in the frame of view i
  // As g2o has it: translation first, then the quaternion's vector part.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

/// Relative rotations from somebody else's file, their views numbered anew.
struct RotationList {
  // The file's ids, whole numbers of any size ascending before names; FrameId k stands for ids[k].
  // Numbers are written without signs and zeros that say nothing.
  std::vector<std::string> ids;
  std::vector<RelativeRotation> edges;  // as in the file, in its order and directions
  // Of the edges, where the file has them: a pose graph, and none of its translations is missing.
  std::vector<EdgeTranslation> translations;
  RotationMap cam_from_world;  // of vertices, where the file has them
  CenterMap center_in_world;
  std::vector<FrameId> fixed;
  bool is_pose_graph = false;      // g2o rather than a plain list
  std::string form;                // the form that the file was taken for: "g2o"
  std::vector<std::string> notes;  // what was assumed, one line each
  std::string unread;              // the lines that were not read, by kind; empty without any
};

}  // namespace rotslam
