#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>

#include "apps/slam/input/frame_source.h"
#include "apps/slam/orientations.h"
#include "ba/resection.h"
#include "rotodom/features/features.h"
#include "rotodom/track_completion/track_completion.h"

namespace rotslam {

/// Reads the images of `frames` again and makes views of them, with the masks of `orientations`.
/// @param tell  receives one line for each image that cannot be read again; the result lacks these.
MapViews ReadMapViews(ImageProvider& images,
                      const std::set<FrameId>& frames,
                      const Orientations& orientations,
                      const std::function<void(const std::string& problem)>& tell);

/// Inputs from which the motion of the camera during a frame is estimated.
struct MotionSources {
  const Orientations& orientations;
  const std::vector<Track>& tracks;  // of all frames
  const Camera& camera;
  const ResectionOptions& resection;
  int num_threads = 1;
};

/// Sets the motion of the camera during each view. With a rolling shutter that is the angular and
/// linear velocity through the frames before and after the view, which are resected against the
/// points of the map; where that fails, the angular velocity is the odometry's and the linear
/// velocity is zero. With a global shutter both are zero. Where the exposure time is known, the
/// rotation during it is set as well, for motion blur.
void SetMotions(const MotionSources& sources, const Reconstruction& map, MapViews& views);

/// Detects and describes corners of the views; their positions are those in a global-shutter image.
std::map<FrameId, Features> DescribeViews(const MapViews& views,
                                          const Camera& camera,
                                          const FeatureOptions& options,
                                          int num_threads);

}  // namespace rotslam
