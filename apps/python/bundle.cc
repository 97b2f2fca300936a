#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/options.h"
#include "apps/python/problem.h"
#include "ba/bundle_adjustment.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

// The centres that are finite.
CenterMap CentersFrom(const py::object& object, int num_views) {
  const DoubleArray centers =
      Numbers("centers", "an array of numbers [n, 3], n views", object, {num_views, 3});
  const auto at = centers.unchecked<2>();
  CenterMap center_in_world;
  for (int k = 0; k < num_views; ++k) {
    const Eigen::Vector3d center(at(k, 0), at(k, 1), at(k, 2));
    if (center.allFinite()) center_in_world[FrameId{k}] = center;
  }
  return center_in_world;
}

py::dict Describe(const BundleResult& result, int num_views) {
  std::vector<int> point_ids;
  std::vector<Eigen::Vector3d> points;
  for (const auto& [id, point] : result.reconstruction.point_in_world) {
    point_ids.push_back(id.value);
    points.push_back(point);
  }
  std::vector<int> view;
  std::vector<int> track;
  for (const Track& one : result.reconstruction.tracks) {
    for (const Observation& observation : one.observations) {
      view.push_back(observation.frame.value);
      track.push_back(one.id.value);
    }
  }
  const auto ints = [](const std::vector<int>& values) {
    return py::array_t<int>(static_cast<py::ssize_t>(values.size()), values.data());
  };
  py::dict covariance;
  for (const auto& [frame, matrix] : result.pose_covariance) {
    covariance[py::int_(frame.value)] = ArrayOf(matrix);
  }
  const ResidualStatistics& after = result.summary.after;
  return py::dict(
      "status"_a = Name(result.status),
      "message"_a = result.message,
      "is_usable"_a = result.Usable(),
      "cam_from_world"_a = MatricesOf(result.reconstruction.cam_from_world, num_views),
      "centers"_a = PointsOf(CentersOf(result.reconstruction.center_in_world, num_views)),
      "point_ids"_a = ints(point_ids),
      "points"_a = PointsOf(points),
      "view"_a = ints(view),
      "track"_a = ints(track),
      "camera"_a = result.camera,
      "pose_covariance"_a = covariance,
      "initial_cost"_a = result.summary.initial_cost,
      "final_cost"_a = result.summary.final_cost,
      "iterations"_a = result.summary.iterations,
      "median_px"_a = after.median_px,
      "rms_px"_a = after.rms_px);
}

// Twelve parameters: the keyword arguments of rotslam.refine_bundle.
py::dict Refine(const py::object& cam_from_world,
                const py::object& centers,
                const py::object& view,
                const py::object& track,
                const py::object& keypoints_px,
                const Camera& camera,
                const py::object& given_options,
                const py::object& sigma_px,
                const py::object& rotation_sigma_rad,
                const std::map<int, int>& shared_center,
                const std::set<int>& fixed_views,
                int threads) {
  BundleProblem problem;
  problem.camera = camera;
  problem.start.cam_from_world = RotationsFrom("cam_from_world", cam_from_world);
  const auto num_views = static_cast<int>(problem.start.cam_from_world.size());
  problem.start.center_in_world = CentersFrom(centers, num_views);
  problem.start.tracks = TracksFrom(view, track, keypoints_px, sigma_px, camera);
  if (!rotation_sigma_rad.is_none()) {
    problem.rotation_sigma_rad = SigmasFrom("rotation_sigma_rad", rotation_sigma_rad, num_views);
    std::erase_if(problem.rotation_sigma_rad,
                  [](const auto& entry) { return entry.second != entry.second; });
  }
  for (const auto& [one, other] : shared_center) {
    problem.shared_center[FrameId{one}] = FrameId{other};
  }
  for (const int fixed : fixed_views) problem.fixed_frames.insert(FrameId{fixed});
  const auto options = OptionsFrom<BundleOptions>(given_options, threads);
  BundleResult result;
  {
    const py::gil_scoped_release unlocked;
    result = RefineBundle(problem, options);
  }
  return Describe(result, num_views);
}

}  // namespace

void AddBundle(py::module_& module) {
  module.def("refine_bundle",
             &Refine,
             "cam_from_world"_a,
             "centers"_a,
             "view"_a,
             "track"_a,
             "keypoints_px"_a,
             "camera"_a,
             "options"_a = py::none(),
             "sigma_px"_a = py::none(),
             "rotation_sigma_rad"_a = py::none(),
             "shared_center"_a = std::map<int, int>(),
             "fixed_views"_a = std::set<int>(),
             "threads"_a = 1,
             R"(Bundle adjustment: rotations, centres, points and, if asked for, the lens.

cam_from_world: [n, 3, 3], world->camera, a start.
centers:        [n, 3], in the world frame, a start; NaN for views that are left out.
view, track, keypoints_px, sigma_px: m observations, as solve_known_rotation takes them.
options:        dict, the group `ba` in summary.json, for example {"find_covariance": True}.
rotation_sigma_rad: [n], deviations about each axis of orientations that are measurements; they are
                refined against these. NaN: not measured. None: none is.
shared_center:  {view: view}, views that stand at the place of another, as in a pure rotation.
fixed_views:    set of views whose pose stays; empty: the first one's does, and the scale.

Returns a dict:
  status, message, is_usable  "converged", "iteration limit" ... and a sentence for people
  cam_from_world [n, 3, 3], centers [n, 3]   NaN for views without good observations
  point_ids [p], points [p, 3]               in the world frame
  view, track    the observations that fit
  camera         with its lens refined, where options ask for it
  pose_covariance  {view: [6, 6]}, of (rotation rad, centre), with find_covariance
  initial_cost, final_cost, iterations, median_px, rms_px
Other Python threads run meanwhile. Raises ValueError for wrong arrays or options. C++:
ba/bundle_adjustment.h.)");
}

}  // namespace rotslam
