#include "apps/python/slam_result.h"

#include <algorithm>
#include <cstddef>

#include "apps/python/arrays.h"
#include "apps/python/problem.h"
#include "apps/python/sequence.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

std::vector<int> NumbersOf(const std::set<FrameId>& frames) {
  std::vector<int> numbers;
  numbers.reserve(frames.size());
  for (const FrameId frame : frames) numbers.push_back(frame.value);
  return numbers;
}

}  // namespace

std::optional<Frame> ImageList::Next() {
  if (next_ == frames_.size()) return std::nullopt;
  return frames_[next_++];
}

void ImageList::Skip(int count) {
  next_ += std::min(static_cast<std::size_t>(std::max(count, 0)), frames_.size() - next_);
}

void ImageList::Read(const std::set<FrameId>& frames,
                     const std::function<void(FrameId, const cv::Mat&)>& take,
                     const std::function<void(const std::string&)>& tell) {
  for (const FrameId frame : frames) {
    const Frame& wanted = frames_[static_cast<std::size_t>(frame.value)];
    if (wanted.image.empty()) {
      tell("frame " + wanted.name + ": " + wanted.problem);
    } else {
      take(frame, wanted.image);
    }
  }
}

PyResult::PyResult(const SlamResult& result)
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

py::array_t<double> PyResult::Columns(int first, int count) const {
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

py::array_t<double> PyResult::Points() const {
  std::vector<Eigen::Vector3d> points;
  points.reserve(cloud_.size());
  for (const CloudPoint& point : cloud_) points.push_back(point.point_in_world);
  return PointsOf(points);
}

py::array_t<std::uint8_t> PyResult::Colours() const {
  py::array_t<std::uint8_t> colours({static_cast<py::ssize_t>(cloud_.size()), py::ssize_t{3}});
  auto at = colours.mutable_unchecked<2>();
  for (std::size_t k = 0; k < cloud_.size(); ++k) {
    for (int part = 0; part < 3; ++part) {
      at(static_cast<py::ssize_t>(k), part) = cloud_[k].rgb[static_cast<std::size_t>(part)];
    }
  }
  return colours;
}

std::vector<int> PyResult::Keyframes() const { return NumbersOf(map_.keyframes); }

std::vector<std::vector<int>> PyResult::Components() const {
  std::vector<std::vector<int>> components;
  components.reserve(map_.components.size());
  for (const MapComponent& component : map_.components) {
    components.push_back(NumbersOf(component.keyframes));
  }
  return components;
}

std::vector<std::pair<int, int>> PyResult::Segments() const {
  std::vector<std::pair<int, int>> segments;
  segments.reserve(map_.segments.size());
  for (const PureRotationSegment& segment : map_.segments) {
    segments.emplace_back(segment.first.value, segment.last.value);
  }
  return segments;
}

std::optional<std::string> PyResult::Failure() const {
  return map_.failure.empty() ? std::nullopt : std::optional(map_.failure);
}

py::object PyResult::Alignment() const {
  if (!map_.sensor_alignment) return py::none();
  const SensorAlignment& alignment = *map_.sensor_alignment;
  return py::dict("offset_s"_a = alignment.offset_s,
                  "offset_sigma_s"_a = alignment.offset_sigma_s,
                  "has_offset"_a = alignment.has_offset,
                  "cam_from_sensor"_a = ArrayOf(alignment.cam_from_sensor.Matrix()),
                  "mounting_covariance"_a = ArrayOf(alignment.mounting_covariance),
                  "has_mounting"_a = alignment.has_mounting);
}

void PyResult::WriteTrajectory(const py::object& path) const {
  const std::string file = PathOf(path);
  const py::gil_scoped_release unlocked;
  WriteTumTrajectory(file, trajectory_);
}

void PyResult::WriteCloud(const py::object& path) const {
  const std::string file = PathOf(path);
  const py::gil_scoped_release unlocked;
  WritePly(file, cloud_);
}

std::string PyResult::Describe() const {
  return "<rotslam.Result " + std::to_string(trajectory_.size()) + " frames, " +
         std::to_string(cloud_.size()) + " points" +
         (map_.failure.empty() ? "" : ", " + map_.failure) + ">";
}

}  // namespace rotslam
