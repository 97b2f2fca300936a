#pragma once

#include <string>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// How well rotations agree with tracks, as given and read in another convention.
struct ConventionCheck {
  // Angle by which the rays of two views miss a common epipolar plane, the median over pairs of
  // views of their root mean square, deg.
  double given_deg = 0.0;
  double other_deg = 0.0;      // of the convention that fits best
  std::string other;           // "taken for world->camera"; empty where none fits clearly better
  RotationMap cam_from_world;  // read in that convention; empty where none does
  int num_pairs = 0;           // that were looked at
};

/// Reads the rotations inverted, with the quaternion's numbers in the other order, and as those of
/// a body whose axes are the camera's in another order or direction. The convention that fits the
/// tracks clearly better than the one given is returned.
/// @param tracks  bearings unit, in the camera frame.
/// Cost:    linear in the observations of at most 60 pairs of views, times 96 conventions.
/// Source:  Kneip & Lynen, Direct Optimization of Frame-to-Frame Rotation, ICCV 2013, for the
///          coplanarity of the epipolar planes' normals.
ConventionCheck CheckConvention(const RotationMap& cam_from_world,
                                const std::vector<Track>& tracks);

}  // namespace rotslam
