#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "apps/cli/export/frame_images.h"
#include "apps/cli/terminal/common_flags.h"
#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"

namespace rotslam {

/// The input of a format's writer.
struct ExportJob {
  RunMap map;  // of the frames to be written
  std::filesystem::path run;
  std::filesystem::path out;
  std::filesystem::path image_folder;
  const ViewGraphMatches* matches = nullptr;  // of all frames of the run
  // Takes the distortion out of a mask; empty without --undistort.
  std::function<cv::Mat(const cv::Mat& mask)> mask_change;
  int num_masks = 0;  // in the folder masks beside `out`
  bool text = false;
  bool has_places = true;  // false: orientations alone
  CommonFlags common;
  std::function<void(const std::string&)> say;
};

/// The frames that an export writes.
enum class FrameChoice {
  kAll,
  kKeyframes,
  kKeyframesAndAtRest,  // those in a pure rotation, which has keyframes at its ends alone, too
};

/// How a format treats frames without a place, and components whose scales are not tied.
enum class Places {
  kApart,  // leaves those frames out, and has an output for each component
  kOne,    // has a line for every frame, in their order, or no places at all
};

/// A form of output that `rotslam export --to` names.
struct Format {
  FrameChoice frames;  // unless told otherwise
  bool has_points;
  Places places;
  const char* meaning;
  std::function<void(const ExportJob&)> write;
  bool names_masks = false;     // beside every frame
  bool has_one_camera = false;  // for all images
};

/// The formats by their names.
const std::map<std::string, Format>& Formats();

/// Writes one file or model, with the paths of its masks where the format names them.
void WriteFormat(const Format& format, const ExportJob& job);

}  // namespace rotslam
