#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "output/map/run_map.h"

namespace rotslam {

/// Receives messages and progress of reading and writing images.
struct ImageObserver {
  std::function<void(const std::string& line)> say;
  std::function<void(int num_done, int total)> step;
};

/// Refuses a folder whose images are not those of the map's frames: a folder that is not there;
/// more images than a video that was read to its end has frames; images that are missing, cannot be
/// read, have another size or show something else than the run saw. Frames that the run could not
/// read have no image. Of a video the images may end in .jpg, too: the map's names follow.
/// Throws std::runtime_error in one line.
/// @param run  its folder; one of version 0.1.0 has no thumbnails, and what the images show is then
///             not checked, which is said.
void CheckImages(const std::filesystem::path& run,
                 const std::filesystem::path& folder,
                 int num_threads,
                 const ImageObserver& observer,
                 RunMap& map);

/// Changes the image of a frame before it is written; null: it is written as it is.
using ImageChange = std::function<cv::Mat(FrameId frame, const cv::Mat& image)>;

/// Writes the images of all frames that a run has read into `folder`, under the names that the map
/// has for them: frames of a video and of a recording as PNG, image files as they are. Changed ones
/// are PNG with the ending ".png".
/// Throws std::runtime_error in one line when the sequence of the run is no longer there, is
/// another one by now, or a file cannot be written.
void ExtractImages(const std::filesystem::path& run,
                   const std::filesystem::path& folder,
                   const ImageChange& change,
                   const ImageObserver& observer,
                   const RunMap& map);

/// Writes the images of the map's frames from one folder into another, changed, as PNG with the
/// ending ".png"; those that are missing or cannot be read are left out.
/// Throws std::runtime_error in one line when a file cannot be written.
void ChangeImages(const std::filesystem::path& from,
                  const std::filesystem::path& to,
                  const ImageChange& change,
                  const ImageObserver& observer,
                  const RunMap& map);

}  // namespace rotslam
