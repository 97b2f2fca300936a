#pragma once

#include <map>

#include <opencv2/core/mat.hpp>

#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// The camera without distortion that sees as much as images of the same size can show without
/// empty borders: the axis stays, the focal lengths keep their ratio.
/// Throws std::runtime_error where there is none with less than ten times the focal length.
Camera UndistortedCamera(const Camera& camera);

/// The cameras of frames (see GiveFrameCameras) without distortion: `to` with their zoom.
std::map<FrameId, Camera> UndistortedCameras(const std::map<FrameId, Camera>& cameras,
                                             const Camera& from,
                                             const Camera& to);

/// Maps images of one camera to those of another that looks the same way.
class ImageUndistorter {
 public:
  ImageUndistorter(const Camera& from, const Camera& to);
  cv::Mat operator()(const cv::Mat& image) const;

 private:
  cv::Mat columns_;
  cv::Mat rows_;
};

/// Moves the keypoints of a map to where `to` shows them, and makes it the map's camera; sightings
/// outside its image are left out. Names of images end in ".png" from then on.
void UndistortMap(const Camera& to, RunMap& map);

/// The same for the keypoints of matches, of which none is left out: those outside lie far outside.
void UndistortMatches(const Camera& from, const Camera& to, ViewGraphMatches& matches);

}  // namespace rotslam
