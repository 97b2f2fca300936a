#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "output/map/run_map.h"

namespace rotslam {

/// Directions and ORB descriptors of a frame's keypoints, in the order of ListKeypoints.
struct KeypointDescriptors {
  std::vector<double> angles_deg;  // 0 to 360
  std::vector<std::array<std::uint8_t, 32>> descriptors;
};

/// Writes `map.msg` of stella_vslam (MessagePack, its monocular maps since 0.3): camera "rotslam",
/// ORB parameters of the map's pyramid, the frames as keyframes 0, 1, 2 ... with undistorted
/// keypoints, descriptors and landmarks, a spanning tree in which each keyframe hangs on the
/// earlier one that it shares most landmarks with, and the points that at least two keyframes
/// explain. Keypoints that the undistorted image cannot show are left out. Descriptors are ORB's
/// 256 comparisons on an 8-bit blurred pyramid, as stella_vslam's are. Its pyramid, its corners
/// between pixels and its sine are its own, so the same corner need not get the same bits from it;
/// that difference has not been measured.
/// @param descriptors  of every frame.
/// Throws std::invalid_argument when descriptors are missing, std::runtime_error when the file
/// cannot be written, and for lenses of kRational and kFov, which stella_vslam has no model of.
void WriteStellaMap(const std::filesystem::path& path,
                    const RunMap& map,
                    const std::map<FrameId, KeypointDescriptors>& descriptors);

}  // namespace rotslam
