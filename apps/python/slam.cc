#include "apps/slam/slam.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
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
#include "apps/slam/live/live_slam.h"
#include "output/map/ply.h"
#include "output/trajectory/trajectory.h"

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

// Images that Python holds as arrays.
class ImageList : public FrameSource {
 public:
  explicit ImageList(std::vector<Frame> frames) : frames_(std::move(frames)) {}

  std::optional<Frame> Next() override {
    if (next_ == frames_.size()) return std::nullopt;
    return frames_[next_++];
  }
  void Skip(int count) override {
    next_ += std::min(static_cast<std::size_t>(std::max(count, 0)), frames_.size() - next_);
  }
  void Rewind() override { next_ = 0; }
  int NumFrames() const override { return static_cast<int>(frames_.size()); }
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId, const cv::Mat&)>& take,
            const std::function<void(const std::string&)>& tell) override {
    for (const FrameId frame : frames) {
      const Frame& wanted = frames_[static_cast<std::size_t>(frame.value)];
      if (wanted.image.empty()) {
        tell("frame " + wanted.name + ": " + wanted.problem);
      } else {
        take(frame, wanted.image);
      }
    }
  }

 private:
  std::vector<Frame> frames_;
  std::size_t next_ = 0;
};

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

class PyResult {
 public:
  explicit PyResult(const SlamResult& result)
      : map_(result.map), interrupted_(result.orientations.interrupted) {
    const Orientations& orientations = result.orientations;
    if (interrupted_) {
      map_.cam_from_world = orientations.cam_from_world;
      map_.camera = orientations.camera;
      map_.failure = "stopped before the last frame";
    }
    for (const auto& [frame, cam_from_world] : map_.cam_from_world) {
      const auto center = map_.center_in_world.find(frame);
      trajectory_.push_back(
          {orientations.timestamps_s[frame.value],
           cam_from_world.Inverse(),
           center == map_.center_in_world.end() ? Eigen::Vector3d::Zero() : center->second});
    }
    if (!map_.cloud.point_in_world.empty()) cloud_ = MakeCloud(map_.cloud, map_.camera);
  }

  // Columns of a TUM trajectory: time, position (1 to 3), quaternion x y z w (4 to 7).
  py::array_t<double> Columns(int first, int count) const {
    py::array_t<double> rows({static_cast<py::ssize_t>(trajectory_.size()), py::ssize_t{count}});
    auto at = rows.mutable_unchecked<2>();
    for (std::size_t k = 0; k < trajectory_.size(); ++k) {
      const StampedPose& pose = trajectory_[k];
      Eigen::Matrix<double, 8, 1> row;
      row << pose.timestamp_s, pose.center_in_world, pose.world_from_cam.Quaternion().coeffs();
      for (int c = 0; c < count; ++c) at(static_cast<py::ssize_t>(k), c) = row[first + c];
    }
    return rows;
  }

  py::array_t<double> Points() const {
    std::vector<Eigen::Vector3d> points;
    points.reserve(cloud_.size());
    for (const CloudPoint& point : cloud_) points.push_back(point.point_in_world);
    return PointsOf(points);
  }

  py::array_t<std::uint8_t> Colours() const {
    py::array_t<std::uint8_t> colours({static_cast<py::ssize_t>(cloud_.size()), py::ssize_t{3}});
    auto at = colours.mutable_unchecked<2>();
    for (std::size_t k = 0; k < cloud_.size(); ++k) {
      for (int part = 0; part < 3; ++part) {
        at(static_cast<py::ssize_t>(k), part) = cloud_[k].rgb[static_cast<std::size_t>(part)];
      }
    }
    return colours;
  }

  std::vector<int> Keyframes() const { return NumbersOf(map_.keyframes); }

  std::vector<std::vector<int>> Components() const {
    std::vector<std::vector<int>> components;
    components.reserve(map_.components.size());
    for (const MapComponent& component : map_.components) {
      components.push_back(NumbersOf(component.keyframes));
    }
    return components;
  }

  std::vector<std::pair<int, int>> Segments() const {
    std::vector<std::pair<int, int>> segments;
    segments.reserve(map_.segments.size());
    for (const PureRotationSegment& segment : map_.segments) {
      segments.emplace_back(segment.first.value, segment.last.value);
    }
    return segments;
  }

  std::optional<std::string> Failure() const {
    return map_.failure.empty() ? std::nullopt : std::optional(map_.failure);
  }
  const Camera& camera() const { return map_.camera; }
  py::object Alignment() const {
    if (!map_.sensor_alignment) return py::none();
    const SensorAlignment& alignment = *map_.sensor_alignment;
    return py::dict("offset_s"_a = alignment.offset_s,
                    "offset_sigma_s"_a = alignment.offset_sigma_s,
                    "has_offset"_a = alignment.has_offset,
                    "cam_from_sensor"_a = ArrayOf(alignment.cam_from_sensor.Matrix()),
                    "mounting_covariance"_a = ArrayOf(alignment.mounting_covariance),
                    "has_mounting"_a = alignment.has_mounting);
  }
  bool is_pure_rotation() const { return map_.rotates_throughout; }
  bool interrupted() const { return interrupted_; }

  void WriteTrajectory(const py::object& path) const {
    const std::string file = PathOf(path);
    const py::gil_scoped_release unlocked;
    WriteTumTrajectory(file, trajectory_);
  }
  void WriteCloud(const py::object& path) const {
    const std::string file = PathOf(path);
    const py::gil_scoped_release unlocked;
    WritePly(file, cloud_);
  }

  std::string Describe() const {
    return "<rotslam.Result " + std::to_string(trajectory_.size()) + " frames, " +
           std::to_string(cloud_.size()) + " points" +
           (map_.failure.empty() ? "" : ", " + map_.failure) + ">";
  }

 private:
  static std::vector<int> NumbersOf(const std::set<FrameId>& frames) {
    std::vector<int> numbers;
    numbers.reserve(frames.size());
    for (const FrameId frame : frames) numbers.push_back(frame.value);
    return numbers;
  }

  MapResult map_;
  bool interrupted_;
  Trajectory trajectory_;
  std::vector<CloudPoint> cloud_;
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
  SlamOptions options = OptionsFrom<SlamOptions>(given_options);
  CheckThreads(threads);
  options.seed = seed;
  options.num_threads = threads;
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
