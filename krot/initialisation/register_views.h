#pragma once

#include <vector>

#include "krot/initialisation/resection.h"
#include "krot/initialisation/robust_triangulation.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// When a view or a point can be placed from known points or views.
struct RegistrationOptions {
  CenterResectionOptions resection;
  // A view is placed when it sees this many known points and as many agree on its position.
  int min_points = 6;
  // Parallax under which a new point counts as known.
  double min_angle_rad = 0.0175;
  double threshold_rad = 0.0114;  // bearing error of a point's observations; 8 px at f = 700
};

/// Resection-intersection: registers views one by one from the points known so far, then
/// triangulates the tracks that each of them completes.
/// @param order    views to register, in order of preference. A view with too few known points is
///                 deferred, and the view with the most known points comes first instead.
/// @param centers  known centres; receives the new ones.
/// @return  views that could not be registered, in the order given.
std::vector<FrameId> RegisterViews(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const std::vector<FrameId>& order,
                                   const RegistrationOptions& options,
                                   CenterMap& centers);

/// Rays of a track by views with a centre. If `observations` is not null, it receives their
/// indices in the track.
std::vector<PosedRay> PosedRays(const RotationMap& cam_from_world,
                                const CenterMap& centers,
                                const Track& track,
                                double focal_px,
                                std::vector<int>* observations = nullptr);

}  // namespace rotslam
