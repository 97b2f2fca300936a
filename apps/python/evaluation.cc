#include "apps/cli/input/evaluation.h"

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "output/trajectory/trajectory.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

NamedTrajectory TrajectoryFrom(const char* argument,
                               const py::object& object,
                               const std::optional<std::filesystem::path>& times) {
  if (py::isinstance<py::str>(object) || py::hasattr(object, "__fspath__")) {
    const std::string path = PathOf(object);
    return {ReadTrajectoryFile(path, times), path};
  }
  const DoubleArray rows = Numbers(argument,
                                   "a file or an array of numbers [n, 8], n lines of a TUM "
                                   "trajectory (timestamp tx ty tz qx qy qz qw)",
                                   object,
                                   {-1, 8});
  NamedTrajectory result{{{}, "array", {}, true, false}, argument};
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
    result.file.poses.push_back(pose);
  }
  return result;
}

// Nine parameters: the keyword arguments of rotslam.evaluate.
py::object EvaluateTrajectory(const py::object& ground_truth,
                              const py::object& estimate,
                              const py::object& times,
                              double max_gap_s,
                              int images,
                              int threads,
                              bool align_axes,
                              bool as_is,
                              double time_offset_s) {
  MatchOptions options;
  options.metrics.max_gap_s = max_gap_s;
  options.metrics.num_threads = threads;
  options.align_axes = align_axes;
  options.as_is = as_is;
  options.time_offset_s = time_offset_s;
  if (const auto problem = options.metrics.Problem()) throw std::invalid_argument(*problem);
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
    metrics = MetricsJson(CompareTrajectories(truth, found, options), images)
                  .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  }
  return py::module_::import("json").attr("loads")(metrics);
}

}  // namespace

void AddEvaluation(py::module_& module) {
  module.def("evaluate",
             &EvaluateTrajectory,
             "ground_truth"_a,
             "estimate"_a,
             "times"_a = py::none(),
             "max_gap_s"_a = MetricsOptions{}.max_gap_s,
             "images"_a = 0,
             "threads"_a = 1,
             "align_axes"_a = false,
             "as_is"_a = false,
             "time_offset_s"_a = 0.0,
             R"(How far a trajectory is from the truth: the numbers of `rotslam eval --json`.

ground_truth, estimate: files as `rotslam eval` reads them (TUM, KITTI, EuRoC, ...), or [n, 8] arrays with the columns of TUM (timestamp
                        tx ty tz qx qy qz qw, camera->world), timestamps ascending.
times:     file with timestamps of files that have none.
max_gap_s: largest gap in the ground truth to interpolate over.
images:    images of the sequence, for the coverage; 0: no coverage.
align_axes: take out a constant rotation between the axes of the two.
as_is:     take both as they stand, even if one fits far better as world->camera or with qw first.
time_offset_s: added to the times of the estimate.
Returns a dict: n, images, coverage, rpe1, rpe1_median, rpe1_p90, rpe1_max, rpen (deg), r_err (deg
per 100 m), ate, scale, path_length; None where a number is not defined; notes, a list of lines, where something was assumed. Raises RuntimeError where
files cannot be read or fewer than three poses have ground truth. C++: output/metrics.h.)");
}

}  // namespace rotslam
