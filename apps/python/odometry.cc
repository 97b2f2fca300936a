#include "rotodom/odometry.h"

#include <atomic>
#include <cstdint>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>

#include <opencv2/core.hpp>
#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/options.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

class PyOdometry {
 public:
  PyOdometry(const Camera& camera, const py::object& options, std::uint64_t seed, int threads)
      : camera_(camera), odometry_(camera, OptionsFrom<OdometryOptions>(options), seed, threads) {
    CheckThreads(threads);
    if (camera.width < 1 || camera.height < 1) {
      throw std::invalid_argument(
          "camera has no size: its file does not say; give read_camera the width and height");
    }
  }

  py::object Add(const py::object& image, double timestamp_s) {
    const cv::Mat grey = ImageFrom("image", image, {camera_.width, camera_.height});
    FrameEstimate estimate;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      if (!(timestamp_s > last_timestamp_s_)) {
        throw std::invalid_argument("timestamp is " + std::to_string(timestamp_s) +
                                    ", must be above the last one, " +
                                    std::to_string(last_timestamp_s_));
      }
      estimate = odometry_.AddFrame(FrameId{num_frames_}, timestamp_s, grey);
      last_timestamp_s_ = timestamp_s;
      ++num_frames_;
    }
    return Describe(estimate);
  }

  int num_frames() const { return num_frames_; }

 private:
  static py::object Describe(const FrameEstimate& estimate) {
    py::list flags;
    if (estimate.report.predicted_only) flags.append("predicted");
    if (estimate.report.weak) flags.append("weak");
    if (estimate.report.searched_wide) flags.append("searched_wide");
    py::dict window;
    for (const auto& [frame, cam_from_world] : estimate.window) {
      window[py::int_(frame.value)] = QuaternionOf(cam_from_world);
    }
    const py::object covariance =
        estimate.covariance ? py::object(ArrayOf(*estimate.covariance)) : py::none();
    return py::module_::import("rotslam").attr("Estimate")(
        QuaternionOf(estimate.cam_from_world), covariance, py::tuple(flags), window);
  }

  std::mutex mutex_;
  Camera camera_;
  RotationalOdometry odometry_;
  double last_timestamp_s_ = -std::numeric_limits<double>::infinity();
  std::atomic<int> num_frames_ = 0;  // read while a call of another thread runs
};

}  // namespace

void AddOdometry(py::module_& module) {
  module.attr("Estimate") =
      py::module_::import("collections")
          .attr("namedtuple")(
              "Estimate", "world_from_cam covariance flags window", "module"_a = "rotslam");
  module.attr("Estimate").attr("__doc__") = R"(What one frame brought.

world_from_cam: quaternion [4], x y z w, camera->world; the first camera is the world.
covariance:     [3, 3], rad^2, about the camera's axes against the first frame: of the error delta
                in Exp(delta) cam_from_world; None where nothing is known.
flags:          names out of "predicted" (matches no other frame), "weak" (its best edge has fewer
                inliers than asked for), "searched_wide" (the prediction did not guide matching).
window:         {frame number: quaternion [4]} of all that this frame has moved, itself included;
                older ones are settled.)";
  py::class_<PyOdometry>(module, "Odometry", R"(Orientations frame by frame from 2-D matches alone.

options: a dict whose dicts are the groups of `rotodom` in summary.json, for example
{"averaging": {"mode": "global"}}. What it remembers does not grow. C++: rotodom/odometry.h.
Raises ValueError for an option that does not exist or is out of range.)")
      .def(py::init<const Camera&, const py::object&, std::uint64_t, int>(),
           "camera"_a,
           "options"_a = py::none(),
           "seed"_a = 1,
           "threads"_a = 1)
      .def("add",
           &PyOdometry::Add,
           "image"_a,
           "timestamp"_a,
           R"(Takes the next frame and gives its Estimate at once.

image:     uint8 [height, width] or [height, width, 3] (BGR) of the camera's size; None for a frame
           that is lost, whose orientation is then predicted.
timestamp: seconds, ascending.
Other Python threads run meanwhile. Raises ValueError for another dtype, shape or order in time.)")
      .def_property_readonly("num_frames", &PyOdometry::num_frames, "Frames taken so far.");
}

}  // namespace rotslam
