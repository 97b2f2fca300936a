#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/cli/input/run_options.h"

namespace rotslam {

/// One sequence of a batch; paths are absolute, or empty where nothing was given.
struct BatchEntry {
  std::string name;             // of its folder below --out
  std::string path;             // what `rotslam run` takes
  std::string command = "run";  // or "rotations"
  std::string camera;           // or "none": the lens is estimated
  std::string ground_truth;
  std::string times;  // timestamps of a KITTI ground truth
  std::string rotations;
  bool align = false;  // as --align of run
  std::string vocabulary;
  std::string config;  // YAML file that overrides option defaults
  // The defaults, overridden by `config` and then by the list itself.
  RunOptions options;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("name", name);
    visit("path", path);
    visit("command", command);
    visit("camera", camera);
    visit("ground_truth", ground_truth);
    visit("times", times);
    visit("rotations", rotations);
    visit("align", align);
    visit("vocabulary", vocabulary);
    visit("config", config);
    visit("options", options);
  }
};

/// Reads the sequences of a batch:
///   - path: kitti/sequences/00         # folder or video; the one key that must be there
///     name: kitti00                    # a-z, A-Z, 0-9, . _ -; left out: the last part of path
///     command: rotations               # left out: run
///     camera: calib.txt                # left out: the calibration that lies with the images;
///                                      # none: as --camera none
///     ground_truth: kitti/poses/00.txt # left out: what lies with the images
///     times: kitti/00/times.txt        # timestamps of a KITTI ground truth
///     rotations: gimbal.csv            # as --rotations; only for run
///     align: true                      # as --align; only with rotations
///     vocabulary: ORBvoc.txt           # as --vocabulary
///     config: config/kitti.yaml        # left out: `config`
///     options: {loop: {use_loops: false}, sequence: {stride: 2}}   # over those of config
/// Paths count from the list's folder.
/// @param config  options file of entries that name none; empty: none.
/// Throws std::runtime_error in one line with file, line and reason: not YAML, no sequences, a key
/// that does not exist, a name twice, options out of range.
std::vector<BatchEntry> ReadBatchList(const std::filesystem::path& path, const std::string& config);

}  // namespace rotslam
