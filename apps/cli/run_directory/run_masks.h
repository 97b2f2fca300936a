#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "apps/slam/masks/frame_masks.h"

namespace rotslam {

/// Reads the masks of a run: mask.png in its folder, and the masks per frame that it was given,
/// both as summary.json names them. Throws std::runtime_error where one of these is missing.
FrameMasks ReadRunMasks(const std::filesystem::path& run);

/// Writes the masks of the exported images as `folder`/NAME.png, as COLMAP's ImageReader.mask_path
/// has them: black is ignored.
/// @param images  names of the images as the export has them.
/// @param change  what was done to the images, too; null: nothing.
/// @return  number of files; 0 where the run ignored nothing.
/// Throws as ReadRunMasks and WriteMasks.
int ExportMasks(const std::filesystem::path& run,
                const std::vector<std::string>& images,
                const std::filesystem::path& folder,
                const std::function<cv::Mat(const cv::Mat&)>& change = nullptr);

/// Adds `mask_path` to every frame of a transforms.json, as nerfstudio reads it: masks/NAME.png for
/// the frame's file NAME, relative to the file's folder. Throws std::runtime_error where the file
/// cannot be read or written.
void AddMaskPaths(const std::filesystem::path& transforms);

}  // namespace rotslam
