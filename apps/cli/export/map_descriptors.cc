#include "apps/cli/export/map_descriptors.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "output/map/map_keypoints.h"
#include "rotodom/features/features.h"
#include "rotodom/sequence/image_file.h"

namespace rotslam {
namespace {

cv::Mat ReadGrey(const std::filesystem::path& file, const Camera& camera) {
  const auto [image, problem] = ReadImageFile(file);
  if (image.empty()) {
    throw std::runtime_error(file.string() + ": " + problem + "; --images names the folder");
  }
  if (image.cols != camera.width || image.rows != camera.height) {
    throw std::runtime_error(file.string() + ": is " + std::to_string(image.cols) + "x" +
                             std::to_string(image.rows) + ", the run's images were " +
                             std::to_string(camera.width) + "x" + std::to_string(camera.height));
  }
  return ToGrey(image);
}

KeypointDescriptors Describe(const RunMap& map,
                             const std::vector<MapKeypoint>& keypoints,
                             const cv::Mat& grey,
                             int num_threads) {
  FeatureOptions options;
  options.scale_factor = map.level_scale;
  options.num_levels = map.num_levels;
  const ImagePyramid pyramid = BuildPyramid(grey, options);
  Features features;
  for (const MapKeypoint& keypoint : keypoints) {
    const MapTrack& entry = map.tracks[keypoint.track];
    const Observation& seen = entry.track.observations[keypoint.observation];
    features.keypoints_px.push_back(seen.keypoint_px);
    features.bearings.push_back(seen.bearing);
    features.levels.push_back(entry.levels[keypoint.observation]);
    features.rgb.push_back(entry.track.rgb);
  }
  DescribeFeatures(pyramid, num_threads, features);
  KeypointDescriptors result;
  result.angles_deg.reserve(keypoints.size());
  result.descriptors.resize(keypoints.size());
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    const double angle_deg = features.angles_rad[k] * kDegFromRad;
    result.angles_deg.push_back(angle_deg < 0.0 ? angle_deg + 360.0 : angle_deg);
    const std::uint8_t* bytes = features.descriptors.ptr(static_cast<int>(k));
    std::copy_n(bytes, result.descriptors[k].size(), result.descriptors[k].begin());
  }
  return result;
}

}  // namespace

std::map<FrameId, KeypointDescriptors> DescribeMap(const RunMap& map,
                                                   const std::filesystem::path& image_folder,
                                                   int num_threads) {
  const auto keypoints = ListKeypoints(map);
  std::map<FrameId, KeypointDescriptors> descriptors;
  for (const MapFrame& frame : map.frames) {
    const cv::Mat grey = ReadGrey(image_folder / frame.image, map.camera);
    descriptors[frame.id] = Describe(map, keypoints.at(frame.id), grey, num_threads);
  }
  return descriptors;
}

}  // namespace rotslam
