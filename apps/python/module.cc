// The Python module `rotslam`. Docstrings here are the manual; the algorithms' own are in the C++
// headers named there.
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "apps/config.h"
#include "apps/evaluation.h"
#include "krot/known_rotation.h"
#include "output/summary.h"
#include "output/trajectory.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/odometry.h"
#include "rotodom/sequence/sequence.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

// ---- what comes in

std::string ShapeOf(const py::array& array) { return py::str(array.attr("shape")); }

[[noreturn]] void RefuseArray(const char* name, const char* expected, const py::array& found) {
  throw std::invalid_argument(std::string(name) + " must be " + expected + ", found " +
                              std::string(py::str(found.dtype())) + " of shape " + ShapeOf(found));
}

// An array of numbers with these sizes, -1 for any; integers count as numbers, booleans do not.
DoubleArray Numbers(const char* name,
                    const char* expected,
                    const py::object& object,
                    const std::vector<py::ssize_t>& shape) {
  const py::array array = py::array::ensure(object);
  if (!array) throw std::invalid_argument(std::string(name) + " must be " + expected);
  const char kind = array.dtype().kind();
  bool fits = (kind == 'f' || kind == 'i' || kind == 'u') &&
              array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (py::ssize_t k = 0; fits && k < array.ndim(); ++k) {
    fits = shape[static_cast<std::size_t>(k)] < 0 ||
           shape[static_cast<std::size_t>(k)] == array.shape(k);
  }
  if (!fits) RefuseArray(name, expected, array);
  return DoubleArray::ensure(array);
}

std::vector<int> Indices(const char* name, const py::object& object) {
  constexpr const char* kExpected = "one-dimensional array of integers from 0";
  const py::array array = py::array::ensure(object);
  if (!array) throw std::invalid_argument(std::string(name) + " must be a " + kExpected);
  const char kind = array.dtype().kind();
  if ((kind != 'i' && kind != 'u') || array.ndim() != 1) RefuseArray(name, kExpected, array);
  const auto wide = py::array_t<std::int64_t, py::array::forcecast>::ensure(array);
  std::vector<int> indices;
  indices.reserve(static_cast<std::size_t>(wide.size()));
  for (py::ssize_t k = 0; k < wide.size(); ++k) {
    const std::int64_t index = wide.at(k);
    if (index < 0 || index > std::numeric_limits<int>::max()) {
      throw std::invalid_argument(std::string(name) + " has " + std::to_string(index) + " at " +
                                  std::to_string(k) + ", must be " + kExpected);
    }
    indices.push_back(static_cast<int>(index));
  }
  return indices;
}

std::string PathOf(const py::object& path) {
  return py::str(py::module_::import("os").attr("fspath")(path));
}

template <class Field>
void Assign(const std::string& key, const py::handle& value, Field& field) {
  const bool is_bool = py::isinstance<py::bool_>(value);
  const bool is_int = py::isinstance<py::int_>(value) && !is_bool;
  bool fits = is_int;
  const char* expected = "a whole number";
  if constexpr (std::is_same_v<Field, bool>) {
    fits = is_bool;
    expected = "True or False";
  } else if constexpr (std::is_same_v<Field, double>) {
    fits = is_int || py::isinstance<py::float_>(value);
    expected = "a number";
  } else if constexpr (std::is_same_v<Field, std::string>) {
    fits = py::isinstance<py::str>(value);
    expected = "text";
  }
  try {
    if (fits) {
      field = value.cast<Field>();
      return;
    }
  } catch (const py::cast_error&) {  // does not fit into the field
  }
  throw std::invalid_argument("\"" + key + "\" expects " + expected + ", found " +
                              std::string(py::repr(value)));
}

void OverrideGroup(const py::dict& given,
                   const std::string& prefix,
                   const std::vector<OptionRef>& options) {
  for (const auto& [name, value] : given) {
    const std::string key = prefix + std::string(py::str(name));
    if (py::isinstance<py::dict>(value)) {
      OverrideGroup(py::reinterpret_borrow<py::dict>(value), key + ".", options);
      continue;
    }
    bool found = false;
    for (const OptionRef& option : options) {
      if (option.key != key) continue;
      found = true;
      std::visit([&, v = value](auto* field) { Assign(key, v, *field); }, option.field);
    }
    if (found) continue;
    const bool is_group = std::any_of(options.begin(), options.end(), [&](const OptionRef& option) {
      return option.key.starts_with(key + ".");
    });
    throw std::invalid_argument(is_group ? "\"" + key + "\" is a group of options, found " +
                                               std::string(py::repr(value))
                                         : UnknownOption(key, options));
  }
}

// The defaults, overridden by a dict whose dicts are the options' groups.
template <class Options>
Options OptionsFrom(const py::object& given) {
  Options options;
  if (given.is_none()) return options;
  if (!py::isinstance<py::dict>(given)) {
    throw std::invalid_argument("options must be a dict, found " + std::string(py::repr(given)));
  }
  OverrideGroup(py::reinterpret_borrow<py::dict>(given), "", ListOptions(options));
  return options;
}

// ---- what goes out

template <class Matrix>
py::array_t<double> ArrayOf(const Matrix& matrix) {
  py::array_t<double> array({matrix.rows(), matrix.cols()});
  auto view = array.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < matrix.rows(); ++i) {
    for (py::ssize_t j = 0; j < matrix.cols(); ++j) view(i, j) = matrix(i, j);
  }
  return array;
}

// Camera->world, x y z w, as trajectory files have it.
py::array_t<double> QuaternionOf(const Rotation& cam_from_world) {
  const Eigen::Vector4d xyzw = cam_from_world.Inverse().Quaternion().coeffs();
  return py::array_t<double>(4, xyzw.data());
}

py::array_t<double> PointsOf(const std::vector<Eigen::Vector3d>& points) {
  py::array_t<double> array({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  auto view = array.mutable_unchecked<2>();
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) view(static_cast<py::ssize_t>(k), axis) = points[k][axis];
  }
  return array;
}

// ---- Camera

Camera MakeCamera(double fx,
                  double fy,
                  double cx,
                  double cy,
                  int width,
                  int height,
                  const std::string& model,
                  const std::vector<double>& distortion,
                  double readout_s) {
  Camera camera;
  bool is_known = false;
  for (const CameraModel known :
       {CameraModel::kPinhole, CameraModel::kRadtan, CameraModel::kEquidistant}) {
    if (model != Name(known)) continue;
    camera.model = known;
    is_known = true;
  }
  if (!is_known) {
    throw std::invalid_argument("model is \"" + model +
                                "\", must be pinhole, radtan or equidistant");
  }
  if (distortion.size() > camera.distortion.size()) {
    throw std::invalid_argument("distortion has " + std::to_string(distortion.size()) +
                                " numbers, must be at most 5");
  }
  std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
  camera.fx = fx;
  camera.fy = fy;
  camera.cx = cx;
  camera.cy = cy;
  camera.width = width;
  camera.height = height;
  camera.readout_s = readout_s;
  if (const auto problem = camera.Problem()) throw std::invalid_argument(*problem);
  return camera;
}

Camera ReadCameraFor(const py::object& path,
                     const std::optional<int>& width,
                     const std::optional<int>& height) {
  const Camera camera = ReadCamera(PathOf(path));
  if (width.has_value() != height.has_value()) {
    throw std::invalid_argument("width and height go together");
  }
  return width ? MatchToImages(camera, cv::Size(*width, *height)) : camera;
}

// ---- images

cv::Mat ImageOf(const py::object& object, const Camera& camera) {
  if (object.is_none()) return {};
  constexpr const char* kExpected = "a uint8 array [height, width] or [height, width, 3] (BGR)";
  const py::array image = py::array::ensure(object);
  if (!image) throw std::invalid_argument(std::string("image must be ") + kExpected);
  const bool is_grey = image.ndim() == 2;
  const bool is_bgr = image.ndim() == 3 && image.shape(2) == 3;
  if (!(is_grey || is_bgr) || image.dtype().kind() != 'u' || image.itemsize() != 1) {
    RefuseArray("image", kExpected, image);
  }
  if (image.shape(0) != camera.height || image.shape(1) != camera.width) {
    throw std::invalid_argument("image must have the camera's size [" +
                                std::to_string(camera.height) + ", " +
                                std::to_string(camera.width) + "], found " + ShapeOf(image));
  }
  const auto packed = py::array_t<std::uint8_t, py::array::c_style>::ensure(image);
  // The caller may write into the array as soon as the call is over; older images stay in use.
  return cv::Mat(camera.height,
                 camera.width,
                 is_grey ? CV_8UC1 : CV_8UC3,
                 const_cast<std::uint8_t*>(packed.data()))
      .clone();
}

py::object ArrayOfImage(const cv::Mat& image) {
  if (image.empty()) return py::none();
  std::vector<py::ssize_t> shape = {image.rows, image.cols};
  if (image.channels() > 1) shape.push_back(image.channels());
  py::array_t<std::uint8_t> array(shape);
  const cv::Mat target(image.rows, image.cols, image.type(), array.mutable_data());
  image.copyTo(target);
  return array;
}

// ---- Sequence

class PySequence {
 public:
  PySequence(const py::object& path, int first, int last, int stride, double fps) {
    SequenceOptions options;
    options.first = first;
    options.last = last;
    options.stride = stride;
    options.fps = fps;
    if (const auto problem = options.Problem()) throw std::invalid_argument(*problem);
    sequence_ = OpenSequence(PathOf(path), options);
  }

  py::tuple Next() {
    std::optional<Frame> frame;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      frame = sequence_->Next();
    }
    if (!frame) throw py::stop_iteration();
    return py::make_tuple(ArrayOfImage(frame->image), frame->timestamp_s);
  }

  int NumFrames() const { return sequence_->NumFrames(); }

  std::optional<Camera> OwnCamera() const {
    const auto& file = sequence_->CameraFile();
    if (!file) return std::nullopt;
    return MatchToImages(ReadCamera(*file), sequence_->image_size());
  }

  std::optional<std::string> GroundTruth() const {
    const auto& file = sequence_->GroundTruthFile();
    if (!file) return std::nullopt;
    return file->string();
  }

 private:
  std::mutex mutex_;
  std::unique_ptr<Sequence> sequence_;
};

// ---- Odometry

class PyOdometry {
 public:
  PyOdometry(const Camera& camera, const py::object& options, std::uint64_t seed, int threads)
      : camera_(camera),
        odometry_(camera, Checked<OdometryOptions>(options, threads), seed, threads) {
    if (camera.width < 1 || camera.height < 1) {
      throw std::invalid_argument(
          "camera has no size: its file does not say; give read_camera the width and height");
    }
  }

  py::object Add(const py::object& image, double timestamp_s) {
    const cv::Mat grey = ImageOf(image, camera_);
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

  template <class Options>
  static Options Checked(const py::object& given, int threads) {
    Options options = OptionsFrom<Options>(given);
    if (const auto problem = options.Problem()) throw std::invalid_argument(*problem);
    if (threads < 1) {
      throw std::invalid_argument("threads is " + std::to_string(threads) + ", must be 1 or more");
    }
    return options;
  }

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

// ---- solve_known_rotation

RotationMap RotationsFrom(const DoubleArray& matrices) {
  RotationMap cam_from_world;
  const auto at = matrices.unchecked<3>();
  for (py::ssize_t k = 0; k < at.shape(0); ++k) {
    Eigen::Matrix3d R_c_w;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R_c_w(i, j) = at(k, i, j);
    }
    try {
      cam_from_world[FrameId{static_cast<int>(k)}] = Rotation::FromMatrix(R_c_w);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("cam_from_world[" + std::to_string(k) + "]: " + error.what());
    }
  }
  return cam_from_world;
}

std::vector<Track> TracksFrom(const std::vector<int>& view,
                              const std::vector<int>& track,
                              const DoubleArray& keypoints_px,
                              const std::optional<DoubleArray>& sigma_px,
                              const Camera& camera) {
  const auto at = keypoints_px.unchecked<2>();
  // By track, then by view, whatever the order they came in.
  std::map<int, std::multimap<int, Observation>> observations;
  for (std::size_t k = 0; k < view.size(); ++k) {
    const auto row = static_cast<py::ssize_t>(k);
    Observation observation;
    observation.frame = FrameId{view[k]};
    observation.keypoint_px = {at(row, 0), at(row, 1)};
    if (sigma_px) observation.sigma_px = sigma_px->at(row);
    const std::optional<Eigen::Vector3d> bearing = camera.Unproject(observation.keypoint_px);
    if (!bearing || !bearing->allFinite()) {
      throw std::invalid_argument("keypoints_px[" + std::to_string(k) +
                                  "] is no place that this camera can see");
    }
    observation.bearing = *bearing;
    observations[track[k]].emplace(view[k], observation);
  }
  std::vector<Track> tracks;
  tracks.reserve(observations.size());
  for (const auto& [id, by_view] : observations) {
    Track& added = tracks.emplace_back();
    added.id = TrackId{id};
    for (const auto& [index, observation] : by_view) added.observations.push_back(observation);
  }
  return tracks;
}

py::dict Describe(const KrotSolution& solution, int num_views) {
  const double missing = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector3d> centers(static_cast<std::size_t>(num_views),
                                       Eigen::Vector3d::Constant(missing));
  for (const auto& [frame, center] : solution.center_in_world) {
    centers[static_cast<std::size_t>(frame.value)] = center;
  }
  std::vector<int> component(static_cast<std::size_t>(num_views), -1);
  for (const auto& [frame, number] : solution.component) {
    component[static_cast<std::size_t>(frame.value)] = number;
  }
  std::vector<int> point_ids;
  std::vector<Eigen::Vector3d> points;
  for (const auto& [id, point] : solution.point_in_world) {
    point_ids.push_back(id.value);
    points.push_back(point);
  }
  py::list removed;
  for (const RemovedObservation& observation : solution.removed) {
    removed.append(py::make_tuple(
        observation.track.value, observation.frame.value, ToString(observation.reason)));
  }
  return py::dict("status"_a = ToString(solution.status),
                  "message"_a = solution.message,
                  "centers"_a = PointsOf(centers),
                  "component"_a = py::array_t<int>(static_cast<py::ssize_t>(component.size()),
                                                   component.data()),
                  "point_ids"_a = py::array_t<int>(static_cast<py::ssize_t>(point_ids.size()),
                                                   point_ids.data()),
                  "points"_a = PointsOf(points),
                  "gamma_low"_a = solution.gamma_low,
                  "gamma_high"_a = solution.gamma_high,
                  "gap"_a = solution.Gap(),
                  "removed"_a = removed);
}

py::dict Solve(const py::object& cam_from_world,
               const py::object& view,
               const py::object& track,
               const py::object& keypoints_px,
               const Camera& camera,
               const py::object& given_options,
               const py::object& sigma_px,
               const py::object& sigma_rad,
               int threads) {
  const DoubleArray matrices =
      Numbers("cam_from_world", "an array of numbers [n, 3, 3]", cam_from_world, {-1, 3, 3});
  const int num_views = static_cast<int>(matrices.shape(0));
  const std::vector<int> views = Indices("view", view);
  const std::vector<int> tracks = Indices("track", track);
  const auto count = static_cast<py::ssize_t>(views.size());
  if (tracks.size() != views.size()) {
    throw std::invalid_argument("track must be as long as view, " + std::to_string(views.size()) +
                                ", found " + std::to_string(tracks.size()));
  }
  const DoubleArray pixels =
      Numbers("keypoints_px", "an array of numbers [m, 2], m as in view", keypoints_px, {count, 2});
  std::optional<DoubleArray> noise_px;
  if (!sigma_px.is_none()) {
    noise_px = Numbers("sigma_px", "an array of numbers [m], m as in view", sigma_px, {count});
  }
  std::map<FrameId, double> noise_rad;
  if (!sigma_rad.is_none()) {
    const DoubleArray sigmas =
        Numbers("sigma_rad", "an array of numbers [n], n views", sigma_rad, {num_views});
    for (int k = 0; k < num_views; ++k) noise_rad[FrameId{k}] = sigmas.at(k);
  }
  KrotOptions options = PyOdometry::Checked<KrotOptions>(given_options, threads);
  options.num_threads = threads;
  const RotationMap rotations = RotationsFrom(matrices);
  const std::vector<Track> all_tracks = TracksFrom(views, tracks, pixels, noise_px, camera);
  KrotSolution solution;
  {
    const py::gil_scoped_release unlocked;
    solution = SolveKnownRotation(rotations, all_tracks, camera, options, noise_rad);
  }
  return Describe(solution, num_views);
}

// ---- evaluate

struct NamedTrajectory {
  Trajectory trajectory;
  std::string name;
};

NamedTrajectory TrajectoryFrom(const char* argument,
                               const py::object& object,
                               const std::optional<std::filesystem::path>& times) {
  if (py::isinstance<py::str>(object) || py::hasattr(object, "__fspath__")) {
    const std::string path = PathOf(object);
    return {ReadTrajectory(path, times), path};
  }
  const DoubleArray rows = Numbers(argument,
                                   "a file or an array of numbers [n, 8], n lines of a TUM "
                                   "trajectory (timestamp tx ty tz qx qy qz qw)",
                                   object,
                                   {-1, 8});
  NamedTrajectory result{{}, argument};
  const auto at = rows.unchecked<2>();
  for (py::ssize_t k = 0; k < at.shape(0); ++k) {
    if (k > 0 && !(at(k, 0) >= at(k - 1, 0))) {
      throw std::invalid_argument(std::string(argument) + ": timestamps must ascend, row " +
                                  std::to_string(k) + " does not");
    }
    StampedPose pose;
    pose.timestamp_s = at(k, 0);
    pose.center_in_world = {at(k, 1), at(k, 2), at(k, 3)};
    pose.world_from_cam = Rotation(Eigen::Quaterniond(at(k, 7), at(k, 4), at(k, 5), at(k, 6)));
    if (!pose.center_in_world.allFinite()) {
      throw std::invalid_argument(std::string(argument) + ": a position is not finite, row " +
                                  std::to_string(k));
    }
    result.trajectory.push_back(pose);
  }
  return result;
}

py::object EvaluateTrajectory(const py::object& ground_truth,
                              const py::object& estimate,
                              const py::object& times,
                              double max_gap_s,
                              int images,
                              int threads) {
  MetricsOptions options;
  options.max_gap_s = max_gap_s;
  options.num_threads = threads;
  if (const auto problem = options.Problem()) throw std::invalid_argument(*problem);
  if (images < 0) {
    throw std::invalid_argument("images is " + std::to_string(images) + ", must be 0 or more");
  }
  std::optional<std::filesystem::path> times_file;
  if (!times.is_none()) times_file = PathOf(times);
  const NamedTrajectory truth = TrajectoryFrom("ground_truth", ground_truth, times_file);
  const NamedTrajectory found = TrajectoryFrom("estimate", estimate, times_file);
  std::string metrics;
  {
    const py::gil_scoped_release unlocked;
    metrics = MetricsJson(CompareTrajectories(
                              truth.trajectory, truth.name, found.trajectory, found.name, options),
                          images)
                  .dump();
  }
  return py::module_::import("json").attr("loads")(metrics);
}

// ---- the module

void AddCamera(py::module_& module) {
  py::class_<Camera>(module, "Camera", R"(A calibrated camera: x right, y down, z forward.

Lengths in pixels, pixel centres at integer coordinates. model is "pinhole", "radtan" (OpenCV:
k1 k2 p1 p2 k3) or "equidistant" (k1 k2 k3 k4). readout_s: rolling shutter, seconds from the
first row to the last; 0 for a global one.)")
      .def(py::init(&MakeCamera),
           "fx"_a,
           "fy"_a,
           "cx"_a,
           "cy"_a,
           "width"_a,
           "height"_a,
           "model"_a = "pinhole",
           "distortion"_a = std::vector<double>(),
           "readout_s"_a = 0.0)
      .def_readonly("fx", &Camera::fx)
      .def_readonly("fy", &Camera::fy)
      .def_readonly("cx", &Camera::cx)
      .def_readonly("cy", &Camera::cy)
      .def_readonly("width", &Camera::width)
      .def_readonly("height", &Camera::height)
      .def_readonly("distortion", &Camera::distortion)
      .def_readonly("readout_s", &Camera::readout_s)
      .def_property_readonly("model", [](const Camera& camera) { return Name(camera.model); })
      .def("__repr__",
           [](const Camera& camera) { return "<rotslam.Camera " + Describe(camera) + ">"; });
  module.def(
      "read_camera",
      &ReadCameraFor,
      "path"_a,
      "width"_a = py::none(),
      "height"_a = py::none(),
      R"(The camera of a calibration file: our YAML, ORB-SLAM, Kalibr, KITTI, EuRoC or COLMAP.

width, height: of the images, for files that do not say; a file that says otherwise is refused.
Raises RuntimeError in one line that names file and key.)");
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

void AddFunctions(py::module_& module) {
  module.def("solve_known_rotation",
             &Solve,
             "cam_from_world"_a,
             "view"_a,
             "track"_a,
             "keypoints_px"_a,
             "camera"_a,
             "options"_a = py::none(),
             "sigma_px"_a = py::none(),
             "sigma_rad"_a = py::none(),
             "threads"_a = 1,
             R"(Camera centres and points, the cameras' rotations being known.

cam_from_world: [n, 3, 3], world->camera.
view, track:    [m] integers: observation k is of point track[k] in view view[k].
keypoints_px:   [m, 2], where the distorted image shows it.
options:        dict, the group `krot` in summary.json, for example {"start": "bisection"}.
sigma_px:       [m], standard deviations of the keypoints per image axis; None: 1.
sigma_rad:      [n], standard deviations of the orientations against the first; None: not known.

Returns a dict:
  status, message        "converged", "iteration_limit", "infeasible" .. and a sentence for people
  centers                [n, 3], in the world frame; NaN for views that could not be placed
  component              [n]; -1 for those; each component has an origin and a scale of its own
  point_ids, points      [p] and [p, 3]
  gamma_low, gamma_high  the least possible largest residual lies between, unit focal length
  gap                    1 - gamma_low / gamma_high
  removed                [(track, view, reason)]
Other Python threads run meanwhile. Raises ValueError for wrong arrays or options. C++:
krot/known_rotation.h.)");
  module.def("evaluate",
             &EvaluateTrajectory,
             "ground_truth"_a,
             "estimate"_a,
             "times"_a = py::none(),
             "max_gap_s"_a = MetricsOptions{}.max_gap_s,
             "images"_a = 0,
             "threads"_a = 1,
             R"(How far a trajectory is from the truth: the numbers of `rotslam eval --json`.

ground_truth, estimate: TUM or KITTI files, or [n, 8] arrays with the columns of TUM (timestamp
                        tx ty tz qx qy qz qw, camera->world), timestamps ascending.
times:     file with timestamps of KITTI files.
max_gap_s: largest gap in the ground truth to interpolate over.
images:    images of the sequence, for the coverage; 0: no coverage.
Returns a dict: n, images, coverage, rpe1, rpe1_median, rpe1_p90, rpe1_max, rpen (deg), r_err (deg
per 100 m), ate, scale, path_length; None where a number is not defined. Raises RuntimeError where
files cannot be read or fewer than three poses have ground truth. C++: output/metrics.h.)");
}

}  // namespace
}  // namespace rotslam

PYBIND11_MODULE(rotslam, module) {
  module.doc() =
      "Known-rotation monocular SLAM: orientations frame by frame, positions from known rotations, "
      "evaluation.";
  module.attr("__version__") = rotslam::Version();
  // Our stages bring their own threads.
  cv::setNumThreads(1);
  rotslam::AddCamera(module);
  rotslam::AddSequence(module);
  rotslam::AddOdometry(module);
  rotslam::AddFunctions(module);
}
