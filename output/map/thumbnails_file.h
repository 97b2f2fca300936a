#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace rotslam {

/// Small images of the frames of a run.
struct ThumbnailTable {
  int width = 0;
  int height = 0;
  // By frame id: grey values, row by row; empty where the image could not be read.
  std::vector<std::vector<std::uint8_t>> grey;
};

/// Writes `thumbnails.bin` in a binary form of our own. Throws std::runtime_error when the file
/// cannot be written.
void WriteThumbnails(const std::filesystem::path& path, const ThumbnailTable& thumbnails);

/// Reads what WriteThumbnails has written. Throws std::runtime_error with path and reason in one
/// line: not such a file, cut short, counts beyond its size.
ThumbnailTable ReadThumbnails(const std::filesystem::path& path);

}  // namespace rotslam
