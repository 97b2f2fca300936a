#pragma once

#include <filesystem>
#include <map>

#include "output/export/stella_map.h"
#include "output/map/run_map.h"

namespace rotslam {

/// ORB directions and descriptors of all sightings, read anew from the images, each at its own
/// pyramid level. They are those of our own features (see DescribeFeatures).
/// Throws std::runtime_error when an image is missing or not of the camera's size.
std::map<FrameId, KeypointDescriptors> DescribeMap(const RunMap& map,
                                                   const std::filesystem::path& image_folder,
                                                   int num_threads);

}  // namespace rotslam
