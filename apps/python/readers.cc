#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/problem.h"
#include "output/export/known_rotation_file.h"
#include "output/graph/rotation_list_file.h"
#include "output/trajectory/orientation_file.h"
#include "output/trajectory/trajectory.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

py::array_t<double> RowsOf(const std::vector<std::vector<double>>& rows, py::ssize_t columns) {
  py::array_t<double> array({static_cast<py::ssize_t>(rows.size()), columns});
  auto at = array.mutable_unchecked<2>();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    for (py::ssize_t c = 0; c < columns; ++c) {
      at(static_cast<py::ssize_t>(k), c) = rows[k][static_cast<std::size_t>(c)];
    }
  }
  return array;
}

py::dict ReadGraph(const py::object& path, double sigma_rad) {
  const RotationList list = ReadRotationList(PathOf(path), sigma_rad);
  std::vector<int> i;
  std::vector<int> j;
  RotationMap j_from_i;
  py::array_t<double> covariance(
      {static_cast<py::ssize_t>(list.edges.size()), py::ssize_t{3}, py::ssize_t{3}});
  auto at = covariance.mutable_unchecked<3>();
  for (const RelativeRotation& edge : list.edges) {
    const auto k = static_cast<py::ssize_t>(i.size());
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) at(k, a, b) = edge.covariance(a, b);
    }
    j_from_i[FrameId{static_cast<int>(k)}] = edge.j_from_i;
    i.push_back(edge.i.value);
    j.push_back(edge.j.value);
  }
  const auto num_views = static_cast<int>(list.ids.size());
  const auto num_edges = static_cast<int>(list.edges.size());
  const py::object vertices = list.cam_from_world.empty()
                                  ? py::object(py::none())
                                  : py::object(MatricesOf(list.cam_from_world, num_views));
  return py::dict("ids"_a = list.ids,
                  "i"_a = py::array_t<int>(num_edges, i.data()),
                  "j"_a = py::array_t<int>(num_edges, j.data()),
                  "j_from_i"_a = MatricesOf(j_from_i, num_edges),
                  "covariance"_a = covariance,
                  "cam_from_world"_a = vertices,
                  "form"_a = list.form,
                  "notes"_a = list.notes,
                  "unread"_a = list.unread);
}

py::dict ReadProblem(const py::object& path) {
  const KnownRotationInput input = WithViewsInOrder(ReadKnownRotation(PathOf(path)));
  const auto num_views = static_cast<int>(input.cam_from_world.size());
  std::vector<int> view;
  std::vector<int> track;
  std::vector<std::vector<double>> pixels;
  std::vector<double> sigma_px;
  std::vector<std::string> track_names;
  for (const Track& one : input.tracks) {
    for (const Observation& observation : one.observations) {
      view.push_back(observation.frame.value);
      track.push_back(one.id.value);
      pixels.push_back({observation.keypoint_px.x(), observation.keypoint_px.y()});
      sigma_px.push_back(observation.sigma_px);
    }
  }
  std::vector<std::string> names;
  std::vector<double> timestamps;
  std::vector<double> sigma_rad;
  for (const auto& [id, rotation] : input.cam_from_world) {
    names.push_back(NameOf(input, id));
    timestamps.push_back(input.timestamp_s.at(id));
    const auto known = input.sigma_rad.find(id);
    if (known != input.sigma_rad.end()) sigma_rad.push_back(known->second);
  }
  const auto count = static_cast<py::ssize_t>(view.size());
  const py::object sigmas = sigma_rad.size() != names.size()
                                ? py::object(py::none())
                                : py::object(py::array_t<double>(num_views, sigma_rad.data()));
  return py::dict("cam_from_world"_a = MatricesOf(input.cam_from_world, num_views),
                  "view"_a = py::array_t<int>(count, view.data()),
                  "track"_a = py::array_t<int>(count, track.data()),
                  "keypoints_px"_a = RowsOf(pixels, 2),
                  "sigma_px"_a = py::array_t<double>(count, sigma_px.data()),
                  "sigma_rad"_a = sigmas,
                  "camera"_a = input.camera,
                  "names"_a = names,
                  "timestamps"_a = py::array_t<double>(num_views, timestamps.data()),
                  "form"_a = input.format,
                  "notes"_a = input.notes);
}

py::array_t<double> ReadPoses(const py::object& path, const py::object& times) {
  std::optional<std::filesystem::path> times_file;
  if (!times.is_none()) times_file = PathOf(times);
  std::vector<std::vector<double>> rows;
  for (const StampedPose& pose : ReadTrajectory(PathOf(path), times_file)) {
    const Eigen::Vector4d q = pose.world_from_cam.Quaternion().coeffs();
    const Eigen::Vector3d& t = pose.center_in_world;
    rows.push_back({pose.timestamp_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
  }
  return RowsOf(rows, 8);
}

py::array_t<double> ReadRotations(const py::object& path) {
  std::vector<std::vector<double>> rows;
  for (const StampedRotation& rotation : ReadOrientations(PathOf(path))) {
    const Eigen::Vector4d q = rotation.world_from_cam.Quaternion().coeffs();
    rows.push_back({rotation.timestamp_s, q.x(), q.y(), q.z(), q.w()});
  }
  return RowsOf(rows, 5);
}

}  // namespace

void AddReaders(py::module_& module) {
  module.def("read_relative_rotations",
             &ReadGraph,
             "path"_a,
             "sigma_rad"_a = kRadFromDeg,
             R"(Relative rotations of a file: g2o, TORO, 1DSfM, GLOMAP or lists.

sigma_rad: of edges whose lines say none, about each axis.
Returns a dict:
  ids             the file's n names of views; view k is ids[k]
  i, j, j_from_i, covariance   m edges as average_rotations takes them
  cam_from_world  [n, 3, 3] of the vertices, or None
  form, notes, unread          what the file was taken for, what was assumed, which lines were not
                               read
Raises RuntimeError with file, line and reason. C++: output/graph/rotation_list_file.h.)");
  module.def("read_known_rotation",
             &ReadProblem,
             "path"_a,
             R"(Orientations, tracks and camera: of a run's folder, a COLMAP model, BAL or our text.

Returns a dict:
  cam_from_world, view, track, keypoints_px, sigma_px, camera   as solve_known_rotation takes them
  sigma_rad        [n], deviations of the orientations, or None where the file has none
  names            the file's n names of views
  timestamps       [n], seconds, or numbers where the file has no times
  form, notes      what the file was taken for, and what was merged or left out
Raises RuntimeError with file, line and reason. C++: output/export/known_rotation_file.h.)");
  module.def("read_trajectory",
             &ReadPoses,
             "path"_a,
             "times"_a = py::none(),
             R"(Poses of a file in any form that `rotslam eval` reads.

times: file with timestamps of files that have none.
Returns [n, 8]: timestamp, position, quaternion x y z w (camera->world). Raises RuntimeError with
file, line and reason. C++: output/trajectory/trajectory.h.)");
  module.def("read_orientations",
             &ReadRotations,
             "path"_a,
             R"(Orientations of a file: any trajectory with times, or a rotations.csv.

Returns [n, 5]: timestamp, quaternion x y z w (camera->world). Raises RuntimeError with file, line
and reason. C++: output/trajectory/orientation_file.h.)");
}

}  // namespace rotslam
