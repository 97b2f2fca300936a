#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>

#include "apps/orientations.h"
#include "rotodom/completion/completion.h"
#include "rotodom/features/features.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The images of `frames`, read anew.
/// @param path  of the sequence; `options` as it was read the first time.
/// @param tell  receives one line for each image that cannot be read again; the rest are there.
MapViews ReadMapViews(const std::string& path,
                      const SequenceOptions& options,
                      const std::set<FrameId>& frames,
                      const std::function<void(const std::string&)>& tell);

/// Gives the views the motion that a rolling shutter sees: the rotation rate between the frames
/// before and after each, the velocity between the views of the map before and after.
void SetMotions(const Orientations& orientations, const Reconstruction& map, MapViews& views);

/// Described corners of the views, where a global shutter would see them.
std::map<FrameId, Features> DescribeViews(const MapViews& views,
                                          const Camera& camera,
                                          const FeatureOptions& options,
                                          int num_threads);

}  // namespace rotslam
