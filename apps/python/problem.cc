#include "apps/python/problem.h"

#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "apps/python/arrays.h"
#include "output/trajectory/orientation_file.h"

namespace py = pybind11;

namespace rotslam {
namespace {

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

}  // namespace

RotationMap RotationsFrom(const char* name, const py::object& object) {
  const DoubleArray matrices = Numbers(name, "an array of numbers [n, 3, 3]", object, {-1, 3, 3});
  RotationMap rotations;
  const auto at = matrices.unchecked<3>();
  for (py::ssize_t k = 0; k < at.shape(0); ++k) {
    Eigen::Matrix3d R;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = at(k, i, j);
    }
    try {
      rotations[FrameId{static_cast<int>(k)}] = Rotation::FromMatrix(R);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string(name) + "[" + std::to_string(k) +
                                  "]: " + error.what());
    }
  }
  return rotations;
}

py::array MatricesOf(const RotationMap& cam_from_world, int num_views) {
  py::array_t<double> matrices({py::ssize_t{num_views}, py::ssize_t{3}, py::ssize_t{3}});
  auto at = matrices.mutable_unchecked<3>();
  for (int k = 0; k < num_views; ++k) {
    const auto known = cam_from_world.find(FrameId{k});
    const Eigen::Matrix3d R = known == cam_from_world.end()
                                  ? Eigen::Matrix3d(Eigen::Matrix3d::Constant(kMissing))
                                  : known->second.Matrix();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) at(k, i, j) = R(i, j);
    }
  }
  return matrices;
}

std::vector<Track> TracksFrom(const py::object& view_object,
                              const py::object& track_object,
                              const py::object& keypoints_px,
                              const py::object& sigma_object,
                              const Camera& camera) {
  const std::vector<int> view = Indices("view", view_object);
  const std::vector<int> track = Indices("track", track_object);
  const auto count = static_cast<py::ssize_t>(view.size());
  if (track.size() != view.size()) {
    throw std::invalid_argument("track must be as long as view, " + std::to_string(view.size()) +
                                ", found " + std::to_string(track.size()));
  }
  const DoubleArray pixels =
      Numbers("keypoints_px", "an array of numbers [m, 2], m as in view", keypoints_px, {count, 2});
  std::optional<DoubleArray> sigma_px;
  if (!sigma_object.is_none()) {
    sigma_px = Numbers("sigma_px", "an array of numbers [m], m as in view", sigma_object, {count});
  }
  const auto at = pixels.unchecked<2>();
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

std::map<FrameId, double> SigmasFrom(const char* name, const py::object& sigmas, int num_views) {
  const std::string expected = "an array of " + std::to_string(num_views) + " numbers";
  const DoubleArray values = Numbers(name, expected.c_str(), sigmas, {py::ssize_t{num_views}});
  std::map<FrameId, double> by_view;
  for (int k = 0; k < num_views; ++k) by_view[FrameId{k}] = values.at(k);
  return by_view;
}

std::vector<StampedRotation> OrientationsFrom(const py::object& given) {
  if (py::isinstance<py::str>(given) || py::hasattr(given, "__fspath__")) {
    return ReadOrientations(PathOf(given));
  }
  const DoubleArray rows = Numbers("given",
                                   "a file or an array of numbers [k, 5], k lines of (timestamp "
                                   "qx qy qz qw)",
                                   given,
                                   {-1, 5});
  std::vector<StampedRotation> rotations;
  const auto at = rows.unchecked<2>();
  for (py::ssize_t k = 0; k < at.shape(0); ++k) {
    if (k > 0 && !(at(k, 0) > at(k - 1, 0))) {
      throw std::invalid_argument("given: timestamps must ascend, row " + std::to_string(k) +
                                  " does not");
    }
    const Eigen::Quaterniond q(at(k, 4), at(k, 1), at(k, 2), at(k, 3));
    rotations.push_back({at(k, 0), Rotation(q), std::nullopt});
  }
  return rotations;
}

std::vector<Eigen::Vector3d> CentersOf(const CenterMap& center_in_world, int num_views) {
  std::vector<Eigen::Vector3d> centers(static_cast<std::size_t>(num_views),
                                       Eigen::Vector3d::Constant(kMissing));
  for (const auto& [view, center] : center_in_world) {
    centers[static_cast<std::size_t>(view.value)] = center;
  }
  return centers;
}

}  // namespace rotslam
