#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/photometric.h"

namespace rotslam {

/// One image of a data set on disk.
struct ImageEntry {
  std::filesystem::path file;
  double timestamp_s = 0.0;
  int line = 0;  // of Layout::time_list that tells the time; 0 where none does
};

/// The frames that a form of input (SequenceForm) found at a path.
struct Layout {
  std::string form;                 // name of the form
  bool is_video = false;            // a file whose frames are numbered, without names of their own
  std::filesystem::path folder;     // where the images are; the file itself for a video
  std::vector<ImageEntry> entries;  // in order; empty where the form opens the frames itself
  std::filesystem::path time_list;  // file that ImageEntry::line is of; may be empty
  std::string times_source;         // a short phrase: "times.txt", "file names (ns since 1970)"
  bool times_are_made_up = false;   // the frames are numbered and SequenceOptions::fps is believed
  std::optional<CameraReference> camera;                   // calibration that lies with the images
  std::optional<Camera> own_camera;                        // calibration that the form itself says
  std::optional<std::filesystem::path> ground_truth_file;  // a file, or a folder of pose files
  std::optional<PhotometricFiles> photometric;             // takes the vignetting out of the images
  std::vector<std::string> notes;  // assumed, left out or ignored; one line each
};

}  // namespace rotslam
