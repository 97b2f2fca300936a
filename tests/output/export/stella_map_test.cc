#include "output/export/stella_map.h"

#include <cstring>
#include <functional>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/map/map_keypoints.h"
#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using Json = nlohmann::json;

std::map<FrameId, KeypointDescriptors> SomeDescriptors(const RunMap& map) {
  std::map<FrameId, KeypointDescriptors> descriptors;
  for (const auto& [frame, list] : ListKeypoints(map)) {
    KeypointDescriptors& of_frame = descriptors[frame];
    for (std::size_t k = 0; k < list.size(); ++k) {
      of_frame.angles_deg.push_back(0.5 * static_cast<double>(k));
      std::array<std::uint8_t, 32> bytes;
      for (std::size_t b = 0; b < bytes.size(); ++b) {
        bytes[b] = static_cast<std::uint8_t>(frame.value + 7 * k + b);
      }
      of_frame.descriptors.push_back(bytes);
    }
  }
  return descriptors;
}

Json Written(const RunMap& map) {
  const TemporaryFolder folder;
  WriteStellaMap(folder.path() / "map.msg", map, SomeDescriptors(map));
  const std::string bytes = ReadWholeFile(folder.path() / "map.msg");
  return Json::from_msgpack(bytes.begin(), bytes.end());
}

TEST(StellaMap, ReadsBackTheSame) {
  const RunMap map = MapOfScene(ExportScene());
  const Json stella = Written(map);
  const auto descriptors = SomeDescriptors(map);
  const auto keypoints = ListKeypoints(map);
  EXPECT_EQ(stella["cameras"]["rotslam"]["model_type"], "Perspective");
  EXPECT_EQ(stella["cameras"]["rotslam"]["fx"], map.camera.fx);
  EXPECT_EQ(stella["cameras"]["rotslam"]["cols"], map.camera.width);
  EXPECT_NEAR(stella["cameras"]["rotslam"]["fps"].get<double>(), 100.0, 1e-9);  // ten frames a step
  EXPECT_EQ(stella["orb_params"]["rotslam ORB"]["num_levels"], 8);
  ASSERT_EQ(stella["keyframes"].size(), map.frames.size());
  EXPECT_EQ(stella["keyframe_next_id"], map.frames.size());
  for (std::size_t k = 0; k < map.frames.size(); ++k) {
    const MapFrame& frame = map.frames[k];
    const Json& keyframe = stella["keyframes"][std::to_string(k)];
    EXPECT_EQ(keyframe["ts"], frame.timestamp_s);
    EXPECT_TRUE(stella["cameras"].contains(keyframe["cam"].get<std::string>()));
    EXPECT_TRUE(stella["orb_params"].contains(keyframe["orb_params"].get<std::string>()));
    const auto q = keyframe["rot_cw"].get<std::vector<double>>();
    const auto t = keyframe["trans_cw"].get<std::vector<double>>();
    const Rotation cam_from_world(Eigen::Quaterniond(q.at(3), q.at(0), q.at(1), q.at(2)));
    EXPECT_LT((cam_from_world * frame.cam_from_world.Inverse()).Angle(), 1e-15);
    EXPECT_LT((cam_from_world * frame.center_in_world + Eigen::Vector3d(t.at(0), t.at(1), t.at(2)))
                  .norm(),
              1e-13);
    const std::vector<MapKeypoint>& list = keypoints.at(frame.id);
    ASSERT_EQ(keyframe["n_keypts"], list.size());
    ASSERT_EQ(keyframe["undist_keypts"].size(), list.size());
    ASSERT_EQ(keyframe["descs"].size(), list.size());
    ASSERT_EQ(keyframe["lm_ids"].size(), list.size());
    for (std::size_t p = 0; p < list.size(); ++p) {
      const MapTrack& entry = map.tracks[list[p].track];
      const Observation& seen = entry.track.observations[list[p].observation];
      const Json& corner = keyframe["undist_keypts"][p];
      EXPECT_NEAR(corner["pt"][0].get<double>(), seen.keypoint_px.x(), 1e-4);
      EXPECT_NEAR(corner["pt"][1].get<double>(), seen.keypoint_px.y(), 1e-4);
      EXPECT_EQ(corner["oct"], entry.levels[list[p].observation]);
      EXPECT_EQ(corner["ang"].get<double>(), descriptors.at(frame.id).angles_deg[p]);
      ASSERT_EQ(keyframe["descs"][p].size(), 8u);
      const auto words = keyframe["descs"][p].get<std::vector<std::uint32_t>>();
      EXPECT_EQ(std::memcmp(words.data(), descriptors.at(frame.id).descriptors[p].data(), 32), 0);
      EXPECT_EQ(keyframe["lm_ids"][p], list[p].has_point ? entry.track.id.value : -1);
    }
  }
}

// What the program checks while it reads, and where it would stop.
TEST(StellaMap, HangsTogether) {
  const RunMap whole = MapOfScene(ExportScene());
  const RunMap map = PartOf(whole, KeyframesOf(whole));
  const Json stella = Written(map);
  const Json& keyframes = stella["keyframes"];
  std::map<int, std::set<int>> shown_by;
  for (const auto& [id, keyframe] : keyframes.items()) {
    std::set<int> ids;
    for (const int landmark : keyframe["lm_ids"].get<std::vector<int>>()) {
      if (landmark < 0) continue;
      EXPECT_TRUE(ids.insert(landmark).second) << "twice in keyframe " << id;
      shown_by[landmark].insert(std::stoi(id));
    }
  }
  ASSERT_EQ(stella["landmarks"].size(), shown_by.size());
  EXPECT_GT(shown_by.size(), 200u);
  for (const auto& [id, landmark] : stella["landmarks"].items()) {
    const std::set<int>& shown = shown_by.at(std::stoi(id));
    EXPECT_TRUE(shown.contains(landmark["ref_keyfrm"].get<int>()));
    EXPECT_EQ(landmark["1st_keyfrm"], *shown.begin());
    EXPECT_EQ(landmark["n_fnd"], shown.size());
    EXPECT_LT(std::stoi(id), stella["landmark_next_id"].get<int>());
    EXPECT_EQ(landmark["pos_w"].size(), 3u);
  }
  // One tree: the first keyframe is its root, parents and children name each other.
  int num_children = 0;
  for (const auto& [id, keyframe] : keyframes.items()) {
    const int parent = keyframe["span_parent"];
    EXPECT_EQ(parent == -1, id == "0");
    EXPECT_LT(parent, std::stoi(id));
    for (const int child : keyframe["span_children"].get<std::vector<int>>()) {
      EXPECT_EQ(keyframes[std::to_string(child)]["span_parent"], std::stoi(id));
      ++num_children;
    }
  }
  EXPECT_EQ(num_children + 1, static_cast<int>(keyframes.size()));
}

TEST(StellaMap, UndistortsFisheyesAndLeavesOutWhatLiesBehind) {
  RunMap map = MapOfScene(ExportScene());
  map.camera.model = CameraModel::kEquidistant;
  map.tracks[0].track.observations[0].bearing = Eigen::Vector3d(0.6, 0.0, -0.8);
  map.tracks[1].track.observations[0].bearing = Eigen::Vector3d(0.6, 0.0, 0.8);
  const Json stella = Written(map);
  EXPECT_EQ(stella["cameras"]["rotslam"]["model_type"], "Fisheye");
  EXPECT_TRUE(stella["cameras"]["rotslam"].contains("k4"));
  const FrameId frame = map.tracks[0].track.observations[0].frame;
  ASSERT_EQ(frame, map.frames[0].id);
  ASSERT_EQ(map.tracks[1].track.observations[0].frame, frame);
  const Json& keyframe = stella["keyframes"]["0"];
  EXPECT_EQ(keyframe["n_keypts"].get<std::size_t>() + 1, ListKeypoints(map).at(frame).size());
  EXPECT_NEAR(keyframe["undist_keypts"][0]["pt"][0].get<double>(),
              map.camera.cx + 0.75 * map.camera.fx,
              1e-3);
}

TEST(StellaMap, RefusesALensThatItHasNoModelOf) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  map.camera.model = CameraModel::kFov;
  map.camera.distortion = {0.9};
  EXPECT_THAT(
      RuntimeErrorOf([&] { WriteStellaMap(folder.path() / "map.msg", map, SomeDescriptors(map)); }),
      testing::HasSubstr("stella_vslam has no camera model for a FOV lens"));
}

TEST(StellaMap, WantsADescriptorForEachKeypoint) {
  const TemporaryFolder folder;
  const RunMap map = MapOfScene(ExportScene());
  auto descriptors = SomeDescriptors(map);
  descriptors.begin()->second.descriptors.pop_back();
  EXPECT_THROW(WriteStellaMap(folder.path() / "map.msg", map, descriptors), std::invalid_argument);
  EXPECT_THROW(WriteStellaMap(folder.path() / "map.msg", map, {}), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
