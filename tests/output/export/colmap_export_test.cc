// COLMAP models and databases that we write, read back.

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "output/export/colmap_database.h"
#include "output/export/colmap_model.h"
#include "output/map/map_keypoints.h"
#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ColmapForms : public testing::TestWithParam<ColmapForm> {};
INSTANTIATE_TEST_SUITE_P(Colmap,
                         ColmapForms,
                         testing::Values(ColmapForm::kBinary, ColmapForm::kText));

TEST_P(ColmapForms, ReadBackTheSame) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  for (const auto& [model, distortion] : std::vector<std::pair<CameraModel, std::array<double, 8>>>{
           {CameraModel::kPinhole, {}},
           {CameraModel::kRadtan, {-0.1, 0.02, 1e-3, -2e-3, 0.0}},
           {CameraModel::kRadtan, {-0.1, 0.02, 1e-3, -2e-3, 0.003}},
           {CameraModel::kEquidistant, {0.01, -0.02, 0.003, -0.0004, 0.0}},
           {CameraModel::kRational, {0.1, 0.02, 1e-3, -2e-3, 0.003, 0.2, 0.03, 1.0 / 3.0}},
           {CameraModel::kFov, {1.0 / 3.0}}}) {
    map.camera.model = model;
    map.camera.distortion = distortion;
    WriteColmapModel(folder.path() / "sparse", map, GetParam());
    const ColmapModel read = ReadColmapModel(folder.path() / "sparse");
    Camera camera = read.camera;
    EXPECT_NEAR(camera.cx, map.camera.cx, 1e-12);  // a half more and less
    EXPECT_NEAR(camera.cy, map.camera.cy, 1e-12);
    camera.cx = map.camera.cx;
    camera.cy = map.camera.cy;
    EXPECT_EQ(camera, map.camera);
  }

  map.camera = ExportScene().camera;
  WriteColmapModel(folder.path() / "sparse", map, GetParam());
  const ColmapModel read = ReadColmapModel(folder.path() / "sparse");
  ASSERT_EQ(read.reconstruction.cam_from_world.size(), map.frames.size());
  for (const MapFrame& frame : map.frames) {
    const FrameId id{ColmapImageId(frame.id)};
    EXPECT_EQ(read.image_name.at(id), frame.image);
    const Rotation& rotation = read.reconstruction.cam_from_world.at(id);
    EXPECT_LT((rotation * frame.cam_from_world.Inverse()).Angle(), 1e-14);
    EXPECT_LT((read.reconstruction.center_in_world.at(id) - frame.center_in_world).norm(), 1e-13);
  }
  const Reconstruction expected = ToReconstruction(map);
  ASSERT_EQ(read.reconstruction.tracks.size(), expected.tracks.size());
  for (std::size_t t = 0; t < expected.tracks.size(); ++t) {
    const Track& track = read.reconstruction.tracks[t];
    EXPECT_EQ(read.reconstruction.point_in_world.at(track.id),
              expected.point_in_world.at(expected.tracks[t].id));
    EXPECT_EQ(track.rgb, expected.tracks[t].rgb);
    ASSERT_EQ(track.observations.size(), expected.tracks[t].observations.size());
    for (std::size_t k = 0; k < track.observations.size(); ++k) {
      const Observation& seen = expected.tracks[t].observations[k];
      EXPECT_EQ(track.observations[k].frame.value, ColmapImageId(seen.frame));
      EXPECT_LT((track.observations[k].keypoint_px - seen.keypoint_px).norm(), 1e-12);
    }
  }
}

TEST(Colmap, TheLastFormWrittenIsTheOneThatIsRead) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  WriteColmapModel(folder.path(), map, ColmapForm::kBinary);
  map.frames.front().image = "other.png";
  WriteColmapModel(folder.path(), map, ColmapForm::kText);
  EXPECT_EQ(ReadColmapModel(folder.path()).image_name.begin()->second, "other.png");
  EXPECT_FALSE(fs::exists(folder.path() / "images.bin"));
}

TEST(Colmap, RefusesAFolderThatCannotBe) {
  const TemporaryFolder folder;
  folder.Write("file", "");
  EXPECT_THAT(RuntimeErrorOf([&] {
                WriteColmapModel(folder.path() / "file" / "sparse",
                                 MapOfScene(ExportScene()),
                                 ColmapForm::kText);
              }),
              HasSubstr("cannot be made"));
}

// A reader of databases -------------------------------------------------------------------------

using Row = std::vector<std::string>;  // numbers as text, blobs as they are

std::vector<Row> Query(const fs::path& file, const std::string& sql) {
  sqlite3* database = nullptr;
  EXPECT_EQ(sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
  sqlite3_stmt* statement = nullptr;
  EXPECT_EQ(sqlite3_prepare_v2(database, sql.c_str(), -1, &statement, nullptr), SQLITE_OK) << sql;
  std::vector<Row> rows;
  while (sqlite3_step(statement) == SQLITE_ROW) {
    Row& row = rows.emplace_back();
    for (int k = 0; k < sqlite3_column_count(statement); ++k) {
      const void* bytes = sqlite3_column_blob(statement, k);
      const int size = sqlite3_column_bytes(statement, k);
      row.emplace_back(static_cast<const char*>(bytes), bytes == nullptr ? 0 : size);
    }
  }
  sqlite3_finalize(statement);
  sqlite3_close(database);
  return rows;
}

template <class T>
std::vector<T> Numbers(const std::string& blob) {
  std::vector<T> numbers(blob.size() / sizeof(T));
  if (!blob.empty()) std::memcpy(numbers.data(), blob.data(), blob.size());
  return numbers;
}

// The two frames behind a pair's number.
std::pair<FrameId, FrameId> FramesOf(const std::string& pair_id) {
  const std::int64_t id = std::stoll(pair_id);
  return {FrameId{static_cast<int>(id / 2147483647) - 1},
          FrameId{static_cast<int>(id % 2147483647) - 1}};
}

struct PairRow {
  int rows = 0;
  int config = 0;
  std::vector<std::uint32_t> matches;
  std::vector<double> F, E, H, qvec, tvec;
};
using PairTable = std::map<std::pair<int, int>, PairRow>;

PairTable ReadPairs(const fs::path& file) {
  PairTable table;
  for (const Row& row : Query(file,
                              "SELECT pair_id, rows, config, data, F, E, H, qvec, tvec "
                              "FROM two_view_geometries")) {
    const std::int64_t id = std::stoll(row[0]);
    table[{id / 2147483647, id % 2147483647}] = {std::stoi(row[1]),
                                                 std::stoi(row[2]),
                                                 Numbers<std::uint32_t>(row[3]),
                                                 Numbers<double>(row[4]),
                                                 Numbers<double>(row[5]),
                                                 Numbers<double>(row[6]),
                                                 Numbers<double>(row[7]),
                                                 Numbers<double>(row[8])};
  }
  return table;
}

Eigen::Matrix3d FromRows(const std::vector<double>& numbers) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
}

TEST(ColmapDatabase, HoldsTheModelsImagesAndKeypoints) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "database.db";
  const RunMap map = MapOfScene(ExportScene());
  WriteColmapDatabase(file, map, {});
  EXPECT_EQ(Query(file, "PRAGMA user_version"), (std::vector<Row>{{"3800"}}));
  const std::vector<Row> cameras = Query(
      file, "SELECT camera_id, model, width, height, prior_focal_length, params FROM cameras");
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_EQ(cameras[0][1], "1");
  EXPECT_EQ(cameras[0][2], std::to_string(map.camera.width));
  EXPECT_EQ(Numbers<double>(cameras[0][5]),
            (std::vector<double>{
                map.camera.fx, map.camera.fy, map.camera.cx + 0.5, map.camera.cy + 0.5}));
  const std::vector<Row> images = Query(file,
                                        "SELECT image_id, name, rows, cols, data FROM images "
                                        "NATURAL JOIN keypoints ORDER BY image_id");
  ASSERT_EQ(images.size(), map.frames.size());
  const auto keypoints = ListKeypoints(map);
  for (std::size_t k = 0; k < images.size(); ++k) {
    EXPECT_EQ(images[k][0], std::to_string(ColmapImageId(map.frames[k].id)));
    EXPECT_EQ(images[k][1], map.frames[k].image);
    const std::vector<MapKeypoint>& list = keypoints.at(map.frames[k].id);
    EXPECT_EQ(images[k][2], std::to_string(list.size()));
    EXPECT_EQ(images[k][3], "2");
    const std::vector<float> pixels = Numbers<float>(images[k][4]);
    ASSERT_EQ(pixels.size(), 2 * list.size());
    for (std::size_t p = 0; p < list.size(); ++p) {
      const Eigen::Vector2d& keypoint_px =
          map.tracks[list[p].track].track.observations[list[p].observation].keypoint_px;
      EXPECT_EQ(pixels[2 * p], static_cast<float>(keypoint_px.x() + 0.5));
      EXPECT_EQ(pixels[2 * p + 1], static_cast<float>(keypoint_px.y() + 0.5));
    }
  }
}

TEST(ColmapDatabase, ItsMatchesAreTheTracks) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "database.db";
  const RunMap map = MapOfScene(ExportScene());
  WriteColmapDatabase(file, map, {});
  const auto keypoints = ListKeypoints(map);
  const std::vector<Row> rows = Query(file, "SELECT pair_id, rows, data FROM matches");
  EXPECT_EQ(rows.size(), 36u);  // every two of nine frames
  std::size_t num_matches = 0;
  for (const Row& row : rows) {
    const auto [frame_i, frame_j] = FramesOf(row[0]);
    const auto& list_i = keypoints.at(frame_i);
    const auto& list_j = keypoints.at(frame_j);
    const std::vector<std::uint32_t> matches = Numbers<std::uint32_t>(row[2]);
    ASSERT_EQ(matches.size(), 2 * std::stoul(row[1]));
    for (std::size_t k = 0; k < matches.size(); k += 2) {
      EXPECT_EQ(list_i.at(matches[k]).track, list_j.at(matches[k + 1]).track);
    }
    num_matches += matches.size() / 2;
  }
  std::size_t expected = 0;
  for (const MapTrack& entry : map.tracks) {
    expected += entry.fits.size() * (entry.fits.size() - 1) / 2;
  }
  EXPECT_EQ(num_matches, expected);
}

TEST(ColmapDatabase, ItsGeometriesAreThoseOfThePoses) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "database.db";
  SceneOptions options;
  options.num_views = 6;
  options.outlier_ratio = 0.1;
  const Scene scene = MakeScene(options);
  RunMap map = MapOfScene(scene);
  map.frames[1].center_in_world = map.frames[0].center_in_world;  // one place, two turns
  map.edges = {{map.frames[2].id, map.frames[3].id, 50, true}};
  for (MapTrack& entry : map.tracks) {
    // What frame 1 would have seen from there.
    for (Observation& seen : entry.track.observations) {
      const auto point = scene.true_point_in_world.at(entry.track.id);
      if (seen.frame != map.frames[1].id) continue;
      seen.bearing =
          (map.frames[1].cam_from_world * (point - map.frames[1].center_in_world)).normalized();
      seen.keypoint_px = map.camera.Project(seen.bearing).value();
    }
  }
  WriteColmapDatabase(file, map, {});
  const auto keypoints = ListKeypoints(map);
  const PairTable table = ReadPairs(file);
  const auto number = [&](int k) { return ColmapImageId(map.frames[k].id); };
  ASSERT_TRUE(table.contains({number(0), number(1)}));
  for (const auto& [pair, row] : table) {
    const FrameId id_i{pair.first - 1};
    const FrameId id_j{pair.second - 1};
    const bool is_turn = pair == std::pair(number(0), number(1));
    if (pair == std::pair(number(2), number(3))) {
      EXPECT_EQ(row.config, 5);  // the view-graph said so
      continue;
    }
    EXPECT_EQ(row.config, is_turn ? 5 : 2);
    ASSERT_EQ(row.matches.size(), 2 * static_cast<std::size_t>(row.rows));
    EXPECT_EQ(row.E.empty(), is_turn);
    EXPECT_EQ(row.F.empty(), is_turn);
    EXPECT_EQ(row.H.empty(), !is_turn);
    const Eigen::Vector3d t(row.tvec[0], row.tvec[1], row.tvec[2]);
    const Eigen::Quaterniond q(row.qvec[0], row.qvec[1], row.qvec[2], row.qvec[3]);
    EXPECT_NEAR(q.norm(), 1.0, 1e-12);
    EXPECT_NEAR(t.norm(), is_turn ? 0.0 : 1.0, 1e-12);
    int num_close = 0;
    for (std::size_t k = 0; k < row.matches.size(); k += 2) {
      const auto pixel = [&](FrameId frame, std::uint32_t keypoint) -> Eigen::Vector3d {
        const MapKeypoint& place = keypoints.at(frame).at(keypoint);
        const Eigen::Vector2d& px =
            map.tracks[place.track].track.observations[place.observation].keypoint_px;
        return {px.x() + 0.5, px.y() + 0.5, 1.0};
      };
      const Eigen::Vector3d x_i = pixel(id_i, row.matches[k]);
      const Eigen::Vector3d x_j = pixel(id_j, row.matches[k + 1]);
      if (is_turn) {
        const Eigen::Vector3d turned = FromRows(row.H) * x_i;
        num_close += (turned.hnormalized() - x_j.hnormalized()).norm() < 4.5;
      } else {
        const Eigen::Vector3d line = FromRows(row.F) * x_i;
        num_close += std::abs(x_j.dot(line)) / line.head<2>().norm() < 5.0;
      }
    }
    EXPECT_EQ(num_close, row.rows);
    if (!is_turn) {
      EXPECT_LT((FromRows(row.E) - Skew(t) * q.toRotationMatrix()).norm(), 1e-12);
    }
  }
  // Wrong sightings are matches, but belong to no geometry.
  int num_raw = 0;
  for (const Row& row : Query(file, "SELECT rows FROM matches")) num_raw += std::stoi(row[0]);
  int num_verified = 0;
  for (const auto& [pair, row] : table) num_verified += row.rows;
  EXPECT_LT(num_verified, 0.95 * num_raw);
  EXPECT_GT(num_verified, 0.6 * num_raw);
}

TEST(ColmapDatabase, NoGeometryHoldsMatchesThatTheirPointRefutes) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "database.db";
  RunMap map = MapOfScene(ExportScene());
  const auto entry = std::find_if(map.tracks.begin(), map.tracks.end(), [](const MapTrack& track) {
    return std::count(track.fits.begin(), track.fits.end(), true) > 3;
  });
  ASSERT_NE(entry, map.tracks.end());
  entry->fits.front() = false;
  const int refuted = static_cast<int>(entry - map.tracks.begin());
  WriteColmapDatabase(file, map, {});
  const auto keypoints = ListKeypoints(map);
  // Matches of the track, and those of them with its first observation.
  const auto count = [&](const std::string& table) {
    std::pair<int, int> counts;
    for (const Row& row : Query(file, "SELECT pair_id, data FROM " + table)) {
      const auto [frame_i, frame_j] = FramesOf(row[0]);
      const auto& list_i = keypoints.at(frame_i);
      const auto& list_j = keypoints.at(frame_j);
      const std::vector<std::uint32_t> matches = Numbers<std::uint32_t>(row[1]);
      for (std::size_t k = 0; k + 1 < matches.size(); k += 2) {
        const MapKeypoint& i = list_i.at(matches[k]);
        const MapKeypoint& j = list_j.at(matches[k + 1]);
        if (i.track != refuted) continue;
        ++counts.first;
        counts.second += i.observation == 0 || j.observation == 0;
      }
    }
    return counts;
  };
  const int num_seen = static_cast<int>(entry->fits.size());
  EXPECT_EQ(count("matches").second, num_seen - 1);
  EXPECT_EQ(count("two_view_geometries"), std::pair((num_seen - 1) * (num_seen - 2) / 2, 0));
}

// Keypoints 1, 2 ... of the first two frames, which no track has.
ViewGraphMatches NewMatches(const RunMap& map, int count) {
  ViewGraphMatches matches;
  MatchedPair& pair = matches.pairs.emplace_back();
  pair.i = map.frames[0].id;
  pair.j = map.frames[1].id;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector2d pixel(10.25 + 3 * k, 20.5 + k);
    const Eigen::Vector3d bearing = map.camera.Unproject(pixel).value();
    const Rotation turn = map.frames[1].cam_from_world * map.frames[0].cam_from_world.Inverse();
    matches.keypoints_px[pair.i].emplace_back(pixel.cast<float>());
    matches.keypoints_px[pair.j].emplace_back(map.camera.Project(turn * bearing)->cast<float>());
    pair.matches.push_back({k, k});
  }
  return matches;
}

TEST(ColmapDatabase, HasTheMatchesOfTheViewGraphThatBecameNoTracks) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "database.db";
  RunMap map = MapOfScene(ExportScene());
  map.tracks.clear();
  map.frames[1].center_in_world = map.frames[0].center_in_world;
  const ViewGraphMatches matches = NewMatches(map, 20);
  AddKeypoints(matches, map);
  WriteColmapDatabase(file, map, matches);
  const PairTable table = ReadPairs(file);
  ASSERT_EQ(table.size(), 1u);
  const auto& [pair, row] = *table.begin();
  EXPECT_EQ(pair, std::pair(ColmapImageId(map.frames[0].id), ColmapImageId(map.frames[1].id)));
  EXPECT_EQ(row.rows, 20);
  EXPECT_EQ(row.config, 5);  // PANORAMIC
  const std::vector<Row> keypoints = Query(file, "SELECT rows FROM keypoints ORDER BY image_id");
  EXPECT_EQ(keypoints[0][0], "20");
  EXPECT_EQ(keypoints[2][0], "0");
  // The model counts the same keypoints.
  WriteColmapModel(folder.path() / "sparse", map, ColmapForm::kText);
  EXPECT_EQ(ListKeypoints(map).at(map.frames[0].id).size(), 20u);
}

TEST(ColmapDatabase, TakesAMatchOfATrackOnce) {
  const TemporaryFolder folder;
  RunMap map = MapOfScene(ExportScene());
  ViewGraphMatches matches;
  MatchedPair& pair = matches.pairs.emplace_back();
  pair.i = map.frames[0].id;
  pair.j = map.frames[1].id;
  for (const MapTrack& entry : map.tracks) {
    const auto& seen = entry.track.observations;
    if (seen.size() < 2 || seen[0].frame != pair.i || seen[1].frame != pair.j) continue;
    const int number = static_cast<int>(pair.matches.size());
    matches.keypoints_px[pair.i].emplace_back(seen[0].keypoint_px.cast<float>());
    matches.keypoints_px[pair.j].emplace_back(seen[1].keypoint_px.cast<float>());
    pair.matches.push_back({number, number});
  }
  ASSERT_GT(pair.matches.size(), 50u);
  AddKeypoints(matches, map);
  WriteColmapDatabase(folder.path() / "without.db", map, {});
  WriteColmapDatabase(folder.path() / "with.db", map, matches);
  const std::string rows = "SELECT pair_id, rows FROM matches ORDER BY pair_id";
  EXPECT_EQ(Query(folder.path() / "with.db", rows), Query(folder.path() / "without.db", rows));
}

TEST(ColmapDatabase, IsTheSameFileEveryTimeAndReplacesAnOlderOne) {
  const TemporaryFolder folder;
  const RunMap map = MapOfScene(ExportScene());
  folder.Write("b.db", "an older file");
  WriteColmapDatabase(folder.path() / "a.db", map, {});
  WriteColmapDatabase(folder.path() / "b.db", map, {});
  EXPECT_EQ(ReadWholeFile(folder.path() / "a.db"), ReadWholeFile(folder.path() / "b.db"));
  EXPECT_THAT(RuntimeErrorOf([&] { WriteColmapDatabase(folder.path() / "no" / "a.db", map, {}); }),
              HasSubstr("a.db: cannot write the file"));
  ColmapDatabaseOptions options;
  options.min_matches = 0;
  EXPECT_THROW(WriteColmapDatabase(folder.path() / "c.db", map, {}, options),
               std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
