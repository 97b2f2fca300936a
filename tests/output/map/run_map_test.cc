#include "output/map/run_map.h"

#include <fstream>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/map/map_keypoints.h"
#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

TEST(RunMap, ReadsBackWhatItHasWritten) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  map.camera.readout_s = 0.02;
  map.camera.readout_from = ReadoutStart::kRight;
  WriteRunMap(folder.path() / "map.bin", map);
  const RunMap read = ReadRunMap(folder.path() / "map.bin");
  EXPECT_EQ(read.camera, map.camera);
  EXPECT_EQ(read.image_folder, map.image_folder);
  EXPECT_EQ(read.is_video, map.is_video);
  ASSERT_EQ(read.frames.size(), map.frames.size());
  for (std::size_t k = 0; k < map.frames.size(); ++k) {
    EXPECT_EQ(read.frames[k].id, map.frames[k].id);
    EXPECT_EQ(read.frames[k].timestamp_s, map.frames[k].timestamp_s);
    EXPECT_EQ(read.frames[k].image, map.frames[k].image);
    EXPECT_EQ(read.frames[k].is_keyframe, map.frames[k].is_keyframe);
    EXPECT_EQ(read.frames[k].center_in_world, map.frames[k].center_in_world);
    EXPECT_LT((read.frames[k].cam_from_world * map.frames[k].cam_from_world.Inverse()).Angle(),
              1e-15);
  }
  ASSERT_EQ(read.tracks.size(), map.tracks.size());
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    const MapTrack& expected = map.tracks[t];
    EXPECT_EQ(read.tracks[t].track.id, expected.track.id);
    EXPECT_EQ(read.tracks[t].track.rgb, expected.track.rgb);
    EXPECT_EQ(read.tracks[t].point_in_world, expected.point_in_world);
    EXPECT_EQ(read.tracks[t].fits, expected.fits);
    EXPECT_EQ(read.tracks[t].levels, expected.levels);
    ASSERT_EQ(read.tracks[t].track.observations.size(), expected.track.observations.size());
    for (std::size_t k = 0; k < expected.fits.size(); ++k) {
      const Observation& seen = read.tracks[t].track.observations[k];
      EXPECT_EQ(seen.frame, expected.track.observations[k].frame);
      EXPECT_EQ(seen.keypoint_px, expected.track.observations[k].keypoint_px);
      EXPECT_EQ(seen.bearing, expected.track.observations[k].bearing);
      EXPECT_EQ(seen.sigma_px, expected.track.observations[k].sigma_px);
    }
  }
  ASSERT_EQ(read.edges.size(), map.edges.size());
  EXPECT_EQ(read.edges[3].num_inliers, map.edges[3].num_inliers);
}

TEST(RunMap, KeepsEveryModelOfACamera) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  for (const CameraModel model : AllCameraModels()) {
    map.camera.model = model;
    map.camera.distortion = {};
    for (std::size_t k = 0; k < DistortionNames(model).size(); ++k) {
      map.camera.distortion[k] = 0.01 / (1.0 + static_cast<double>(k));
    }
    WriteRunMap(folder.path() / "map.bin", map);
    EXPECT_EQ(ReadRunMap(folder.path() / "map.bin").camera, map.camera);
  }
}

TEST(RunMap, ReadsWhatVersion010HasWritten) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  map.camera.model = CameraModel::kRadtan;
  map.camera.distortion = {-0.1, 0.02, 1e-3, -2e-3, 0.003};
  WriteRunMap(folder.path() / "map.bin", map);
  std::string bytes = ReadWholeFile(folder.path() / "map.bin");
  // "rotslam_map 3\n", three numbers of four bytes, fx fy cx cy and five coefficients; then three
  // more of them, which that version did not have.
  bytes.erase(14 + 3 * 4 + 9 * 8, 3 * 8);
  bytes[12] = '2';
  folder.Write("old.bin", bytes);
  const RunMap read = ReadRunMap(folder.path() / "old.bin");
  EXPECT_EQ(read.camera, map.camera);
  EXPECT_EQ(read.image_folder, map.image_folder);
  EXPECT_EQ(read.tracks.size(), map.tracks.size());
  EXPECT_EQ(read.edges.size(), map.edges.size());
}

TEST(RunMap, BelievesNoBrokenFile) {
  const TemporaryFolder folder;
  WriteRunMap(folder.path() / "map.bin", MapOfScene(ExportScene()));
  const std::string good = ReadWholeFile(folder.path() / "map.bin");
  for (std::size_t kept = 0; kept < good.size(); kept += 1 + kept / 7) {
    folder.Write("cut.bin", good.substr(0, kept));
    EXPECT_THAT(RuntimeErrorOf([&] { ReadRunMap(folder.path() / "cut.bin"); }),
                HasSubstr("cut.bin: "))
        << kept;
  }
  // Any byte may be another: the file is then refused, or it is another map. Nothing crashes.
  int num_refused = 0;
  for (std::size_t at = 0; at < good.size(); at += 1 + at / 50) {
    std::string other = good;
    other[at] = static_cast<char>(~other[at]);
    folder.Write("other.bin", other);
    try {
      ReadRunMap(folder.path() / "other.bin");
    } catch (const std::runtime_error& error) {
      ++num_refused;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
  EXPECT_GT(num_refused, 20);
  folder.Write("longer.bin", good + "x");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadRunMap(folder.path() / "longer.bin"); }),
              HasSubstr("longer than"));
  folder.Write("text.bin", "some words that are no map");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadRunMap(folder.path() / "text.bin"); }),
              HasSubstr("is not a map"));
  EXPECT_THAT(RuntimeErrorOf([&] { ReadRunMap(folder.path() / "none.bin"); }),
              HasSubstr("No such file"));
}

TEST(RunMap, KeyframesKeepTheirSightingsOnly) {
  const RunMap map = MapOfScene(ExportScene());
  const RunMap part = PartOf(map, KeyframesOf(map));
  std::set<FrameId> frames;
  for (const MapFrame& frame : part.frames) frames.insert(frame.id);
  EXPECT_EQ(frames.size(), 6u);  // of nine
  std::size_t kept = 0;
  for (const MapTrack& entry : part.tracks) {
    EXPECT_EQ(entry.fits.size(), entry.track.observations.size());
    EXPECT_EQ(entry.levels.size(), entry.track.observations.size());
    for (const Observation& seen : entry.track.observations) {
      EXPECT_TRUE(frames.contains(seen.frame));
    }
    kept += entry.fits.size();
  }
  std::size_t expected = 0;
  for (const MapTrack& entry : map.tracks) {
    for (const Observation& seen : entry.track.observations)
      expected += frames.contains(seen.frame);
  }
  EXPECT_EQ(kept, expected);
  EXPECT_EQ(part.edges.size(), 3u);  // between neighbours, both of which are keyframes
}

TEST(JoinTracks, MarksTheSightingsThatFit) {
  const Scene scene = ExportScene();
  Reconstruction solved;
  solved.tracks = {scene.tracks[2], scene.tracks[4]};
  const Observation left_out = solved.tracks[0].observations[1];
  solved.tracks[0].observations.erase(solved.tracks[0].observations.begin() + 1);
  solved.point_in_world[scene.tracks[2].id] = Eigen::Vector3d(1.0, 2.0, 3.0);
  Track unknown = scene.tracks[4];
  unknown.id = TrackId{100000};
  solved.tracks.push_back(unknown);
  solved.point_in_world[unknown.id] = Eigen::Vector3d::Zero();

  const std::vector<MapTrack> joined = JoinTracks(scene.tracks, solved);
  ASSERT_EQ(joined.size(), scene.tracks.size() + 1);
  const MapTrack& entry = joined[2];
  EXPECT_EQ(entry.point_in_world, Eigen::Vector3d(1.0, 2.0, 3.0));
  for (std::size_t k = 0; k < entry.fits.size(); ++k) {
    EXPECT_EQ(entry.fits[k], entry.track.observations[k].frame != left_out.frame);
  }
  // Without a point, nothing fits; what only the solution has is all there.
  EXPECT_FALSE(joined[4].point_in_world.has_value());
  EXPECT_EQ(CountFits(joined[4]), 0);
  EXPECT_EQ(CountFits(joined.back()), static_cast<int>(unknown.observations.size()));
}

TEST(JoinTracks, TakesTheSightingsThatTheSolutionHas) {
  const Scene scene = ExportScene();
  Track given = scene.tracks[2];
  Reconstruction solved;
  solved.tracks = {given};
  solved.point_in_world[given.id] = Eigen::Vector3d(1.0, 2.0, 3.0);
  // One sighting was measured anew, and one is the solution's alone.
  solved.tracks[0].observations[0].keypoint_px += Eigen::Vector2d(3.0, -2.0);
  given.observations.erase(given.observations.begin() + 1);
  const std::vector<MapTrack> joined = JoinTracks({given}, solved);
  ASSERT_EQ(joined.size(), 1u);
  ASSERT_EQ(joined[0].track.observations.size(), solved.tracks[0].observations.size());
  EXPECT_EQ(CountFits(joined[0]), static_cast<int>(joined[0].fits.size()));
  EXPECT_EQ(joined[0].levels.size(), joined[0].fits.size());
  for (std::size_t k = 0; k < joined[0].fits.size(); ++k) {
    EXPECT_EQ(joined[0].track.observations[k].frame, solved.tracks[0].observations[k].frame);
    EXPECT_EQ(joined[0].track.observations[k].keypoint_px,
              solved.tracks[0].observations[k].keypoint_px);
  }
}

}  // namespace
}  // namespace rotslam
