#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// One image of a data set on disk.
struct ImageEntry {
  std::filesystem::path file;
  double timestamp_s = 0.0;
};

/// What FindLayout understood of a path.
struct Layout {
  SequenceKind kind = SequenceKind::kImageFolder;
  std::filesystem::path folder;     // where the images are; the file itself for a video
  std::vector<ImageEntry> entries;  // in order; empty for a video
  std::optional<std::filesystem::path> camera_file;
  std::optional<std::filesystem::path> ground_truth_file;
};

/// Recognises a path as described at OpenSequence and lists its images; decodes none.
/// @param fps  times of an image folder whose names tell none.
/// Throws std::runtime_error, with path and reason in one line.
Layout FindLayout(const std::filesystem::path& path, double fps);

/// Order of names in which runs of digits count as numbers: frame2 < frame10.
bool NaturalLess(const std::string& a, const std::string& b);

/// Seconds that file names (without extension) tell, if all of them tell one in the same way: a
/// number with a decimal point, or ms, us or ns since 1970 of a date from 2000 to 2099.
std::optional<std::vector<double>> TimestampsFromNames(const std::vector<std::string>& stems);

}  // namespace rotslam
