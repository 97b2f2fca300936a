#include "output/export/colmap_database.h"

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <sqlite3.h>

#include "output/export/colmap_model.h"
#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"
#include "output/map/frame_cameras.h"
#include "output/map/map_keypoints.h"
#include "rotodom/types/options.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr int kCalibrated = 2;
constexpr int kPanoramic = 5;
// COLMAP's number for a pair of images is this times the smaller id, plus the larger one.
constexpr std::int64_t kPairFactor = 2147483647;

// The tables of COLMAP 3.8, which tells its version by 3800.
constexpr const char* kTables = R"(
PRAGMA user_version = 3800;
CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE,
  camera_id INTEGER NOT NULL, prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL,
  prior_tx REAL, prior_ty REAL, prior_tz REAL,
  CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB,
  qvec BLOB, tvec BLOB);
)";

class Database {
 public:
  explicit Database(const fs::path& path) {
    const int status = sqlite3_open(path.c_str(), &handle_);
    if (status == SQLITE_OK) return;
    const std::string reason = sqlite3_errmsg(handle_);
    sqlite3_close(handle_);
    throw std::runtime_error(path.string() + ": " + reason);
  }
  ~Database() { sqlite3_close(handle_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void Execute(const char* sql) { Check(sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr)); }
  void Check(int status) const {
    if (status == SQLITE_OK || status == SQLITE_DONE || status == SQLITE_ROW) return;
    throw std::runtime_error(std::string("SQLite: ") + sqlite3_errmsg(handle_));
  }
  sqlite3* handle() const { return handle_; }

 private:
  sqlite3* handle_ = nullptr;
};

// One INSERT, run once per row.
class Insertion {
 public:
  Insertion(const Database& database, const char* sql) : database_(database) {
    database.Check(sqlite3_prepare_v2(database.handle(), sql, -1, &statement_, nullptr));
  }
  ~Insertion() { sqlite3_finalize(statement_); }
  Insertion(const Insertion&) = delete;
  Insertion& operator=(const Insertion&) = delete;

  Insertion& Integer(std::int64_t value) {
    database_.Check(sqlite3_bind_int64(statement_, ++column_, value));
    return *this;
  }
  Insertion& Text(const std::string& value) {
    database_.Check(sqlite3_bind_text(
        statement_, ++column_, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT));
    return *this;
  }
  Insertion& Blob(const BinaryWriter& writer) {
    const std::string& bytes = writer.bytes();
    database_.Check(
        sqlite3_bind_blob64(statement_, ++column_, bytes.data(), bytes.size(), SQLITE_TRANSIENT));
    return *this;
  }
  Insertion& Null() {
    database_.Check(sqlite3_bind_null(statement_, ++column_));
    return *this;
  }
  void Run() {
    database_.Check(sqlite3_step(statement_));
    database_.Check(sqlite3_reset(statement_));
    column_ = 0;
  }

 private:
  const Database& database_;
  sqlite3_stmt* statement_ = nullptr;
  int column_ = 0;
};

BinaryWriter RowMajor(const Eigen::Matrix3d& matrix) {
  BinaryWriter writer;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) writer.Put(matrix(row, column));
  }
  return writer;
}

// Two keypoints of one scene point.
struct Match {
  std::uint32_t keypoint_i = 0;
  std::uint32_t keypoint_j = 0;
  Eigen::Vector3d bearing_i;
  Eigen::Vector3d bearing_j;
  bool is_refuted = false;   // by the track's point, which fits one of the two
  bool is_verified = false;  // by the view-graph
};
using PairMatches = std::map<std::pair<FrameId, FrameId>, std::vector<Match>>;

// Those that are in one track.
PairMatches ListTrackMatches(const RunMap& map) {
  const std::vector<std::vector<int>> numbers = NumberKeypoints(map);
  PairMatches matches;
  for (std::size_t t = 0; t < numbers.size(); ++t) {
    const std::vector<Observation>& seen = map.tracks[t].track.observations;
    const std::vector<bool>& fits = map.tracks[t].fits;
    for (std::size_t a = 0; a < seen.size(); ++a) {
      for (std::size_t b = a + 1; b < seen.size(); ++b) {
        matches[{seen[a].frame, seen[b].frame}].push_back(
            {static_cast<std::uint32_t>(numbers[t][a]),
             static_cast<std::uint32_t>(numbers[t][b]),
             seen[a].bearing,
             seen[b].bearing,
             fits[a] != fits[b]});
      }
    }
  }
  return matches;
}

// The number of the keypoint at a pixel, by frame; of several the first.
using NumberAtPixel = std::map<FrameId, std::map<std::pair<float, float>, std::uint32_t>>;

NumberAtPixel ListPixels(const RunMap& map) {
  NumberAtPixel number_at;
  for (const auto& [frame, list] : ListKeypoints(map)) {
    auto& of_frame = number_at[frame];
    for (std::size_t k = 0; k < list.size(); ++k) {
      const Eigen::Vector2f pixel = map.tracks[list[k].track]
                                        .track.observations[list[k].observation]
                                        .keypoint_px.cast<float>();
      of_frame.try_emplace({pixel.x(), pixel.y()}, static_cast<std::uint32_t>(k));
    }
  }
  return number_at;
}

// Adds the view-graph's matches of a pair; those that are in a track become verified.
void AddVerified(const RunMap& map,
                 const ViewGraphMatches& view_graph,
                 const MatchedPair& pair,
                 const NumberAtPixel& number_at,
                 std::vector<Match>& matches) {
  std::map<std::uint32_t, std::size_t> match_of_i;
  std::set<std::uint32_t> taken_j;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    match_of_i[matches[k].keypoint_i] = k;
    taken_j.insert(matches[k].keypoint_j);
  }
  const auto find = [&](FrameId frame, int keypoint) {
    const Eigen::Vector2f& pixel = view_graph.keypoints_px.at(frame)[keypoint];
    const auto& of_frame = number_at.at(frame);
    const auto number = of_frame.find({pixel.x(), pixel.y()});
    const auto bearing = CameraOf(map, frame).Unproject(pixel.cast<double>());
    return number == of_frame.end() || !bearing
               ? std::nullopt
               : std::optional(std::pair(number->second, *bearing));
  };
  for (const auto& [at_i, at_j] : pair.matches) {
    const auto keypoint_i = find(pair.i, at_i);
    const auto keypoint_j = find(pair.j, at_j);
    if (!keypoint_i || !keypoint_j) continue;
    const auto known = match_of_i.find(keypoint_i->first);
    if (known != match_of_i.end()) {
      // A keypoint that is matched otherwise stays as it is.
      Match& match = matches[known->second];
      match.is_verified = match.is_verified || match.keypoint_j == keypoint_j->first;
    } else if (taken_j.insert(keypoint_j->first).second) {
      matches.push_back(
          {keypoint_i->first, keypoint_j->first, keypoint_i->second, keypoint_j->second});
      matches.back().is_verified = true;
    }
  }
}

PairMatches ListMatches(const RunMap& map, const ViewGraphMatches& view_graph) {
  PairMatches matches = ListTrackMatches(map);
  const NumberAtPixel number_at = ListPixels(map);
  for (const MatchedPair& pair : view_graph.pairs) {
    if (!number_at.contains(pair.i) || !number_at.contains(pair.j)) continue;
    AddVerified(map, view_graph, pair, number_at, matches[{pair.i, pair.j}]);
  }
  return matches;
}

// How the second frame of a pair stands to the first.
struct PairPose {
  Rotation j_from_i;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // unit, or zero
  bool is_panoramic = false;

  Eigen::Matrix3d Essential() const { return Skew(translation) * j_from_i.Matrix(); }

  // Angle, about, between a match and this geometry; rad.
  double Error(const Match& match) const {
    const Eigen::Vector3d turned = j_from_i * match.bearing_i;
    if (is_panoramic) return turned.cross(match.bearing_j).norm();
    const double volume = std::abs(translation.dot(turned.cross(match.bearing_j)));
    const double baseline_sine =
        std::min(translation.cross(turned).norm(), translation.cross(match.bearing_j).norm());
    return baseline_sine > 0.0 ? volume / baseline_sine : 0.0;
  }
};

PairPose PoseOfPair(const MapFrame& i, const MapFrame& j, bool rotation_only) {
  PairPose pose;
  pose.j_from_i = j.cam_from_world * i.cam_from_world.Inverse();
  const Eigen::Vector3d baseline = j.cam_from_world * (i.center_in_world - j.center_in_world);
  pose.is_panoramic = rotation_only || baseline.norm() == 0.0;
  if (!pose.is_panoramic) pose.translation = baseline.normalized();
  return pose;
}

Eigen::Matrix3d Intrinsics(const Camera& camera) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = camera.fx;
  K(1, 1) = camera.fy;
  K(0, 2) = camera.cx + 0.5;
  K(1, 2) = camera.cy + 0.5;
  return K;
}

void InsertImages(const Database& database, const RunMap& map) {
  const auto keypoints = ListKeypoints(map);
  const CameraList cameras = ListCameras(map);
  for (std::size_t k = 0; k < cameras.cameras.size(); ++k) {
    const ColmapCamera camera = ToColmap(cameras.cameras[k]);
    BinaryWriter parameters;
    for (const double value : camera.parameters) parameters.Put(value);
    Insertion(database, "INSERT INTO cameras VALUES (?, ?, ?, ?, ?, 1)")
        .Integer(static_cast<std::int64_t>(kColmapCameraId + k))
        .Integer(camera.model_id)
        .Integer(cameras.cameras[k].width)
        .Integer(cameras.cameras[k].height)
        .Blob(parameters)
        .Run();
  }
  Insertion image(database, "INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?)");
  Insertion corners(database, "INSERT INTO keypoints VALUES (?, ?, 2, ?)");
  for (const MapFrame& frame : map.frames) {
    image.Integer(ColmapImageId(frame.id))
        .Text(frame.image)
        .Integer(kColmapCameraId + cameras.of_frame.at(frame.id))
        .Run();
    BinaryWriter pixels;
    const std::vector<MapKeypoint>& list = keypoints.at(frame.id);
    for (const MapKeypoint& keypoint : list) {
      const Eigen::Vector2d& keypoint_px =
          map.tracks[keypoint.track].track.observations[keypoint.observation].keypoint_px;
      pixels.Put(static_cast<float>(keypoint_px.x() + 0.5));
      pixels.Put(static_cast<float>(keypoint_px.y() + 0.5));
    }
    corners.Integer(ColmapImageId(frame.id))
        .Integer(static_cast<std::int64_t>(list.size()))
        .Blob(pixels)
        .Run();
  }
}

// The matches of a pair as COLMAP has them, and how many there are.
struct MatchTable {
  BinaryWriter numbers;
  int rows = 0;

  void Add(const Match& match) {
    numbers.Put(match.keypoint_i);
    numbers.Put(match.keypoint_j);
    ++rows;
  }
};

// Its columns behind `config`.
void InsertGeometry(const PairPose& pose,
                    const Camera& camera_i,
                    const Camera& camera_j,
                    Insertion& row) {
  const bool is_undistorted = camera_i.model == CameraModel::kPinhole;
  const Eigen::Matrix3d K_i_inverse = Intrinsics(camera_i).inverse();
  const Eigen::Matrix3d K_j = Intrinsics(camera_j);
  const Eigen::Matrix3d E = pose.Essential();
  const Eigen::Matrix3d H = K_j * pose.j_from_i.Matrix() * K_i_inverse;
  const bool has_f = is_undistorted && !pose.is_panoramic;
  const bool has_h = is_undistorted && pose.is_panoramic;
  has_f ? row.Blob(RowMajor(K_j.inverse().transpose() * E * K_i_inverse)) : row.Null();
  pose.is_panoramic ? row.Null() : row.Blob(RowMajor(E));
  has_h ? row.Blob(RowMajor(H)) : row.Null();
  const Eigen::Quaterniond& q = pose.j_from_i.Quaternion();
  BinaryWriter qvec;
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) qvec.Put(value);
  BinaryWriter tvec;
  for (const double value : pose.translation) tvec.Put(value);
  row.Blob(qvec).Blob(tvec);
}

void InsertPairs(const Database& database,
                 const RunMap& map,
                 const ViewGraphMatches& view_graph,
                 const ColmapDatabaseOptions& options) {
  std::map<FrameId, const MapFrame*> frames;
  for (const MapFrame& frame : map.frames) frames[frame.id] = &frame;
  std::set<std::pair<FrameId, FrameId>> rotation_only;
  for (const MapEdge& edge : map.edges) {
    if (edge.rotation_only) rotation_only.insert(std::minmax(edge.i, edge.j));
  }
  const double max_error = options.max_error_px / map.camera.MeanFocal();

  Insertion raw(database, "INSERT INTO matches VALUES (?, ?, 2, ?)");
  Insertion verified(database, "INSERT INTO two_view_geometries VALUES (?,?,2,?,?,?,?,?,?,?)");
  for (const auto& [pair, matches] : ListMatches(map, view_graph)) {
    if (static_cast<int>(matches.size()) < options.min_matches) continue;
    const PairPose pose =
        PoseOfPair(*frames.at(pair.first), *frames.at(pair.second), rotation_only.contains(pair));
    MatchTable all;
    MatchTable good;
    for (const Match& match : matches) {
      all.Add(match);
      if (match.is_refuted) continue;
      if (match.is_verified || pose.Error(match) <= max_error) good.Add(match);
    }
    const std::int64_t pair_id =
        kPairFactor * ColmapImageId(pair.first) + ColmapImageId(pair.second);
    raw.Integer(pair_id).Integer(all.rows).Blob(all.numbers).Run();
    if (good.rows < options.min_matches) continue;

    verified.Integer(pair_id).Integer(good.rows).Blob(good.numbers);
    verified.Integer(pose.is_panoramic ? kPanoramic : kCalibrated);
    InsertGeometry(pose, CameraOf(map, pair.first), CameraOf(map, pair.second), verified);
    verified.Run();
  }
}

}  // namespace

std::optional<std::string> ColmapDatabaseOptions::Problem() const {
  if (min_matches < 1) return OutOfRange("min_matches", min_matches, "one or more");
  if (!(max_error_px > 0.0)) return OutOfRange("max_error_px", max_error_px, "above zero");
  return std::nullopt;
}

void WriteColmapDatabase(const fs::path& path,
                         const RunMap& map,
                         const ViewGraphMatches& view_graph,
                         const ColmapDatabaseOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("WriteColmapDatabase: " + *problem);
  }
  ReplaceFile(path, [&](const fs::path& temporary) {
    std::error_code error;
    fs::remove(temporary, error);
    try {
      Database database(temporary);
      // The file is not there under its name until it is whole: no need for SQLite's own safety.
      database.Execute("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;");
      database.Execute(kTables);
      database.Execute("BEGIN");
      InsertImages(database, map);
      InsertPairs(database, map, view_graph, options);
      database.Execute("COMMIT");
    } catch (const std::runtime_error& failure) {
      throw std::runtime_error(path.string() + ": cannot write the file: " + failure.what());
    }
  });
}

}  // namespace rotslam
