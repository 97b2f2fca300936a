#include "krot/known_rotation.h"

#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/options.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

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

// Nine parameters: the keyword arguments of rotslam.solve_known_rotation.
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
  KrotOptions options = OptionsFrom<KrotOptions>(given_options);
  CheckThreads(threads);
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

}  // namespace

void AddKnownRotation(py::module_& module) {
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
}

}  // namespace rotslam
