// Formats for other programs, read back.

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/export/lens_fit.h"
#include "output/export/nerf.h"
#include "output/export/openmvg.h"
#include "output/export/scene_box.h"
#include "output/map/map_keypoints.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/types/text_file.h"
#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

nlohmann::json ReadJson(const fs::path& path) { return nlohmann::json::parse(ReadWholeFile(path)); }

Eigen::Matrix4d MatrixOf(const nlohmann::json& rows) {
  Eigen::Matrix4d matrix;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) matrix(row, column) = rows[row][column];
  }
  return matrix;
}

TEST(NerfTransforms, ShowThePointsWhereTheImagesDo) {
  const TemporaryFolder folder;
  const RunMap map = MapOfScene(ExportScene());
  WriteNerfTransforms(folder.path() / "transforms.json", map, folder.path() / "pictures" / "left");
  const nlohmann::json json = ReadJson(folder.path() / "transforms.json");
  EXPECT_EQ(json["camera_model"], "OPENCV");
  EXPECT_EQ(json["w"], map.camera.width);
  EXPECT_EQ(json["h"], map.camera.height);
  for (const char* key : {"k1", "k2", "p1", "p2"}) EXPECT_EQ(json[key], 0.0);
  ASSERT_EQ(json["frames"].size(), map.frames.size());
  for (std::size_t k = 0; k < map.frames.size(); ++k) {
    const MapFrame& frame = map.frames[k];
    EXPECT_EQ(json["frames"][k]["file_path"], "pictures/left/" + frame.image);
    const Eigen::Matrix4d world_from_gl = MatrixOf(json["frames"][k]["transform_matrix"]);
    EXPECT_EQ((world_from_gl.topRightCorner<3, 1>()), frame.center_in_world);
    for (const MapTrack& entry : map.tracks) {
      if (!entry.point_in_world) continue;
      // OpenGL looks along -z, its y goes up; pixels count from the image's corner.
      const Eigen::Vector3d in_gl =
          (world_from_gl.inverse() * entry.point_in_world->homogeneous()).head<3>();
      const double u =
          json["fl_x"].get<double>() * in_gl.x() / -in_gl.z() + json["cx"].get<double>();
      const double v =
          json["fl_y"].get<double>() * -in_gl.y() / -in_gl.z() + json["cy"].get<double>();
      const auto pixel = map.camera.Project(frame.cam_from_world *
                                            (*entry.point_in_world - frame.center_in_world));
      ASSERT_TRUE(pixel.has_value());
      EXPECT_NEAR(u - 0.5, pixel->x(), 1e-8);
      EXPECT_NEAR(v - 0.5, pixel->y(), 1e-8);
    }
  }
}

// As instant-ngp reads a lens (nerf_loader.cu, read_lens): four numbers, the last key given wins.
std::array<double, 4> LensOfInstantNgp(const nlohmann::json& json) {
  std::array<double, 4> parameters = {};
  const std::vector<std::pair<const char*, int>> keys = {
      {"k1", 0}, {"k2", 1}, {"k3", 2}, {"k4", 3}, {"p1", 2}, {"p2", 3}};
  for (const auto& [key, position] : keys) {
    if (json.contains(key)) parameters[position] = json[key];
  }
  return parameters;
}

// The camera that a reader gets from a file.
Camera CameraOfReader(const nlohmann::json& json, bool is_instant_ngp) {
  Camera camera;
  camera.width = json["w"];
  camera.height = json["h"];
  camera.fx = json["fl_x"];
  camera.fy = json["fl_y"];
  camera.cx = json["cx"].get<double>() - 0.5;
  camera.cy = json["cy"].get<double>() - 0.5;
  const bool is_fisheye = json["is_fisheye"];
  EXPECT_EQ(json["camera_model"], is_fisheye ? "OPENCV_FISHEYE" : "OPENCV");
  camera.model = is_fisheye ? CameraModel::kEquidistant : CameraModel::kRadtan;
  if (is_instant_ngp) {
    const std::array<double, 4> parameters = LensOfInstantNgp(json);
    std::copy(parameters.begin(), parameters.end(), camera.distortion.begin());
    return camera;
  }
  const auto number = [&](const char* key) { return json.value(key, 0.0); };
  if (is_fisheye) {
    camera.distortion = {number("k1"), number("k2"), number("k3"), number("k4")};
  } else {
    EXPECT_EQ(number("k4"), 0.0);  // nerfstudio refuses to undistort such images
    camera.distortion = {number("k1"), number("k2"), number("p1"), number("p2"), number("k3")};
  }
  return camera;
}

// The largest distance between what two cameras make of a pixel's ray, over the image.
double LargestDistancePx(const Camera& a, const Camera& b) {
  double largest = 0.0;
  for (int x = 0; x <= a.width; x += a.width / 20) {
    for (int y = 0; y <= a.height; y += a.height / 20) {
      const Eigen::Vector2d pixel(std::min(x, a.width - 1), std::min(y, a.height - 1));
      const auto bearing = a.Unproject(pixel);
      if (!bearing) continue;
      const auto other = b.Project(*bearing);
      largest = std::max(largest, other ? (*other - pixel).norm() : 1e9);
    }
  }
  return largest;
}

struct LensCase {
  CameraModel model;
  std::array<double, 8> distortion;
  double both_px;        // what a file for both readers may leave, at most
  double nerfstudio_px;  // and one for nerfstudio
  bool is_refitted;      // for both
};

TEST(NerfTransforms, EveryReaderGetsTheLens) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "transforms.json";
  RunMap map = MapOfScene(ExportScene());
  map.camera.fx = 1000.0;
  map.camera.fy = 1010.0;
  const std::vector<LensCase> cases = {
      {CameraModel::kPinhole, {}, 1e-9, 1e-9, false},
      {CameraModel::kRadtan, {-0.2, 0.05, 1e-3, -2e-3}, 1e-9, 1e-9, false},
      {CameraModel::kRadtan, {-0.25, 0.08, 1e-3, -2e-3, -0.01}, 2.0, 1e-9, true},
      {CameraModel::kEquidistant, {0.01, -0.02, 0.003, -4e-4}, 1e-9, 1e-9, false},
      {CameraModel::kRational, {-0.2, 0.05, 1e-3, -2e-3}, 1e-9, 1e-9, false},
      {CameraModel::kRational, {0.3, 0.1, 1e-3, -1e-3, 0.0, 0.5, 0.1, 0.01}, 2.0, 1.0, true},
      {CameraModel::kFov, {0.9}, 1.0, 1.0, true}};
  for (const LensCase& lens : cases) {
    map.camera.model = lens.model;
    map.camera.distortion = lens.distortion;
    ASSERT_FALSE(map.camera.Problem().has_value());
    const auto notes = WriteNerfTransforms(file, map, "/far/away");
    const nlohmann::json both = ReadJson(file);
    EXPECT_FALSE(both["is_fisheye"] == false && both.contains("k3"));
    for (const bool is_instant_ngp : {false, true}) {
      EXPECT_LT(LargestDistancePx(map.camera, CameraOfReader(both, is_instant_ngp)), lens.both_px)
          << Describe(map.camera);
    }
    EXPECT_EQ(notes.empty(), !lens.is_refitted) << Describe(map.camera);
    for (const std::string& note : notes) {
      EXPECT_THAT(note, testing::HasSubstr("px root mean square"));
    }
    WriteNerfTransforms(file, map, "/far/away", NerfReader::kNerfstudio);
    EXPECT_LT(LargestDistancePx(map.camera, CameraOfReader(ReadJson(file), false)),
              lens.nerfstudio_px)
        << Describe(map.camera);
  }
}

TEST(NerfTransforms, HaveTheSceneInTheBoxAndThePointsBeside) {
  const TemporaryFolder folder;
  const RunMap map = MapOfScene(ExportScene());
  EXPECT_TRUE(WriteNerfTransforms(folder.path() / "scene.json", map, "/images").empty());
  const nlohmann::json json = ReadJson(folder.path() / "scene.json");
  EXPECT_EQ(json["applied_transform"], nlohmann::json::parse("[[1,0,0,0],[0,1,0,0],[0,0,1,0]]"));
  const double scale = json["scale"];
  const int aabb_scale = json["aabb_scale"];
  const Eigen::Vector3d offset(json["offset"][0], json["offset"][1], json["offset"][2]);
  EXPECT_EQ(aabb_scale & (aabb_scale - 1), 0);
  const auto is_inside = [&](const Eigen::Vector3d& position, double side) {
    return ((scale * position + offset).array() - 0.5).abs().maxCoeff() < 0.5 * side;
  };
  for (const MapFrame& frame : map.frames) EXPECT_TRUE(is_inside(frame.center_in_world, 1.0));
  int num_points = 0;
  for (const MapTrack& entry : map.tracks) {
    if (!HasPoint(entry)) continue;
    ++num_points;
    EXPECT_TRUE(is_inside(*entry.point_in_world, aabb_scale));
  }
  EXPECT_EQ(json["ply_file_path"], "scene_points.ply");
  const std::string ply = ReadWholeFile(folder.path() / "scene_points.ply");
  EXPECT_THAT(ply, testing::HasSubstr("element vertex " + std::to_string(num_points) + "\n"));
}

TEST(NerfTransforms, OfAPureRotationHaveNoPoints) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  map.tracks.clear();
  for (MapFrame& frame : map.frames) frame.center_in_world.setZero();
  EXPECT_TRUE(WriteNerfTransforms(folder.path() / "transforms.json", map, "/images").empty());
  const nlohmann::json json = ReadJson(folder.path() / "transforms.json");
  EXPECT_FALSE(json.contains("ply_file_path"));
  EXPECT_FALSE(fs::exists(folder.path() / "transforms_points.ply"));
  EXPECT_EQ(json["aabb_scale"], 1);
}

TEST(SceneBox, KeepsFarPointsAndGrowsForThem) {
  std::vector<Eigen::Vector3d> centers;
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 100; ++k) {
    centers.emplace_back(5.0 + 0.01 * k, 0.0, 0.0);
    points.emplace_back(5.0 + 0.02 * k, 1.0 - 0.02 * k, k < 90 ? 2.0 : 2.0 + 5.0 * (k - 90));
  }
  const SceneBox box = ChooseSceneBox(centers, points);
  EXPECT_EQ(box.num_outside, 0);
  EXPECT_GE(box.aabb_scale, 2);
  EXPECT_LE(box.aabb_scale, 128);
  // One that no box can hold with the rest stays outside; two of a hundred do not.
  points.back().z() = 1e6;
  const SceneBox without = ChooseSceneBox(centers, points);
  EXPECT_EQ(without.num_outside, 1);
  EXPECT_EQ(without.aabb_scale, 128);
  points.front().z() = 1e6;
  const SceneBox with_one = ChooseSceneBox(centers, points);
  EXPECT_EQ(with_one.num_outside, 0);
  EXPECT_LT(with_one.scale, 1e-3);
  EXPECT_EQ(ChooseSceneBox({}, {}).aabb_scale, 1);
}

TEST(LensFit, IsExactWhereTheModelHasTheLens) {
  Camera camera = ExportScene().camera;
  camera.model = CameraModel::kRational;
  camera.distortion = {-0.2, 0.05, 1e-3, -2e-3, 0.01};
  LensFit fit = FitLens(camera, CameraModel::kRadtan, 5);
  EXPECT_LT(fit.largest_px, 1e-6);
  EXPECT_NEAR(fit.camera.distortion[4], 0.01, 1e-6);
  // From a start without distortion.
  camera.model = CameraModel::kEquidistant;
  camera.distortion = {0.05, -0.02, 0.003, -4e-4};
  fit = FitLens(camera, CameraModel::kEquidistant, 4);
  EXPECT_LT(fit.largest_px, 1e-6);
  // Two coefficients of another model cannot.
  fit = FitLens(camera, CameraModel::kRadtan, 2);
  EXPECT_GT(fit.largest_px, 1e-3);
  EXPECT_LE(fit.rms_px, fit.largest_px);
}

TEST(OpenMvg, RefusesALensThatItHasNoModelOf) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "out.json";
  RunMap map = MapOfScene(ExportScene());
  map.camera.model = CameraModel::kRational;
  map.camera.distortion = {0.3, 0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0};
  const std::string complaint = RuntimeErrorOf([&] { WriteOpenMvg(file, map, "/images"); });
  EXPECT_THAT(complaint, testing::HasSubstr("out.json: is not written: "));
  EXPECT_THAT(complaint, testing::HasSubstr("no camera model for a rational lens (k4 k5 k6)"));
  EXPECT_THAT(complaint, testing::HasSubstr("--undistort"));
  EXPECT_EQ(complaint.find('\n'), std::string::npos);
  map.camera.model = CameraModel::kFov;
  map.camera.distortion = {0.9};
  EXPECT_THAT(RuntimeErrorOf([&] { WriteOpenMvg(file, map, "/images"); }),
              testing::HasSubstr("no camera model for a FOV lens (w)"));
  EXPECT_FALSE(fs::exists(file));
  // Without a denominator it is a radtan lens.
  map.camera.model = CameraModel::kRational;
  map.camera.distortion = {1.0, 2.0, 3.0, 4.0, 5.0};
  WriteOpenMvg(file, map, "/images");
  EXPECT_EQ(ReadJson(file)["intrinsics"][0]["value"]["ptr_wrapper"]["data"]["disto_t2"],
            (nlohmann::json{1.0, 2.0, 5.0, 3.0, 4.0}));
}

TEST(OpenMvg, ReadsBackTheSame) {
  const TemporaryFolder folder;
  const RunMap map = MapOfScene(ExportScene());
  WriteOpenMvg(folder.path() / "sfm_data.json", map, "/images");
  const nlohmann::json json = ReadJson(folder.path() / "sfm_data.json");
  EXPECT_EQ(json["sfm_data_version"], "0.3");
  EXPECT_EQ(json["root_path"], "/images");
  EXPECT_TRUE(json["control_points"].empty());
  const nlohmann::json& intrinsic = json["intrinsics"][0]["value"];
  EXPECT_EQ(intrinsic["polymorphic_name"], "pinhole");
  EXPECT_EQ(intrinsic["ptr_wrapper"]["data"]["focal_length"], map.camera.fx);
  EXPECT_EQ(intrinsic["ptr_wrapper"]["data"]["principal_point"][1], map.camera.cy);
  ASSERT_EQ(json["views"].size(), map.frames.size());
  ASSERT_EQ(json["extrinsics"].size(), map.frames.size());
  for (std::size_t k = 0; k < map.frames.size(); ++k) {
    const MapFrame& frame = map.frames[k];
    EXPECT_EQ(json["views"][k]["key"], frame.id.value);
    const nlohmann::json& view = json["views"][k]["value"]["ptr_wrapper"]["data"];
    EXPECT_EQ(view["filename"], frame.image);
    EXPECT_EQ(view["id_pose"], frame.id.value);
    const nlohmann::json& pose = json["extrinsics"][k]["value"];
    const Eigen::Matrix3d R_c_w = frame.cam_from_world.Matrix();
    for (int row = 0; row < 3; ++row) {
      EXPECT_EQ(pose["center"][row], frame.center_in_world[row]);
      for (int column = 0; column < 3; ++column) {
        EXPECT_EQ(pose["rotation"][row][column], R_c_w(row, column));
      }
    }
  }
  std::size_t next = 0;
  for (const MapTrack& entry : map.tracks) {
    if (!HasPoint(entry)) continue;
    ASSERT_LT(next, json["structure"].size());
    const nlohmann::json& point = json["structure"][next++];
    EXPECT_EQ(point["key"], entry.track.id.value);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(point["value"]["X"][k], (*entry.point_in_world)[k]);
    std::size_t sighting = 0;
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      if (!entry.fits[k]) continue;
      const nlohmann::json& seen = point["value"]["observations"][sighting++];
      EXPECT_EQ(seen["key"], entry.track.observations[k].frame.value);
      EXPECT_EQ(seen["value"]["x"][0], entry.track.observations[k].keypoint_px.x());
      EXPECT_EQ(seen["value"]["x"][1], entry.track.observations[k].keypoint_px.y());
    }
    EXPECT_EQ(point["value"]["observations"].size(), sighting);
  }
  EXPECT_EQ(json["structure"].size(), next);
}

// The folder is a text in the map's file, and a damaged one may have none.
TEST(Exports, TakeAMapThatDoesNotKnowItsImageFolder) {
  const TemporaryFolder folder;
  const RunMap map = MapOfScene(ExportScene());
  WriteNerfTransforms(folder.path() / "transforms.json", map, {});
  EXPECT_EQ(ReadJson(folder.path() / "transforms.json")["frames"][0]["file_path"],
            map.frames[0].image);
  WriteOpenMvg(folder.path() / "sfm_data.json", map, {});
  EXPECT_EQ(ReadJson(folder.path() / "sfm_data.json")["root_path"], "");
}

TEST(OpenMvg, PutsTheLensInItsOrder) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  map.camera.model = CameraModel::kRadtan;
  map.camera.distortion = {1.0, 2.0, 3.0, 4.0, 5.0};
  WriteOpenMvg(folder.path() / "sfm_data.json", map, "/images");
  const nlohmann::json intrinsic =
      ReadJson(folder.path() / "sfm_data.json")["intrinsics"][0]["value"];
  EXPECT_EQ(intrinsic["polymorphic_name"], "pinhole_brown_t2");
  EXPECT_EQ(intrinsic["ptr_wrapper"]["data"]["disto_t2"],
            (nlohmann::json{1.0, 2.0, 5.0, 3.0, 4.0}));
}

TEST(EurocTrajectory, ReadsBackTheSame) {
  const TemporaryFolder folder;
  const Trajectory trajectory = ToTrajectory(MapOfScene(ExportScene()));
  WriteEurocTrajectory(folder.path() / "poses.csv", trajectory);
  const std::vector<TextRow> rows = ReadTextRows(folder.path() / "poses.csv");
  ASSERT_EQ(rows.size(), trajectory.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    ASSERT_EQ(rows[k].words.size(), 8u);
    EXPECT_EQ(rows[k].words[0], std::to_string(std::llround(1e9 * trajectory[k].timestamp_s)));
    const auto at = [&](std::size_t position) {
      return NumberAt(folder.path() / "poses.csv", rows[k], position);
    };
    EXPECT_LT((Eigen::Vector3d(at(1), at(2), at(3)) - trajectory[k].center_in_world).norm(), 1e-10);
    const Rotation read(Eigen::Quaterniond(at(4), at(5), at(6), at(7)));
    EXPECT_LT((read * trajectory[k].world_from_cam.Inverse()).Angle(), 1e-11);
  }
  EXPECT_THROW(WriteEurocTrajectory(folder.path() / "poses.csv",
                                    {{std::nan(""), Rotation(), Eigen::Vector3d::Zero()}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
