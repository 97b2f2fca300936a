#include "apps/slam/live/live_slam.h"

#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/options.h"
#include "apps/python/problem.h"
#include "apps/python/slam_result.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

// A live session.
class PyLiveSlam {
 public:
  PyLiveSlam(const Camera& camera,
             const py::object& given_options,
             bool keep_images,
             std::uint64_t seed,
             int threads)
      : camera_(camera), keep_images_(keep_images) {
    CheckThreads(threads);
    if (camera.width < 1 || camera.height < 1) {
      throw std::invalid_argument(
          "camera has no size: its file does not say; give read_camera the width and height");
    }
    SlamOptions options = OptionsFrom<SlamOptions>(given_options);
    options.seed = seed;
    options.num_threads = threads;
    slam_ = std::make_unique<LiveSlam>(camera, options);
  }

  py::object Add(const py::object& image, double timestamp_s) {
    const cv::Mat pixels = ImageFrom("image", image, {camera_.width, camera_.height});
    LiveEstimate estimate;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      if (!slam_) throw std::invalid_argument("the session is finished");
      estimate = slam_->AddFrame(timestamp_s, pixels);
      if (keep_images_) {
        Frame frame;
        frame.id = estimate.frame;
        frame.timestamp_s = timestamp_s;
        frame.image = pixels;
        if (pixels.empty()) frame.problem = "no image";
        frames_.push_back(std::move(frame));
      }
    }
    const py::object covariance =
        estimate.covariance ? py::object(ArrayOf(*estimate.covariance)) : py::none();
    const py::object position =
        estimate.center_in_world
            ? py::object(ArrayOf(*estimate.center_in_world).reshape({py::ssize_t{3}}))
            : py::none();
    return py::module_::import("rotslam").attr("LiveEstimate")(
        QuaternionOf(estimate.cam_from_world),
        covariance,
        position,
        ToString(estimate.state),
        estimate.num_points,
        estimate.map_revision);
  }

  // From any thread, while a frame is added, too.
  py::object Map() const {
    const std::shared_ptr<const LiveMap> map = slam_ ? slam_->Map() : nullptr;
    if (!map) return py::none();
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector3d> centers;
    py::list keyframes;
    points.reserve(map->points.size());
    centers.reserve(map->keyframes.size());
    for (const LivePoint& point : map->points) points.push_back(point.point_in_world);
    for (const LiveKeyframe& keyframe : map->keyframes) {
      centers.push_back(keyframe.center_in_world);
      keyframes.append(keyframe.frame.value);
    }
    return py::module_::import("rotslam").attr("LiveMap")(
        map->revision, keyframes, PointsOf(centers), PointsOf(points));
  }

  std::unique_ptr<PyResult> Finish() {
    const py::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    if (!slam_) throw std::invalid_argument("the session is finished");
    ImageList images(std::move(frames_));
    SlamObserver nobody;
    auto result =
        std::make_unique<PyResult>(slam_->Finish(keep_images_ ? &images : nullptr, nobody));
    slam_.reset();
    return result;
  }

 private:
  std::mutex mutex_;
  Camera camera_;
  bool keep_images_;
  std::vector<Frame> frames_;
  std::unique_ptr<LiveSlam> slam_;  // null: finished
};

}  // namespace

void AddLiveSlam(py::module_& module) {
  const py::object named = py::module_::import("collections").attr("namedtuple");
  module.attr("LiveEstimate") =
      named("LiveEstimate",
            "world_from_cam covariance position state num_points revision",
            "module"_a = "rotslam");
  module.attr("LiveEstimate").attr("__doc__") = R"(What one frame of a live session brought.

world_from_cam: quaternion [4], x y z w, camera->world.
covariance:     [3, 3], rad^2, about the camera's axes; None where nothing is known.
position:       [3], the centre in the map's world; None where nothing tells it.
state:          "starting", "tracking", "rotating", "still" or "extrapolated".
num_points:     of the map that agree with the pose.
revision:       of the map; 0 where there is none.)";
  module.attr("LiveMap") =
      named("LiveMap", "revision keyframes positions points", "module"_a = "rotslam");
  module.attr("LiveMap").attr("__doc__") = R"(The map of a live session as it stood once.

keyframes: frame numbers [k]; positions [k, 3]: their centres; points [p, 3]: in the world.)";
  py::class_<PyLiveSlam>(
      module, "LiveSlam", R"(A pose for every frame at once, and a map that grows.

options:     a dict whose dicts are the groups in summary.json.
keep_images: remember the images, so that finish() finds points in all of them, as rotslam.run does.
Raises ValueError for an option that does not exist or is out of range. C++:
apps/slam/live/live_slam.h.)")
      .def(py::init<const Camera&, const py::object&, bool, std::uint64_t, int>(),
           "camera"_a,
           "options"_a = py::none(),
           "keep_images"_a = false,
           "seed"_a = 1,
           "threads"_a = 2)
      .def("add",
           &PyLiveSlam::Add,
           "image"_a,
           "timestamp"_a,
           R"(Takes the next frame and gives its LiveEstimate at once.

image:     uint8 [height, width] or [height, width, 3] (BGR) of the camera's size; None for a frame
           that is lost.
timestamp: seconds, ascending.
Other Python threads run meanwhile. Raises ValueError for another dtype, shape or order in time.)")
      .def("map", &PyLiveSlam::Map, "The LiveMap of the newest pose; None where there is none.")
      .def("finish",
           &PyLiveSlam::Finish,
           "Ends the session: a Result, with keep_images that of rotslam.run for the same frames. "
           "Raises RuntimeError where there are too few frames.");
}

}  // namespace rotslam
