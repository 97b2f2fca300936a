// Maps of a lens that zooms, and what exports make of them.

#include "output/map/frame_cameras.h"

#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/export/colmap_model.h"
#include "output/export/nerf.h"
#include "output/export/openmvg.h"
#include "output/map/map_keypoints.h"
#include "output/tables/focal_lengths_csv.h"
#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using Json = nlohmann::json;

Json ReadJson(const std::filesystem::path& path) {
  std::ifstream stream(path);
  return Json::parse(stream);
}

// Frames 0 to 30 with the map's focal length, 40 with 1.2 times that, those behind with 1.4.
double ScaleAt(FrameId frame) { return frame.value < 40 ? 1.0 : frame.value == 40 ? 1.2 : 1.4; }

struct ZoomedMap {
  RunMap before;  // keypoints as the map's camera shows them
  RunMap map;
};

ZoomedMap MapWithZoom() {
  ZoomedMap result;
  result.before = result.map = MapOfScene(ExportScene());
  std::map<FrameId, Camera> cameras;
  for (const MapFrame& frame : result.map.frames) {
    Camera& own = cameras[frame.id] = result.map.camera;
    own.fx *= ScaleAt(frame.id);
    own.fy *= ScaleAt(frame.id);
  }
  GiveFrameCameras(cameras, result.map);
  return result;
}

TEST(GiveFrameCameras, MovesKeypointsAwayFromThePrincipalPoint) {
  const auto [before, map] = MapWithZoom();
  const Eigen::Vector2d center(map.camera.cx, map.camera.cy);
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    for (std::size_t k = 0; k < map.tracks[t].fits.size(); ++k) {
      const Observation& seen = map.tracks[t].track.observations[k];
      const Eigen::Vector2d from = before.tracks[t].track.observations[k].keypoint_px - center;
      EXPECT_LT((seen.keypoint_px - center - ScaleAt(seen.frame) * from).norm(), 1e-9);
    }
  }
}

TEST(GiveFrameCameras, ErrorsAreThoseInTheImages) {
  const auto [before, map] = MapWithZoom();
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    const double before_px = MeanErrorPx(before, before.tracks[t]);
    const double error_px = MeanErrorPx(map, map.tracks[t]);
    EXPECT_GE(error_px, before_px * (1.0 - 1e-9));
    EXPECT_LE(error_px, before_px * (1.4 + 1e-9));
  }
}

TEST(MoveToFrameCameras, MovesMatchesAlike) {
  const auto [before, map] = MapWithZoom();
  ViewGraphMatches matches;
  const Observation& seen = before.tracks[1].track.observations.back();
  matches.keypoints_px[seen.frame] = {seen.keypoint_px.cast<float>()};
  MoveToFrameCameras(map, matches);
  const Observation& moved = map.tracks[1].track.observations.back();
  EXPECT_EQ(matches.keypoints_px.at(seen.frame)[0], moved.keypoint_px.cast<float>());
}

TEST(ListCameras, HasOneForEachStretchOfOneFocalLength) {
  const auto [before, map] = MapWithZoom();
  EXPECT_EQ(ListCameras(before).cameras.size(), 1U);
  const CameraList list = ListCameras(map);
  ASSERT_EQ(list.cameras.size(), 3U);
  EXPECT_EQ(list.of_frame.at(FrameId{0}), 0);
  EXPECT_EQ(list.of_frame.at(FrameId{40}), 1);
  EXPECT_EQ(list.of_frame.at(FrameId{50}), 2);
  EXPECT_EQ(list.of_frame.at(FrameId{80}), 2);
}

TEST(ColmapOfAZoom, HasACameraForEachStretch) {
  const TemporaryFolder folder;
  const RunMap map = MapWithZoom().map;
  for (const ColmapForm form : {ColmapForm::kBinary, ColmapForm::kText}) {
    WriteColmapModel(folder.path() / "sparse", map, form);
    const ColmapModel model = ReadColmapModel(folder.path() / "sparse");
    ASSERT_EQ(model.cameras.size(), 3U);
    for (const MapFrame& frame : map.frames) {
      const auto& image = model.images.at(FrameId{ColmapImageId(frame.id)});
      EXPECT_NEAR(model.cameras.at(image.camera).fx, ScaleAt(frame.id) * map.camera.fx, 1e-9);
    }
    // The noise of the keypoints, 0.5 px along each axis, and that once more times 1.4.
    EXPECT_LT(FiguresOf(model, model.reconstruction).mean_error_px, 1.0);
  }
}

TEST(NerfTransformsOfAZoom, HaveACameraInEveryFrame) {
  const TemporaryFolder folder;
  const RunMap map = MapWithZoom().map;
  WriteNerfTransforms(folder.path() / "transforms.json", map, "/images");
  const Json json = ReadJson(folder.path() / "transforms.json");
  EXPECT_FALSE(json.contains("fl_x")) << "nerfstudio would take it for all frames";
  for (std::size_t k = 0; k < map.frames.size(); ++k) {
    const Json& frame = json["frames"][k];
    EXPECT_NEAR(frame["fl_x"].get<double>(), ScaleAt(map.frames[k].id) * map.camera.fx, 1e-9);
    EXPECT_EQ(frame["w"], map.camera.width);
    EXPECT_NEAR(frame["cx"].get<double>(), map.camera.cx + 0.5, 1e-9);
  }
}

TEST(OpenMvgOfAZoom, HasAnIntrinsicForEachStretch) {
  const TemporaryFolder folder;
  const RunMap map = MapWithZoom().map;
  WriteOpenMvg(folder.path() / "sfm_data.json", map, "/images");
  const Json json = ReadJson(folder.path() / "sfm_data.json");
  ASSERT_EQ(json["intrinsics"].size(), 3U);
  const Json& last = json["views"].back()["value"]["ptr_wrapper"]["data"];
  EXPECT_EQ(last["id_intrinsic"], 2);
  EXPECT_NEAR(json["intrinsics"][2]["value"]["ptr_wrapper"]["data"]["focal_length"].get<double>(),
              1.4 * map.camera.MeanFocal(),
              1e-9);
}

TEST(FocalLengthsCsv, ReadsBackTheSame) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "focal_lengths.csv";
  WriteFocalLengthsCsv(file,
                       {{0, 1000.5, 1.0 / 3.0, 525.25, 319.5, 239.5}, {1, 1000.6, 2, 3, 4, 5}});
  const std::vector<FocalLengthRow> rows = ReadFocalLengthsCsv(file);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].frame, 0);
  EXPECT_EQ(rows[0].timestamp_s, 1000.5);
  EXPECT_EQ(rows[0].fx, 1.0 / 3.0);
  EXPECT_EQ(rows[1].cy, 5.0);
  WriteFocalLengthsCsv(file, {{0, 0.0, -1.0, 1.0, 0.0, 0.0}});
  EXPECT_THROW(ReadFocalLengthsCsv(file), std::runtime_error);
}

}  // namespace
}  // namespace rotslam
