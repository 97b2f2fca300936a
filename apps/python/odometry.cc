#include "rotodom/odometry.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/options.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/loop/vocabulary_file.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

void RequireSize(const Camera& camera) {
  if (camera.width < 1 || camera.height < 1) {
    throw std::invalid_argument(
        "camera has no size: its file does not say; give read_camera the width and height");
  }
}

void RequireLater(double timestamp_s, double last_timestamp_s) {
  if (!(timestamp_s > last_timestamp_s)) {
    throw std::invalid_argument("timestamp is " + std::to_string(timestamp_s) +
                                ", must be above the last one, " +
                                std::to_string(last_timestamp_s));
  }
}

py::tuple FlagsOf(const FrameReport& report) {
  py::list flags;
  if (report.predicted_only) flags.append("predicted");
  if (report.weak) flags.append("weak");
  if (report.searched_wide) flags.append("searched_wide");
  return flags;
}

py::object CovarianceOrNone(const std::optional<Eigen::Matrix3d>& covariance) {
  return covariance ? py::object(ArrayOf(*covariance)) : py::none();
}

class PyOdometry {
 public:
  PyOdometry(const Camera& camera, const py::object& options, std::uint64_t seed, int threads)
      : camera_(camera), odometry_(camera, OptionsFrom<OdometryOptions>(options), seed, threads) {
    CheckThreads(threads);
    RequireSize(camera);
  }

  py::object Add(const py::object& image, double timestamp_s) {
    const cv::Mat grey = ImageFrom("image", image, {camera_.width, camera_.height});
    FrameEstimate estimate;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      RequireLater(timestamp_s, last_timestamp_s_);
      estimate = odometry_.AddFrame(FrameId{num_frames_}, timestamp_s, grey);
      last_timestamp_s_ = timestamp_s;
      ++num_frames_;
    }
    return Describe(estimate);
  }

  int num_frames() const { return num_frames_; }

 private:
  static py::object Describe(const FrameEstimate& estimate) {
    py::dict window;
    for (const auto& [frame, cam_from_world] : estimate.window) {
      window[py::int_(frame.value)] = QuaternionOf(cam_from_world);
    }
    return py::module_::import("rotslam").attr("Estimate")(QuaternionOf(estimate.cam_from_world),
                                                           CovarianceOrNone(estimate.covariance),
                                                           FlagsOf(estimate.report),
                                                           window);
  }

  std::mutex mutex_;
  Camera camera_;
  RotationalOdometry odometry_;
  double last_timestamp_s_ = -std::numeric_limits<double>::infinity();
  std::atomic<int> num_frames_ = 0;  // read while a call of another thread runs
};

// The groups of the options that orientations with loops have, as in SlamOptions.
struct LoopedGroups {
  OdometryOptions rotodom;
  LoopOptions loop;

  std::optional<std::string> Problem() const {
    const auto problem = rotodom.Problem();
    return problem ? problem : loop.Problem();
  }
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("rotodom", rotodom);
    visit("loop", loop);
  }
};

LoopedOdometryOptions LoopedOptionsFrom(const py::object& given,
                                        const py::object& vocabulary,
                                        std::uint64_t seed,
                                        int threads) {
  const auto groups = OptionsFrom<LoopedGroups>(given);
  CheckThreads(threads);
  LoopedOdometryOptions options{groups.rotodom, groups.loop};
  if (!vocabulary.is_none()) {
    options.vocabulary = std::make_shared<const Vocabulary>(ReadVocabulary(PathOf(vocabulary)));
  }
  options.keep_features = false;
  options.seed = seed;
  options.num_threads = threads;
  return options;
}

class PyLoopedOdometry {
 public:
  PyLoopedOdometry(const Camera& camera,
                   const py::object& options,
                   const py::object& vocabulary,
                   std::uint64_t seed,
                   int threads)
      : camera_(camera), odometry_(camera, LoopedOptionsFrom(options, vocabulary, seed, threads)) {
    RequireSize(camera);
  }

  py::object Add(const py::object& image, double timestamp_s) {
    const cv::Mat grey = ImageFrom("image", image, {camera_.width, camera_.height});
    LoopedEstimate estimate;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      if (is_finished_) throw std::invalid_argument("finish() was called, no frame can follow");
      RequireLater(timestamp_s, last_timestamp_s_);
      estimate = odometry_.AddFrame(FrameId{num_frames_}, timestamp_s, {grey, {}});
      last_timestamp_s_ = timestamp_s;
      ++num_frames_;
    }
    return py::module_::import("rotslam").attr("LoopedEstimate")(
        QuaternionOf(estimate.cam_from_world),
        CovarianceOrNone(estimate.covariance),
        FlagsOf(estimate.report),
        Describe(estimate.loops),
        estimate.has_averaged);
  }

  py::list Finish() {
    std::vector<LoopCheck> loops;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      if (!is_finished_) loops = odometry_.Finish();
      is_finished_ = true;
    }
    return Describe(loops);
  }

  py::array Orientations() {
    const RotationMap cam_from_world = Copy(&OdometryResult::cam_from_world);
    py::array_t<double> rows({static_cast<py::ssize_t>(cam_from_world.size()), py::ssize_t{4}});
    auto at = rows.mutable_unchecked<2>();
    py::ssize_t k = 0;
    for (const auto& [frame, rotation] : cam_from_world) {
      const Eigen::Vector4d q = rotation.Inverse().Quaternion().coeffs();
      for (int c = 0; c < 4; ++c) at(k, c) = q[c];
      ++k;
    }
    return rows;
  }

  py::array Covariances() {
    const std::map<FrameId, Eigen::Matrix3d> known = Copy(&OdometryResult::covariance);
    py::array_t<double> covariances({py::ssize_t{num_frames_}, py::ssize_t{3}, py::ssize_t{3}});
    std::fill_n(
        covariances.mutable_data(), covariances.size(), std::numeric_limits<double>::quiet_NaN());
    auto at = covariances.mutable_unchecked<3>();
    for (const auto& [frame, covariance] : known) SetMatrix(covariance, frame.value, at);
    return covariances;
  }

  py::dict Edges() {
    const ViewGraph graph = Copy(&OdometryResult::graph);
    const auto count = static_cast<py::ssize_t>(graph.edges().size());
    py::array_t<int> i(count);
    py::array_t<int> j(count);
    py::array_t<int> num_inliers(count);
    py::array_t<double> j_from_i({count, py::ssize_t{3}, py::ssize_t{3}});
    py::array_t<double> covariance({count, py::ssize_t{3}, py::ssize_t{3}});
    auto rotation_at = j_from_i.mutable_unchecked<3>();
    auto covariance_at = covariance.mutable_unchecked<3>();
    for (py::ssize_t k = 0; k < count; ++k) {
      const RelativeRotation& edge = graph.edges()[static_cast<std::size_t>(k)];
      i.mutable_at(k) = edge.i.value;
      j.mutable_at(k) = edge.j.value;
      num_inliers.mutable_at(k) = edge.num_inliers;
      SetMatrix(edge.j_from_i.Matrix(), k, rotation_at);
      SetMatrix(edge.covariance, k, covariance_at);
    }
    return py::dict("i"_a = i,
                    "j"_a = j,
                    "j_from_i"_a = j_from_i,
                    "covariance"_a = covariance,
                    "num_inliers"_a = num_inliers);
  }

  int num_frames() const { return num_frames_; }

 private:
  static py::list Describe(const std::vector<LoopCheck>& checks) {
    const py::object loop = py::module_::import("rotslam").attr("Loop");
    py::list loops;
    for (const LoopCheck& check : checks) {
      loops.append(loop(check.frame.value,
                        check.match.value,
                        check.score,
                        check.num_inliers,
                        check.angle_deg,
                        check.accepted,
                        check.scaled.turn_scale,
                        check.scaled.angle_deg,
                        check.num_edges));
    }
    return loops;
  }

  template <class Array>
  static void SetMatrix(const Eigen::Matrix3d& matrix, py::ssize_t k, Array& at) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) at(k, r, c) = matrix(r, c);
    }
  }

  template <class Member>
  Member Copy(Member OdometryResult::*member) {
    const py::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    return odometry_.result().*member;
  }

  std::mutex mutex_;
  Camera camera_;
  LoopedOdometry odometry_;
  double last_timestamp_s_ = -std::numeric_limits<double>::infinity();
  std::atomic<int> num_frames_ = 0;  // read while a call of another thread runs
  bool is_finished_ = false;
};

void AddLoopedOdometry(py::module_& module) {
  const py::object named = py::module_::import("collections").attr("namedtuple");
  module.attr("Loop") = named("Loop",
                              "frame match score inliers angle_deg accepted turn_scale "
                              "scaled_angle_deg edges",
                              "module"_a = "rotslam");
  module.attr("Loop").attr("__doc__") =
      R"(A frame that looked like an older one, and whether geometry agreed: as in loops.csv.

frame, match:     the frame, and the older one.
score:            of their visual words, 0 to 1.
inliers:          matches that agree with the relative rotation.
angle_deg:        of the rotation around the loop, before it was closed.
accepted:         whether it is the same place.
turn_scale, scaled_angle_deg: the factor of all rotations in between with which the loop closes
                  best, and the angle left.
edges:            that have come of it; 0 where the relative rotation is not reliable.)";
  module.attr("LoopedEstimate") = named("LoopedEstimate",
                                        "world_from_cam covariance flags loops has_averaged",
                                        "module"_a = "rotslam");
  module.attr("LoopedEstimate").attr("__doc__") = R"(What one frame brought, loops included.

world_from_cam, covariance, flags: as in Estimate; the covariance is that without loops.
loops:        [Loop] of the frame before this one.
has_averaged: whether a loop has changed orientations of older frames.)";
  py::class_<PyLoopedOdometry>(
      module,
      "LoopedOdometry",
      R"(Orientations frame by frame; places seen before are recognised and close loops.

options:    a dict whose dicts are the groups `rotodom` and `loop` of summary.json, for example
            {"loop": {"max_candidates": 5}}.
vocabulary: a file of visual words; None: the one that is built in.
What it remembers grows with the sequence. C++: rotodom/loop/looped_odometry.h.
Raises ValueError for an option that does not exist or is out of range, RuntimeError for a
vocabulary that cannot be read.)")
      .def(py::init<const Camera&, const py::object&, const py::object&, std::uint64_t, int>(),
           "camera"_a,
           "options"_a = py::none(),
           "vocabulary"_a = py::none(),
           "seed"_a = 1,
           "threads"_a = 1)
      .def("add",
           &PyLoopedOdometry::Add,
           "image"_a,
           "timestamp"_a,
           "Takes the next frame and gives its LoopedEstimate at once; arguments as Odometry.add.")
      .def("finish",
           &PyLoopedOdometry::Finish,
           "Call after the last frame: averages once more where there were loops. Returns [Loop] "
           "of the last frame.")
      .def_property_readonly("orientations",
                             &PyLoopedOdometry::Orientations,
                             "[n, 4], quaternions x y z w, camera->world, of all frames so far.")
      .def_property_readonly("covariances",
                             &PyLoopedOdometry::Covariances,
                             "[n, 3, 3], rad^2, as in Estimate; NaN where nothing is known.")
      .def_property_readonly(
          "edges",
          &PyLoopedOdometry::Edges,
          "The view-graph, loops included: a dict of i, j [m], j_from_i, covariance [m, 3, 3] as "
          "average_rotations takes them, and num_inliers [m].")
      .def_property_readonly("num_frames", &PyLoopedOdometry::num_frames, "Frames taken so far.");
}

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
  AddLoopedOdometry(module);
}

}  // namespace rotslam
