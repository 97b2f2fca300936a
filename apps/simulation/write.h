#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "apps/simulation/simulation.h"

namespace rotslam {

enum class SequenceLayout {
  kTum,    // rgb/TIMESTAMP.png, rgb.txt, groundtruth.txt
  kEuroc,  // mav0/cam0/data/NANOSECONDS.png, data.csv, sensor.yaml;
           // mav0/state_groundtruth_estimate0
};

/// Options for writing a simulated sequence.
struct WriteOptions {
  SequenceLayout layout = SequenceLayout::kTum;
  int num_threads = 1;  // the bytes written do not depend on it
  /// Called with (frames done, frames in all), never from two threads at once; may be empty.
  std::function<void(int, int)> progress;
};

/// Renders and writes a whole sequence. Beside the files of the layout: `camera.yaml`,
/// `groundtruth_tum.txt` (camera->world, full precision) and, where the path has segments,
/// `segments_truth.csv`. Every file is written beside and then renamed.
/// @return  what was written, relative to `out`, images as one folder.
/// Throws std::runtime_error when `out` cannot be written or its image folder already holds
/// pictures that are not of this sequence.
std::vector<std::string> WriteSequence(const Simulation& simulation,
                                       const std::filesystem::path& out,
                                       const WriteOptions& options);

}  // namespace rotslam
