#pragma once

#include <map>
#include <vector>

#include "output/map/run_map.h"

namespace rotslam {

/// A sighting as one of its image's keypoints.
struct MapKeypoint {
  int track = 0;           // position in RunMap::tracks
  int observation = 0;     // position in that track's observations
  bool has_point = false;  // its track has a point, which explains it
};

/// The sightings in every frame of a map, by track: the list that all formats with numbered
/// keypoints share, so that their numbers agree.
std::map<FrameId, std::vector<MapKeypoint>> ListKeypoints(const RunMap& map);

/// The number of every sighting in its frame's list: one per track and observation.
std::vector<std::vector<int>> NumberKeypoints(const RunMap& map);

/// How many of a track's sightings its point explains.
int CountFits(const MapTrack& track);

/// Whether a track has a point that explains two sightings or more: others are no points for
/// anybody.
bool HasPoint(const MapTrack& track);

/// Mean distance of the fitting keypoints from where the point projects to, in pixels; 0 when it
/// projects nowhere.
double MeanErrorPx(const RunMap& map, const MapTrack& track);

}  // namespace rotslam
