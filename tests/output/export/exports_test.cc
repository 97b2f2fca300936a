// Formats for other programs, read back.

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/export/nerf.h"
#include "output/export/openmvg.h"
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

TEST(NerfTransforms, NameEveryLens) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "transforms.json";
  RunMap map = MapOfScene(ExportScene());
  map.camera.distortion = {1.0, 2.0, 3.0, 4.0, 5.0};
  map.camera.model = CameraModel::kRadtan;
  WriteNerfTransforms(file, map, "/far/away");
  nlohmann::json json = ReadJson(file);
  EXPECT_EQ(json["p1"], 3.0);
  EXPECT_EQ(json["p2"], 4.0);
  EXPECT_EQ(json["k3"], 5.0);
  map.camera.distortion[4] = 0.0;
  map.camera.model = CameraModel::kEquidistant;
  WriteNerfTransforms(file, map, "/far/away");
  json = ReadJson(file);
  EXPECT_EQ(json["camera_model"], "OPENCV_FISHEYE");
  EXPECT_EQ(json["is_fisheye"], true);
  EXPECT_EQ(json["k3"], 3.0);
  EXPECT_EQ(json["k4"], 4.0);
}

TEST(Exports, RefuseALensThatTheOtherSystemHasNoModelOf) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "out.json";
  RunMap map = MapOfScene(ExportScene());
  const auto complaints = [&] {
    return std::vector<std::string>{
        RuntimeErrorOf([&] { WriteNerfTransforms(file, map, "/images"); }),
        RuntimeErrorOf([&] { WriteOpenMvg(file, map, "/images"); })};
  };
  map.camera.model = CameraModel::kRational;
  map.camera.distortion = {0.3, 0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0};
  for (const std::string& complaint : complaints()) {
    EXPECT_THAT(complaint, testing::HasSubstr("out.json: is not written: "));
    EXPECT_THAT(complaint, testing::HasSubstr("no camera model for a rational lens (k4 k5 k6)"));
    EXPECT_THAT(complaint, testing::HasSubstr("export --to colmap"));
    EXPECT_EQ(complaint.find('\n'), std::string::npos);
  }
  map.camera.model = CameraModel::kFov;
  map.camera.distortion = {0.9};
  for (const std::string& complaint : complaints()) {
    EXPECT_THAT(complaint, testing::HasSubstr("no camera model for a FOV lens (w)"));
  }
  EXPECT_FALSE(fs::exists(file));
  // Without a denominator it is a radtan lens.
  map.camera.model = CameraModel::kRational;
  map.camera.distortion = {1.0, 2.0, 3.0, 4.0, 5.0};
  WriteNerfTransforms(file, map, "/images");
  EXPECT_EQ(ReadJson(file)["k3"], 5.0);
  EXPECT_EQ(ReadJson(file)["p1"], 3.0);
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
