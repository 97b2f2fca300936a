#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>

#include "apps/slam/frame_source.h"
#include "apps/slam/orientations.h"
#include "ba/resection.h"
#include "rotodom/features/features.h"
#include "rotodom/track_completion/track_completion.h"

namespace rotslam {

/// Views of `frames`, of images read anew.
/// @param tell  receives one line for each image that cannot be read again; the rest are there.
MapViews ReadMapViews(ImageProvider& images,
                      const std::set<FrameId>& frames,
                      const std::function<void(const std::string& problem)>& tell);

/// What tells how the camera moved around the views of a map.
struct MotionSources {
  const Orientations& orientations;
  const std::vector<Track>& tracks;  // of all frames
  const Camera& camera;
  const ResectionOptions& resection;
  int num_threads = 1;
};

/// Gives the views the motion that a rolling shutter sees: the turn and the velocity through the
/// frames before and behind each, which are placed by the map's points. Where they cannot be, the
/// turn is the odometry's and the velocity 0. With a global shutter there is neither. And the turn
/// that blurs the image, where that tells how long it was exposed.
void SetMotions(const MotionSources& sources, const Reconstruction& map, MapViews& views);

/// Described corners of the views, where a global shutter would see them.
std::map<FrameId, Features> DescribeViews(const MapViews& views,
                                          const Camera& camera,
                                          const FeatureOptions& options,
                                          int num_threads);

}  // namespace rotslam
