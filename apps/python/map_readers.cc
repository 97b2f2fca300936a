#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "apps/python/problem.h"
#include "output/export/colmap_model.h"
#include "output/map/run_map.h"
#include "output/tables/pose_covariance_csv.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

template <class Value>
py::array_t<Value> RowOf(const std::vector<Value>& values) {
  return py::array_t<Value>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::array_t<bool> RowOf(const std::vector<bool>& values) {
  py::array_t<bool> array(static_cast<py::ssize_t>(values.size()));
  auto at = array.mutable_unchecked<1>();
  for (std::size_t k = 0; k < values.size(); ++k) at(static_cast<py::ssize_t>(k)) = values[k];
  return array;
}

py::array_t<double> PixelsOf(const std::vector<Eigen::Vector2d>& pixels) {
  py::array_t<double> array({static_cast<py::ssize_t>(pixels.size()), py::ssize_t{2}});
  auto at = array.mutable_unchecked<2>();
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    for (int axis = 0; axis < 2; ++axis) at(static_cast<py::ssize_t>(k), axis) = pixels[k][axis];
  }
  return array;
}

// Points and colours of tracks, in their order.
struct TrackArrays {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::uint8_t> rgb;

  void Add(const Track& track, const std::optional<Eigen::Vector3d>& point) {
    points.push_back(point.value_or(Eigen::Vector3d::Constant(kNotKnown)));
    rgb.insert(rgb.end(), track.rgb.begin(), track.rgb.end());
  }
  py::array_t<std::uint8_t> Colours() const {
    return RowOf(rgb).reshape({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  }
};

// Their observations, those of a track one after the other.
struct ObservationArrays {
  std::vector<int> view;
  std::vector<int> track;
  std::vector<Eigen::Vector2d> keypoints_px;
  std::vector<double> sigma_px;

  void Add(int view_number, int track_number, const Observation& observation) {
    view.push_back(view_number);
    track.push_back(track_number);
    keypoints_px.push_back(observation.keypoint_px);
    sigma_px.push_back(observation.sigma_px);
  }
};

// [n, 6, 6] by frame of the map, or None.
py::object PoseCovariances(const std::filesystem::path& table, const std::map<FrameId, int>& view) {
  if (!std::filesystem::exists(table)) return py::none();
  const auto num_views = static_cast<py::ssize_t>(view.size());
  py::array_t<double> covariances({num_views, py::ssize_t{6}, py::ssize_t{6}});
  auto at = covariances.mutable_unchecked<3>();
  std::fill_n(covariances.mutable_data(), covariances.size(), kNotKnown);
  for (const PoseCovarianceRow& row : ReadPoseCovarianceCsv(table)) {
    const auto known = view.find(FrameId{row.frame});
    if (known == view.end()) continue;
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 6; ++c) at(known->second, r, c) = row.covariance(r, c);
    }
  }
  return covariances;
}

py::dict EdgesOf(const RunMap& map, const std::map<FrameId, int>& view) {
  std::vector<int> i;
  std::vector<int> j;
  std::vector<int> num_inliers;
  std::vector<bool> rotation_only;
  for (const MapEdge& edge : map.edges) {
    i.push_back(view.at(edge.i));
    j.push_back(view.at(edge.j));
    num_inliers.push_back(edge.num_inliers);
    rotation_only.push_back(edge.rotation_only);
  }
  return py::dict("i"_a = RowOf(i),
                  "j"_a = RowOf(j),
                  "num_inliers"_a = RowOf(num_inliers),
                  "rotation_only"_a = RowOf(rotation_only));
}

py::dict ReadMap(const py::object& path) {
  std::filesystem::path file = PathOf(path);
  if (std::filesystem::is_directory(file)) file /= "map.bin";
  const RunMap map = ReadRunMap(file);
  std::map<FrameId, int> view;
  std::vector<int> frames;
  std::vector<double> timestamps;
  std::vector<std::string> names;
  std::vector<bool> is_keyframe;
  RotationMap cam_from_world;
  std::vector<Eigen::Vector3d> centers;
  for (const MapFrame& frame : map.frames) {
    const int number = view.emplace(frame.id, static_cast<int>(view.size())).first->second;
    frames.push_back(frame.id.value);
    timestamps.push_back(frame.timestamp_s);
    names.push_back(frame.image);
    is_keyframe.push_back(frame.is_keyframe);
    cam_from_world[FrameId{number}] = frame.cam_from_world;
    centers.push_back(frame.center_in_world);
  }
  std::vector<int> track_ids;
  TrackArrays tracks;
  ObservationArrays observations;
  std::vector<bool> fits;
  std::vector<std::uint8_t> levels;
  for (const MapTrack& entry : map.tracks) {
    const auto number = static_cast<int>(track_ids.size());
    track_ids.push_back(entry.track.id.value);
    tracks.Add(entry.track, entry.point_in_world);
    for (const Observation& observation : entry.track.observations) {
      observations.Add(view.at(observation.frame), number, observation);
    }
    fits.insert(fits.end(), entry.fits.begin(), entry.fits.end());
    levels.insert(levels.end(), entry.levels.begin(), entry.levels.end());
  }
  return py::dict(
      "camera"_a = map.camera,
      "image_folder"_a = map.image_folder,
      "is_video"_a = map.is_video,
      "frames"_a = RowOf(frames),
      "timestamps"_a = RowOf(timestamps),
      "names"_a = names,
      "is_keyframe"_a = RowOf(is_keyframe),
      "cam_from_world"_a = MatricesOf(cam_from_world, static_cast<int>(frames.size())),
      "centers"_a = PointsOf(centers),
      "pose_covariance"_a = PoseCovariances(file.parent_path() / "pose_covariance.csv", view),
      "track_ids"_a = RowOf(track_ids),
      "points"_a = PointsOf(tracks.points),
      "colours"_a = tracks.Colours(),
      "view"_a = RowOf(observations.view),
      "track"_a = RowOf(observations.track),
      "keypoints_px"_a = PixelsOf(observations.keypoints_px),
      "sigma_px"_a = RowOf(observations.sigma_px),
      "fits"_a = RowOf(fits),
      "level"_a = RowOf(levels),
      "level_scale"_a = map.level_scale,
      "edges"_a = EdgesOf(map, view));
}

py::dict ReadModel(const py::object& path) {
  const ColmapModel model = ReadColmapModel(PathOf(path));
  const Reconstruction& reconstruction = model.reconstruction;
  std::map<FrameId, int> view;
  std::vector<std::int64_t> image_ids;
  std::vector<std::int64_t> camera_ids;
  std::vector<std::string> names;
  RotationMap cam_from_world;
  CenterMap center_in_world;
  py::list image_keypoints_px;
  for (const auto& [id, image] : model.images) {
    const FrameId number{static_cast<int>(view.size())};
    view[id] = number.value;
    image_ids.push_back(id.value);
    camera_ids.push_back(image.camera);
    names.push_back(model.image_name.at(id));
    cam_from_world[number] = reconstruction.cam_from_world.at(id);
    center_in_world[number] = reconstruction.center_in_world.at(id);
    image_keypoints_px.append(PixelsOf(image.keypoints_px));
  }
  std::vector<std::uint64_t> point_ids;
  TrackArrays tracks;
  ObservationArrays observations;
  std::vector<int> keypoint;
  for (const Track& track : reconstruction.tracks) {
    const auto number = static_cast<int>(point_ids.size());
    point_ids.push_back(model.point_id.at(track.id));
    const auto point = reconstruction.point_in_world.find(track.id);
    tracks.Add(
        track,
        point == reconstruction.point_in_world.end() ? std::nullopt : std::optional(point->second));
    for (const Observation& observation : track.observations) {
      observations.Add(view.at(observation.frame), number, observation);
    }
    const std::vector<int>& places = model.keypoints.at(track.id);
    keypoint.insert(keypoint.end(), places.begin(), places.end());
  }
  const auto num_views = static_cast<int>(image_ids.size());
  return py::dict("cameras"_a = model.cameras,
                  "camera"_a = model.camera,
                  "image_ids"_a = RowOf(image_ids),
                  "camera_ids"_a = RowOf(camera_ids),
                  "names"_a = names,
                  "cam_from_world"_a = MatricesOf(cam_from_world, num_views),
                  "centers"_a = PointsOf(CentersOf(center_in_world, num_views)),
                  "image_keypoints_px"_a = image_keypoints_px,
                  "point_ids"_a = RowOf(point_ids),
                  "points"_a = PointsOf(tracks.points),
                  "colours"_a = tracks.Colours(),
                  "view"_a = RowOf(observations.view),
                  "track"_a = RowOf(observations.track),
                  "keypoint"_a = RowOf(keypoint),
                  "keypoints_px"_a = PixelsOf(observations.keypoints_px),
                  "sigma_px"_a = RowOf(observations.sigma_px),
                  "num_doubled"_a = model.num_doubled);
}

}  // namespace

void AddMapReaders(py::module_& module) {
  module.def("read_run_map",
             &ReadMap,
             "path"_a,
             R"(The map that `rotslam run` or `solve` has left: its folder, or the map.bin in it.

Returns a dict; n frames, t tracks, m observations, e edges of the view-graph:
  camera            as bundle adjustment has refined it
  image_folder      of the images; for a video, with is_video True, the file
  frames            [n], their ids, ascending: the place of each in the sequence
  timestamps, names [n] seconds, and n file names below image_folder
  is_keyframe       [n], bool
  cam_from_world    [n, 3, 3], world->camera
  centers           [n, 3], in the world frame
  pose_covariance   [n, 6, 6] of (rotation in rad about the camera's axes, centre in the world),
                    NaN where not known: pose_covariance.csv beside the map; None where that is not
  track_ids         [t], ascending
  points, colours   [t, 3] in the world frame, NaN for a track without a point; uint8 red green blue
  view, track       [m]: observation k is of track track_ids[track[k]] in frame frames[view[k]]
  keypoints_px      [m, 2], where the distorted image shows it; sigma_px [m]: standard deviations
  fits              [m], bool: the point explains it; False without a point
  level             [m], pyramid level that shows it, each level_scale coarser than the one before
  edges             dict of i, j (places in frames), num_inliers [e], rotation_only [e]
view, track, keypoints_px, sigma_px, cam_from_world and centers are as refine_bundle takes them.
Raises RuntimeError with file and reason. C++: output/map/run_map.h,
output/tables/pose_covariance_csv.h.)");
  module.def("read_colmap_model",
             &ReadModel,
             "path"_a,
             R"(A COLMAP model, .bin or .txt, with all that is in it.

Returns a dict; n images, p points, m observations:
  cameras             {camera id: Camera}, each with its lens
  camera              the camera of all images; of several, one without distortion
  image_ids, names    [n], ascending, and n file names
  camera_ids          [n], keys of cameras
  cam_from_world      [n, 3, 3], world->camera
  centers             [n, 3], in the world frame
  image_keypoints_px  n arrays [k, 2] of all keypoints, with COLMAP's pixel centres at one half
  point_ids           [p], uint64
  points, colours     [p, 3] in the world frame; uint8 red green blue
  view, track         [m]: observation k is of point point_ids[track[k]] in image image_ids[view[k]]
  keypoint            [m], its place in that image's keypoints
  keypoints_px        [m, 2] in `camera`, pixel centres at integer coordinates; sigma_px [m]: what a
                      pixel of the image is there
  num_doubled         observations left out: the second one of a point in an image
view, track, keypoints_px, sigma_px, cam_from_world, centers and camera are as refine_bundle takes
them. Raises RuntimeError with file and reason. C++: output/export/colmap_model.h.)");
}

}  // namespace rotslam
