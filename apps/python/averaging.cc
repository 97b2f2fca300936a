#include <algorithm>
#include <limits>
#include <map>
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
#include "rotodom/averaging/certificate.h"
#include "rotodom/averaging/global_averaging.h"
#include "rotodom/averaging/support/orientation_deviations.h"
#include "rotodom/averaging/support/view_support.h"
#include "rotodom/sensor_orientations/sensor_orientations.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

template <class Value>
py::array_t<Value> ListOf(const std::vector<Value>& values) {
  return py::array_t<Value>(static_cast<py::ssize_t>(values.size()), values.data());
}

// Edges from arrays of m entries each.
std::vector<RelativeRotation> EdgesFrom(const py::object& i,
                                        const py::object& j,
                                        const py::object& j_from_i) {
  const std::vector<int> from = Indices("i", i);
  const std::vector<int> to = Indices("j", j);
  const RotationMap rotations = RotationsFrom("j_from_i", j_from_i);
  if (from.size() != to.size() || from.size() != rotations.size()) {
    throw std::invalid_argument("i, j and j_from_i must be as long as one another, found " +
                                std::to_string(from.size()) + ", " + std::to_string(to.size()) +
                                " and " + std::to_string(rotations.size()));
  }
  std::vector<RelativeRotation> edges(from.size());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    edges[k].i = FrameId{from[k]};
    edges[k].j = FrameId{to[k]};
    edges[k].j_from_i = rotations.at(FrameId{static_cast<int>(k)});
  }
  return edges;
}

// A deviation for all or each, or a covariance for each.
void SetCovariances(const py::object& sigma_rad,
                    const py::object& covariance,
                    std::vector<RelativeRotation>& edges) {
  const auto count = static_cast<py::ssize_t>(edges.size());
  if (!covariance.is_none()) {
    const DoubleArray values =
        Numbers("covariance", "an array of numbers [m, 3, 3], m edges", covariance, {count, 3, 3});
    const auto at = values.unchecked<3>();
    for (py::ssize_t k = 0; k < count; ++k) {
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
          edges[static_cast<std::size_t>(k)].covariance(a, b) = at(k, a, b);
        }
      }
    }
    return;
  }
  const bool is_one = py::isinstance<py::float_>(sigma_rad) || py::isinstance<py::int_>(sigma_rad);
  const auto sigmas = is_one ? std::map<FrameId, double>()
                             : SigmasFrom("sigma_rad", sigma_rad, static_cast<int>(count));
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const double sigma =
        is_one ? sigma_rad.cast<double>() : sigmas.at(FrameId{static_cast<int>(k)});
    if (!(sigma > 0.0)) throw std::invalid_argument("sigma_rad must be positive");
    edges[k].covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  }
}

int NumViews(const std::vector<RelativeRotation>& edges) {
  int num_views = 0;
  for (const RelativeRotation& edge : edges) {
    num_views = std::max({num_views, edge.i.value + 1, edge.j.value + 1});
  }
  return num_views;
}

// How well the inliers hold each view: `support` [n] and `covariance` [n, 3, 3].
std::pair<py::array_t<int>, DoubleArray> JudgeViews(std::vector<RelativeRotation> edges,
                                                    const GlobalAveragingOptions& options,
                                                    const GlobalAveragingResult& result,
                                                    int num_views) {
  std::vector<char> is_inlier(edges.size(), 0);
  std::vector<double> weights(edges.size(), 0.0);
  for (std::size_t k = 0; k < edges.size(); ++k) {
    edges[k].covariance = ErrorCovariance(edges[k], options);
    is_inlier[k] = result.sigmas[k] <= options.loss_sigmas ? 1 : 0;
    weights[k] = is_inlier[k];
  }
  std::vector<int> support(static_cast<std::size_t>(num_views), 0);
  for (const auto& [view, number] : SupportOfViews(edges, is_inlier, {})) {
    support[static_cast<std::size_t>(view.value)] = number;
  }
  DoubleArray covariance({num_views, 3, 3});
  std::fill_n(
      covariance.mutable_data(), covariance.size(), std::numeric_limits<double>::quiet_NaN());
  auto at = covariance.mutable_unchecked<3>();
  for (const auto& [view, matrix] :
       DeviationsOfViews(edges, weights, result.cam_from_world, {}).covariance) {
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) at(view.value, a, b) = matrix(a, b);
    }
  }
  return {ListOf(support), covariance};
}

// Eight parameters: the keyword arguments of rotslam.average_rotations.
py::dict Average(const py::object& i,
                 const py::object& j,
                 const py::object& j_from_i,
                 const py::object& sigma_rad,
                 const py::object& covariance,
                 const py::object& start,
                 const py::object& given_options,
                 int threads) {
  std::vector<RelativeRotation> edges = EdgesFrom(i, j, j_from_i);
  SetCovariances(sigma_rad, covariance, edges);
  const auto options = OptionsFrom<GlobalAveragingOptions>(given_options);
  CheckThreads(threads);
  GlobalAveragingProblem problem;
  problem.edges = edges;
  problem.use_start = !start.is_none();
  int num_views = NumViews(edges);
  if (problem.use_start) {
    problem.cam_from_world = RotationsFrom("start", start);
    num_views = std::max(num_views, static_cast<int>(problem.cam_from_world.size()));
  }
  GlobalAveragingResult result;
  {
    const py::gil_scoped_release unlocked;
    result = AverageGlobally(problem, options, threads);
  }
  std::vector<int> component(static_cast<std::size_t>(num_views), -1);
  for (const auto& [view, number] : result.component) {
    component[static_cast<std::size_t>(view.value)] = number;
  }
  const auto [support, deviations] = JudgeViews(edges, options, result, num_views);
  return py::dict("cam_from_world"_a = MatricesOf(result.cam_from_world, num_views),
                  "component"_a = ListOf(component),
                  "support"_a = support,
                  "covariance"_a = deviations,
                  "angle_rad"_a = ListOf(result.angle_rad),
                  "sigmas"_a = ListOf(result.sigmas),
                  "cost"_a = result.cost,
                  "num_inliers"_a = result.num_inliers,
                  "iterations"_a = result.iterations,
                  "has_converged"_a = result.has_converged);
}

// The keyword arguments of rotslam.certify_rotations.
py::dict Certify(const py::object& i,
                 const py::object& j,
                 const py::object& j_from_i,
                 const py::object& weights,
                 const py::object& cam_from_world) {
  const std::vector<RelativeRotation> edges = EdgesFrom(i, j, j_from_i);
  std::vector<double> by_edge;
  by_edge.reserve(edges.size());
  for (const auto& [edge, weight] :
       SigmasFrom("weights", weights, static_cast<int>(edges.size()))) {
    by_edge.push_back(weight);
  }
  const RotationMap rotations = RotationsFrom("cam_from_world", cam_from_world);
  AveragingCertificate certificate;
  {
    const py::gil_scoped_release unlocked;
    certificate = CertifyAveraging(edges, by_edge, rotations);
  }
  const int num_views = static_cast<int>(rotations.size());
  return py::dict("cam_from_world"_a = MatricesOf(certificate.cam_from_world, num_views),
                  "cost"_a = certificate.cost,
                  "cost_bound"_a = certificate.cost_bound,
                  "relative_gap"_a = certificate.RelativeGap(),
                  "smallest_eigenvalue"_a = certificate.smallest_eigenvalue,
                  "gradient"_a = certificate.gradient);
}

const char* NameOf(OrientationSource source) {
  switch (source) {
    case OrientationSource::kImages:
      return "images";
    case OrientationSource::kSensor:
      return "sensor";
    case OrientationSource::kBoth:
      return "both";
    case OrientationSource::kNothing:
      return "nothing";
  }
  return "";
}

// The keyword arguments of rotslam.fuse_orientations.
py::object Fuse(const py::object& timestamps_s,
                const py::object& cam_from_world,
                const py::object& step_sigma_rad,
                const py::object& given,
                const py::object& given_options) {
  ImageOrientations images;
  for (const auto& [frame, rotation] : RotationsFrom("cam_from_world", cam_from_world)) {
    images.cam_from_world.push_back(rotation);
  }
  const auto num_frames = static_cast<int>(images.cam_from_world.size());
  for (const auto& [frame, time_s] : SigmasFrom("timestamps", timestamps_s, num_frames)) {
    images.timestamps_s.push_back(time_s);
  }
  for (const auto& [frame, sigma] :
       SigmasFrom("step_sigma_rad", step_sigma_rad, std::max(num_frames - 1, 0))) {
    images.step_variance.push_back(sigma * sigma);
  }
  const std::vector<StampedRotation> rotations = OrientationsFrom(given);
  const auto options = OptionsFrom<SensorFusionOptions>(given_options);
  std::optional<SensorFusion> fusion;
  {
    const py::gil_scoped_release unlocked;
    fusion = FuseOrientations(images, rotations, options);
  }
  if (!fusion) return py::none();
  RotationMap fused;
  py::list sources;
  for (int k = 0; k < num_frames; ++k) {
    fused[FrameId{k}] = fusion->cam_from_world[static_cast<std::size_t>(k)];
    sources.append(NameOf(fusion->source[static_cast<std::size_t>(k)]));
  }
  const SensorAlignment& alignment = fusion->alignment;
  return py::dict("cam_from_world"_a = MatricesOf(fused, num_frames),
                  "variance"_a = ListOf(fusion->variance),
                  "source"_a = sources,
                  "offset_s"_a = alignment.offset_s,
                  "offset_sigma_s"_a = alignment.offset_sigma_s,
                  "has_offset"_a = alignment.has_offset,
                  "cam_from_sensor"_a = ArrayOf(alignment.cam_from_sensor.Matrix()),
                  "mounting_covariance"_a = ArrayOf(alignment.mounting_covariance),
                  "has_mounting"_a = alignment.has_mounting,
                  "disagreement_rad"_a = fusion->disagreement_rad,
                  "aligned_disagreement_rad"_a = fusion->aligned_disagreement_rad,
                  "sigma_rad"_a = fusion->sigma_rad,
                  "drift_rad"_a = fusion->drift_rad,
                  "num_outliers"_a = fusion->num_outliers);
}

}  // namespace

// A table: one entry for each function.
void AddAveraging(py::module_& module) {
  module.def("average_rotations",
             &Average,
             "i"_a,
             "j"_a,
             "j_from_i"_a,
             "sigma_rad"_a = kRadFromDeg,
             "covariance"_a = py::none(),
             "start"_a = py::none(),
             "options"_a = py::none(),
             "threads"_a = 1,
             R"(Orientations that agree best with relative rotations, wrong ones among them.

i, j:       [m] integers, the views of the edges, numbered from 0.
j_from_i:   [m, 3, 3], x_j = R x_i.
sigma_rad:  standard deviation of an edge about each axis, rad: a number or [m].
covariance: [m, 3, 3], rad^2, of the error delta in Exp(delta) j_from_i; None: by sigma_rad.
start:      [n, 3, 3], cam_from_world; None: along a tree that cycles confirm.
options:    dict, for example {"loss_sigmas": 6.0}: edge_floor_deg, error_factor, loss_sigmas,
            trust_sigmas, drift_factor, loss_decay, l1_iterations, min_step_deg, max_iterations,
            seed.

Returns a dict:
  cam_from_world   [n, 3, 3], world->camera; NaN for numbers that no edge names
  component        [n], pieces that no edge connects; -1 for those
  support          [n], inliers that hold a view; 1: its orientation hangs on one edge
  covariance       [n, 3, 3], rad^2, of the error delta in Exp(delta) cam_from_world, against the
                   mean of the component's views; NaN where no inlier holds a view
  angle_rad        [m], between measured and averaged
  sigmas           [m], the same in standard deviations, a norm over three axes
  cost, num_inliers, iterations, has_converged
Other Python threads run meanwhile. Raises ValueError for wrong arrays or options. C++:
rotodom/averaging/global_averaging.h.)");
  module.def("certify_rotations",
             &Certify,
             "i"_a,
             "j"_a,
             "j_from_i"_a,
             "weights"_a,
             "cam_from_world"_a,
             R"(How far orientations are from the best of all, by the chordal cost.

That is the sum over the edges of weight |R_j - R_j_i R_i|^2 (Frobenius).
i, j, j_from_i: as average_rotations takes them, m edges.
weights:        [m], zero or more; zero leaves an edge out.
cam_from_world: [n, 3, 3], world->camera.

Returns a dict:
  cam_from_world       [n, 3, 3], refined to a stationary point of this cost
  cost, cost_bound     of these, and a lower bound of that of any orientations
  relative_gap         (cost - cost_bound) / cost
  smallest_eigenvalue  of the dual matrix, a lower bound; zero where the orientations are optimal
  gradient             of the cost, largest of a view, relative to the view's weights
C++: rotodom/averaging/certificate.h.)");
  module.def("fuse_orientations",
             &Fuse,
             "timestamps"_a,
             "cam_from_world"_a,
             "step_sigma_rad"_a,
             "given"_a,
             "options"_a = py::none(),
             R"(Orientations of images and of a sensor together: a gimbal, an IMU, motion capture.

timestamps:     [n], seconds, ascending, of the frames.
cam_from_world: [n, 3, 3], world->camera, by the images.
step_sigma_rad: [n - 1], standard deviations about an axis of the rotation from each frame to the
                next; infinite where the images do not connect the two.
given:          a file as `rotslam run --rotations` reads it, or [k, 5] rows (timestamp qx qy qz
                qw, camera->world).
options:        dict: use_alignment (take offset and mounting out), max_offset_s, max_gap_s.

Returns None where fewer than three of the given orientations fall between frames, else a dict:
  cam_from_world       [n, 3, 3], in the sensor's world
  variance             [n], about an axis, rad^2
  source               [n], "images", "sensor", "both" or "nothing"
  offset_s             the sensor is late by this; offset_sigma_s its deviation
  cam_from_sensor      [3, 3]; mounting_covariance [3, 3], rad^2, about the camera's axes
  has_offset, has_mounting   whether they are more than chance
  disagreement_rad     median from frame to frame, as given; aligned_disagreement_rad: aligned
  sigma_rad, drift_rad noise of a given orientation, and drift from frame to frame
  num_outliers         given orientations that stand alone against those beside them
Raises ValueError for wrong arrays or options. C++:
rotodom/sensor_orientations/sensor_orientations.h.)");
}

}  // namespace rotslam
