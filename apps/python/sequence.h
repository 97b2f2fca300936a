#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include <pybind11/pybind11.h>

#include "rotodom/camera/camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// Python's `Sequence`: the frames of a sequence on disk, each once.
class PySequence {
 public:
  PySequence(const pybind11::object& path, int first, int last, int stride, double fps);

  pybind11::tuple Next();
  int NumFrames() const { return sequence_->NumFrames(); }
  std::optional<Camera> OwnCamera() const;
  std::optional<std::string> GroundTruth() const;

  // The arguments that it was opened with.
  const std::string& path() const { return path_; }
  const SequenceOptions& options() const { return options_; }

 private:
  std::string path_;
  SequenceOptions options_;
  std::mutex mutex_;
  std::unique_ptr<Sequence> sequence_;
};

/// The calibration that lies with the images, with their size.
std::optional<Camera> CameraOf(const Sequence& sequence);

}  // namespace rotslam
