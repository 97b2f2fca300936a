#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/photometric.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// One image of a data set on disk.
struct ImageEntry {
  std::filesystem::path file;
  double timestamp_s = 0.0;
  int line = 0;  // of Layout::time_list that tells the time; 0 where none does
};

/// What a form of input (SequenceForm) found at a path.
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

/// Recognises a path as described at OpenSequence and lists its images; decodes none.
/// Throws std::runtime_error, with path and reason in one line.
Layout FindLayout(const std::filesystem::path& path, const SequenceOptions& options);

/// A file or folder and, after a colon, a part of it: "walk.bag:/cam0/image_raw". A path that
/// exists as it stands has no part, nor has one none of whose beginnings exists.
struct InputReference {
  std::filesystem::path file;
  std::string part;
};
InputReference ParseInputReference(const std::filesystem::path& path);

/// Order of names in which runs of digits count as numbers: frame2 < frame10.
bool NaturalLess(const std::string& a, const std::string& b);

}  // namespace rotslam
