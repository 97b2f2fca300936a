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
#include "apps/python/problem.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

py::dict Describe(const KrotSolution& solution, int num_views) {
  const std::vector<Eigen::Vector3d> centers = CentersOf(solution.center_in_world, num_views);
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
  const RotationMap rotations = RotationsFrom("cam_from_world", cam_from_world);
  const int num_views = static_cast<int>(rotations.size());
  const std::vector<Track> all_tracks = TracksFrom(view, track, keypoints_px, sigma_px, camera);
  std::map<FrameId, double> noise_rad;
  if (!sigma_rad.is_none()) noise_rad = SigmasFrom("sigma_rad", sigma_rad, num_views);
  const auto options = OptionsFrom<KrotOptions>(given_options, threads);
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
  status, message        "converged"; "iteration_limit" (positions, but a wider bracket);
                         "contradiction" (positions, but most observations contradict the
                         rotations: they may be inverted or in other axes); "infeasible" (the
                         tracks do not determine positions); "solver_failed"; and a sentence
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
