#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>
#include <pybind11/numpy.h>

#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"
#include "rotodom/types/trajectory.h"

// Conversions between Python and the problem types that several functions of the module take. Views
// are numbered from 0. Arrays of the wrong size throw std::invalid_argument.

namespace rotslam {

/// [n, 3, 3], world->camera.
RotationMap RotationsFrom(const char* name, const pybind11::object& matrices);

/// [n, 3, 3]; views without an orientation are NaN.
pybind11::array MatricesOf(const RotationMap& cam_from_world, int num_views);

/// Observations, m each: view and track, keypoints [m, 2], sigma_px [m] or None.
std::vector<Track> TracksFrom(const pybind11::object& view,
                              const pybind11::object& track,
                              const pybind11::object& keypoints_px,
                              const pybind11::object& sigma_px,
                              const Camera& camera);

/// [n], one per view or edge.
std::map<FrameId, double> SigmasFrom(const char* name,
                                     const pybind11::object& sigmas,
                                     int num_views);

/// A file that ReadOrientations reads, or [k, 5] rows (timestamp qx qy qz qw, camera->world),
/// timestamps ascending.
std::vector<StampedRotation> OrientationsFrom(const pybind11::object& given);

/// By view; NaN where there is none.
std::vector<Eigen::Vector3d> CentersOf(const CenterMap& center_in_world, int num_views);

}  // namespace rotslam
