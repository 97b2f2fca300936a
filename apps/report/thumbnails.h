#pragma once

#include <string>
#include <vector>

#include "apps/report/run_data.h"

namespace rotslam {

/// Size and number of the images in a report.
struct ThumbnailOptions {
  // At most so many frames are shown, evenly spaced; 0 leaves images out.
  int max_count = 160;
  // Longer side, pixels.
  int size_px = 240;
  int jpeg_quality = 70;
};

/// Small pictures of a run's frames.
struct Thumbnails {
  std::vector<int> frames;
  std::vector<std::string> jpegs;  // one per entry of `frames`
  std::string problem;             // why there are none; empty when there are
};

/// Reads frames from the run's sequence, or from `sequence` when that is not empty.
Thumbnails MakeThumbnails(const RunData& run,
                          const std::string& sequence,
                          const ThumbnailOptions& options);

}  // namespace rotslam
