#include "apps/slam/slam.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/options.h"
#include "apps/python/problem.h"
#include "apps/python/sequence.h"
#include "apps/python/slam_result.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

const char* NameOf(SlamStage stage) {
  switch (stage) {
    case SlamStage::kOrientations:
      return "orientations";
    case SlamStage::kTracks:
      return "tracks";
    case SlamStage::kKnownRotation:
      return "known_rotation";
    case SlamStage::kBundleAdjustment:
      return "bundle_adjustment";
    case SlamStage::kPureRotation:
      return "pure_rotation";
    case SlamStage::kFrameRegistration:
      return "frame_registration";
    case SlamStage::kCloud:
      return "cloud";
  }
  return "";
}

// Reports to a Python function. Its exceptions, and Ctrl-C, end the run and reach the caller.
class PyObserver : public SlamObserver {
 public:
  explicit PyObserver(py::object progress) : progress_(std::move(progress)) {}

  void OnBegin(SlamStage stage, int num_steps) override {
    num_steps_ = num_steps;
    Tell(stage, 0);
  }
  void OnFrame(const FrameProgress& progress) override {
    Tell(SlamStage::kOrientations, progress.frame.id.value + 1);
  }
  bool ShouldStop() override {
    const py::gil_scoped_acquire locked;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return has_refused_;
  }

 private:
  void Tell(SlamStage stage, int step) {
    if (progress_.is_none()) return;
    const py::gil_scoped_acquire locked;
    has_refused_ = has_refused_ || progress_(NameOf(stage), step, num_steps_).is(py::bool_(false));
  }

  py::object progress_;
  int num_steps_ = -1;
  bool has_refused_ = false;
};

constexpr const char* kSequenceExpected =
    "sequence must be a path, a Sequence or a list of (image, timestamp)";

std::unique_ptr<ImageList> ImagesFrom(const py::object& pairs,
                                      const std::optional<Camera>& camera) {
  if (!camera || camera->width < 1 || camera->height < 1) {
    throw std::invalid_argument("a list of images needs a camera with a width and a height");
  }
  std::vector<Frame> frames;
  for (const py::handle pair : pairs) {
    if (!py::isinstance<py::sequence>(pair) || py::len(pair) != 2) {
      throw std::invalid_argument(kSequenceExpected);
    }
    const auto image_and_time = py::reinterpret_borrow<py::sequence>(pair);
    const std::string number = std::to_string(frames.size());
    Frame frame;
    frame.id = FrameId{static_cast<int>(frames.size())};
    frame.name = number;
    frame.image = ImageFrom(
        ("image of frame " + number).c_str(), image_and_time[0], {camera->width, camera->height});
    if (frame.image.empty()) frame.problem = "there is no image";
    frame.timestamp_s = py::float_(py::object(image_and_time[1]));
    if (!std::isfinite(frame.timestamp_s) ||
        (!frames.empty() && frame.timestamp_s <= frames.back().timestamp_s)) {
      throw std::invalid_argument("timestamp of frame " + number + " is " +
                                  std::to_string(frame.timestamp_s) +
                                  ", must be above the one before");
    }
    frames.push_back(std::move(frame));
  }
  return std::make_unique<ImageList>(std::move(frames));
}

// The camera given, or the one that lies with the images, or a guess whose lens is estimated.
Camera CameraFor(const Sequence& sequence, const std::optional<Camera>& given, SlamInputs& inputs) {
  const cv::Size size = sequence.image_size();
  if (given) return MatchToImages(*given, size);
  if (const auto own = CameraOf(sequence)) return *own;
  inputs.estimate_lens = true;
  return UncalibratedCamera(size, GuessFocalLength(size));
}

std::unique_ptr<SequenceSource> OpenSource(const py::object& sequence) {
  std::string path;
  SequenceOptions options;
  if (py::isinstance<PySequence>(sequence)) {
    const auto& opened = sequence.cast<const PySequence&>();
    path = opened.path();
    options = opened.options();
  } else {
    path = PathOf(sequence);
  }
  const py::gil_scoped_release unlocked;
  return std::make_unique<SequenceSource>(path, options);
}

// Eight parameters: the keyword arguments of rotslam.run.
std::unique_ptr<PyResult> Run(const py::object& sequence,
                              const std::optional<Camera>& given_camera,
                              const py::object& given_options,
                              const py::object& progress,
                              const py::object& rotations,
                              bool align,
                              std::uint64_t seed,
                              int threads) {
  auto options = OptionsFrom<SlamOptions>(given_options, threads);
  options.seed = seed;
  if (!progress.is_none() && PyCallable_Check(progress.ptr()) == 0) {
    throw std::invalid_argument("progress must be a function of (stage, step, num_steps)");
  }
  SlamInputs inputs;
  if (!rotations.is_none()) inputs.given = {"rotations", OrientationsFrom(rotations), align};
  std::unique_ptr<FrameSource> frames;
  Camera camera;
  if (py::isinstance<py::list>(sequence) || py::isinstance<py::tuple>(sequence)) {
    frames = ImagesFrom(sequence, given_camera);
    camera = *given_camera;
  } else {
    std::unique_ptr<SequenceSource> source = OpenSource(sequence);
    camera = CameraFor(source->sequence(), given_camera, inputs);
    frames = std::move(source);
  }
  PyObserver observer(progress);
  const py::gil_scoped_release unlocked;
  return std::make_unique<PyResult>(RunSlam(*frames, camera, options, observer, inputs));
}

}  // namespace

// A table: one entry for each property of Result, then rotslam.run.
void AddSlam(py::module_& module) {
  py::class_<PyResult>(module, "Result", "What rotslam.run has found.")
      .def_property_readonly(
          "trajectory",
          [](const PyResult& result) { return result.Columns(0, 8); },
          "[n, 8], a row a frame, as rotslam.evaluate takes it: timestamp, position, quaternion x "
          "y "
          "z w (camera->world).")
      .def_property_readonly(
          "timestamps",
          [](const PyResult& result) { return result.Columns(0, 1).reshape({-1}); },
          "[n], seconds.")
      .def_property_readonly(
          "positions",
          [](const PyResult& result) { return result.Columns(1, 3); },
          "[n, 3], centres in the world frame; zeros where there is no map.")
      .def_property_readonly(
          "orientations",
          [](const PyResult& result) { return result.Columns(4, 4); },
          "[n, 4], quaternions x y z w, camera->world.")
      .def_property_readonly("points", &PyResult::Points, "[p, 3], in the world frame.")
      .def_property_readonly("colours", &PyResult::Colours, "[p, 3], uint8, red green blue.")
      .def_property_readonly("keyframes", &PyResult::Keyframes, "Frame numbers, ascending.")
      .def_property_readonly("components",
                             &PyResult::Components,
                             "Keyframes of the parts of the map that no measurement ties together; "
                             "their scales are aligned by continuity.")
      .def_property_readonly("segments",
                             &PyResult::Segments,
                             "[(first, last)], frames between which the camera only rotates.")
      .def_property_readonly("camera", &PyResult::camera, "As bundle adjustment has refined it.")
      .def_property_readonly("sensor_alignment",
                             &PyResult::Alignment,
                             "How the `rotations` given lie in time and on the camera, a dict with "
                             "offset_s, cam_from_sensor [3, 3] and deviations; else None.")
      .def_property_readonly("is_pure_rotation",
                             &PyResult::is_pure_rotation,
                             "Whether the camera never changes its place: there is no map then.")
      .def_property_readonly(
          "interrupted", &PyResult::interrupted, "Whether `progress` has stopped the run.")
      .def_property_readonly(
          "failure", &PyResult::Failure, "Why there is no map, in a sentence; else None.")
      .def("write_trajectory", &PyResult::WriteTrajectory, "path"_a, "Writes a TUM trajectory.")
      .def("write_ply", &PyResult::WriteCloud, "path"_a, "Writes the points with their colours.")
      .def("__repr__", &PyResult::Describe);
  module.def("run",
             &Run,
             "sequence"_a,
             "camera"_a = py::none(),
             "options"_a = py::none(),
             "progress"_a = py::none(),
             "rotations"_a = py::none(),
             "align"_a = false,
             "seed"_a = 1,
             "threads"_a = 1,
             R"(The whole system: from images to orientations, positions and points.

sequence: a path, a Sequence (read from its first frame, whatever was taken of it), or a list of
          (image, timestamp) as Odometry.add takes them; the list needs a camera.
camera:   None: the calibration that lies with the images; where there is none, the focal length is
          found from the images.
options:  a dict whose dicts are the groups in summary.json, for example
          {"loop": {"use_loops": False}}.
progress: function of (stage, step, num_steps), called when a stage begins, with step 0, and of
          stage "orientations" after every frame; num_steps is -1 where it is not known. Once it
          has returned False the run stops after that frame, without a map.
rotations: orientations of a sensor, a file as `rotslam run --rotations` reads it or [k, 5] rows
          (timestamp qx qy qz qw, camera->world): they count as much as they agree with the images.
align:    take out their offset in time and their mounting; see Result.sensor_alignment.

Returns a Result. That there is no map is no error: see Result.failure. Other Python threads run
meanwhile. Raises ValueError for wrong arguments, RuntimeError where images cannot be read or no two
of them match, and what `progress` raises. C++: apps/slam/slam.h.)");
}

}  // namespace rotslam
