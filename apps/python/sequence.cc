#include "apps/python/sequence.h"

#include <cstdint>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "rotodom/camera/read_camera.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

py::object ArrayOfImage(const cv::Mat& image) {
  if (image.empty()) return py::none();
  std::vector<py::ssize_t> shape = {image.rows, image.cols};
  if (image.channels() > 1) shape.push_back(image.channels());
  py::array_t<std::uint8_t> array(shape);
  const cv::Mat target(image.rows, image.cols, image.type(), array.mutable_data());
  image.copyTo(target);
  return array;
}

}  // namespace

std::optional<Camera> CameraOf(const Sequence& sequence) {
  const auto& reference = sequence.camera_reference();
  const cv::Size size = sequence.image_size();
  if (reference) {
    return MatchToImages(ReadCamera(*reference, sequence.image_folder(), {size.width, size.height}),
                         size);
  }
  const auto& camera = sequence.own_camera();
  return camera ? std::optional(MatchToImages(*camera, size)) : std::nullopt;
}

PySequence::PySequence(const py::object& path, int first, int last, int stride, double fps)
    : path_(PathOf(path)) {
  options_.first = first;
  options_.last = last;
  options_.stride = stride;
  options_.fps = fps;
  if (const auto problem = options_.Problem()) throw std::invalid_argument(*problem);
  sequence_ = OpenSequence(path_, options_);
}

py::tuple PySequence::Next() {
  std::optional<Frame> frame;
  {
    const py::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    frame = sequence_->Next();
  }
  if (!frame) throw py::stop_iteration();
  return py::make_tuple(ArrayOfImage(frame->image), frame->timestamp_s);
}

std::optional<Camera> PySequence::OwnCamera() const { return CameraOf(*sequence_); }

std::optional<std::string> PySequence::GroundTruth() const {
  const auto& file = sequence_->GroundTruthFile();
  if (!file) return std::nullopt;
  return file->string();
}

void AddSequence(py::module_& module) {
  py::class_<PySequence>(module, "Sequence", R"(The frames of a sequence, each once.

path is an image folder, a KITTI odometry, TUM RGB-D or EuRoC sequence, or a video. Iterating
gives (image, timestamp): uint8 [height, width] or [height, width, 3] (BGR), None where it cannot
be read; seconds. fps is for input without timestamps. Raises RuntimeError where there is no such
sequence, ValueError for options out of range.)")
      .def(py::init<const py::object&, int, int, int, double>(),
           "path"_a,
           "first"_a = SequenceOptions{}.first,
           "last"_a = SequenceOptions{}.last,
           "stride"_a = SequenceOptions{}.stride,
           "fps"_a = SequenceOptions{}.fps)
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__", &PySequence::Next)
      .def_property_readonly(
          "num_frames", &PySequence::NumFrames, "Frames in all; -1 where a video does not say.")
      .def_property_readonly(
          "camera", &PySequence::OwnCamera, "The calibration that lies with the images, or None.")
      .def_property_readonly("ground_truth",
                             &PySequence::GroundTruth,
                             "File of the trajectory that lies with the images, or None.");
}

}  // namespace rotslam
