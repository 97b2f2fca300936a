#include "output/export/known_rotation_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>

#include "output/export/colmap_model.h"
#include "output/files/atomic_file.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMagic = "rotslam_known_rotation";

// Rows of a file, taken one by one, their words likewise.
class RowReader {
 public:
  explicit RowReader(const fs::path& path) : path_(path), rows_(ReadTextRows(path)) {}

  std::size_t RowsLeft() const { return rows_.size() - next_; }
  const TextRow& Peek() const {
    if (RowsLeft() == 0) Fail("the file ends too early");
    return rows_[next_];
  }
  void Next() {
    Peek();
    row_ = &rows_[next_++];
    word_ = 0;
  }
  std::size_t WordsLeft() const { return row_->words.size() - word_; }
  const std::string& Word() {
    if (WordsLeft() == 0) Fail("the line ends too early");
    return row_->words[word_++];
  }
  double Number() { return NumberAt(path_, *row_, word_++); }
  int Integer(const char* name, double low) {
    const double value = Number();
    if (value != std::floor(value) || value < low || value > 2147483647.0) {
      Fail(std::string(name) + " is " + row_->words[word_ - 1] + ", must be a whole number from " +
           FormatNumber("%.0f", low) + " on");
    }
    return static_cast<int>(value);
  }
  // A whole number from 0 on, up to 2^64 - 1.
  std::uint64_t Id(const char* name) {
    const std::string& word = Word();
    std::uint64_t value = 0;
    const char* const end = word.data() + word.size();
    const char* const begin = word.data() + (word.starts_with('+') ? 1 : 0);
    const auto [stop, code] = std::from_chars(begin, end, value);
    if (code != std::errc() || stop != end) {
      Fail(std::string(name) + " is " + word + ", must be a whole number from 0 on");
    }
    return value;
  }
  // A count of rows to come.
  std::size_t Count(const char* name, std::size_t rows_each) {
    const auto count = static_cast<std::size_t>(Integer(name, 0.0));
    if (count * rows_each > RowsLeft()) {
      Fail("says " + std::to_string(count) + " " + name + ", but the file has only " +
           std::to_string(RowsLeft()) + " lines more");
    }
    return count;
  }
  void Expect(const std::string& word) {
    const std::string& found = Word();
    if (found != word) Fail("expected \"" + word + "\", found \"" + found + "\"");
  }
  [[noreturn]] void Fail(const std::string& reason) const {
    const int line = row_ != nullptr ? row_->line : 1;
    throw std::runtime_error(AtLine(path_, line, reason));
  }

 private:
  fs::path path_;
  std::vector<TextRow> rows_;
  std::size_t next_ = 0;
  const TextRow* row_ = nullptr;
  std::size_t word_ = 0;
};

// How many coefficients the camera's line has: five, as for the models of version 0.1.0, or more
// where the model has more. All eight are read for every model, too.
std::size_t NumCoefficients(CameraModel model) {
  return std::max<std::size_t>(5, DistortionNames(model).size());
}

Camera ReadCameraRow(RowReader& reader) {
  reader.Next();
  reader.Expect("camera");
  Camera camera;
  const std::string model = reader.Word();
  const auto found = FindCameraModel(model);
  if (!found) reader.Fail("model is \"" + model + "\", must be one of " + CameraModelNames());
  camera.model = *found;
  camera.width = reader.Integer("width", 0.0);
  camera.height = reader.Integer("height", 0.0);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = reader.Number();
  const std::size_t least = NumCoefficients(camera.model);
  const std::size_t count = reader.WordsLeft() > least ? camera.distortion.size() : least;
  for (std::size_t k = 0; k < count; ++k) camera.distortion[k] = reader.Number();
  if (reader.WordsLeft() > 0) reader.Fail("the line goes on behind the distortion");
  if (const auto problem = camera.Problem()) reader.Fail("camera: " + *problem);
  return camera;
}

// Numbers for the ids of a file: themselves where all are below 2^31 - 1, else from 0 on.
template <class OurId>
std::map<std::uint64_t, OurId> NumberIds(const std::set<std::uint64_t>& ids,
                                         std::map<OurId, std::string>& name) {
  std::map<std::uint64_t, OurId> numbers;
  const bool fit = ids.empty() || *ids.rbegin() < static_cast<std::uint64_t>(
                                                      std::numeric_limits<std::int32_t>::max());
  for (const std::uint64_t id : ids) {
    const OurId number{fit ? static_cast<int>(id) : static_cast<int>(numbers.size())};
    numbers[id] = number;
    if (!fit) name[number] = std::to_string(id);
  }
  return numbers;
}

struct ViewRow {
  std::uint64_t id = 0;
  double timestamp_s = 0.0;
  Rotation world_from_cam;
  double sigma_deg = 0.0;
};

ViewRow ReadViewRow(RowReader& reader) {
  reader.Next();
  ViewRow row;
  row.id = reader.Id("view");
  row.timestamp_s = reader.Number();
  Eigen::Vector4d q;
  for (int k = 0; k < 4; ++k) q[k] = reader.Number();
  if (!IsUnitLength(q.norm())) reader.Fail("the quaternion is not of length 1");
  row.sigma_deg = reader.Number();
  if (row.sigma_deg < 0.0) reader.Fail("sigma is negative");
  row.world_from_cam = Rotation(Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
  return row;
}

// @return  the numbers of the views, by id.
std::map<std::uint64_t, FrameId> ReadViewRows(RowReader& reader, KnownRotationInput& input) {
  std::vector<ViewRow> rows;
  std::set<std::uint64_t> ids;
  for (std::size_t left = reader.Count("views", 1); left > 0; --left) {
    rows.push_back(ReadViewRow(reader));
    if (!ids.insert(rows.back().id).second) {
      reader.Fail("view " + std::to_string(rows.back().id) + " is there twice");
    }
  }
  std::map<std::uint64_t, FrameId> numbers = NumberIds(ids, input.view_name);
  for (const ViewRow& row : rows) {
    const FrameId view = numbers.at(row.id);
    input.cam_from_world[view] = row.world_from_cam.Inverse();
    input.timestamp_s[view] = row.timestamp_s;
    if (row.sigma_deg > 0.0) input.sigma_rad[view] = row.sigma_deg * kRadFromDeg;
  }
  return numbers;
}

// @return  the track's id; that of the track itself is not set.
std::uint64_t ReadTrackRow(RowReader& reader,
                           const std::map<std::uint64_t, FrameId>& views,
                           KnownRotationInput& input) {
  reader.Next();
  Track track;
  const std::uint64_t id = reader.Id("track");
  for (std::uint8_t& value : track.rgb) {
    const int grey = reader.Integer("colour", 0.0);
    if (grey > 255) reader.Fail("a colour is above 255");
    value = static_cast<std::uint8_t>(grey);
  }
  const int count = reader.Integer("count", 0.0);
  if (reader.WordsLeft() != 4 * static_cast<std::size_t>(count)) {
    reader.Fail("says " + std::to_string(count) + " observations, but has " +
                std::to_string(reader.WordsLeft()) + " words for them instead of four each");
  }
  for (int k = 0; k < count; ++k) {
    Observation observation;
    const std::uint64_t view = reader.Id("view");
    observation.keypoint_px.x() = reader.Number();
    observation.keypoint_px.y() = reader.Number();
    observation.sigma_px = reader.Number();
    if (!(observation.sigma_px > 0.0)) reader.Fail("sigma_px must be positive");
    const auto number = views.find(view);
    if (number == views.end()) {
      reader.Fail("view " + std::to_string(view) + " is not among the views");
    }
    observation.frame = number->second;
    const auto bearing = input.camera.Unproject(observation.keypoint_px);
    if (!bearing) continue;
    observation.bearing = *bearing;
    track.observations.push_back(observation);
  }
  input.tracks.push_back(std::move(track));
  return id;
}

void ReadTrackRows(RowReader& reader,
                   const std::map<std::uint64_t, FrameId>& views,
                   KnownRotationInput& input) {
  const std::size_t num_tracks = reader.Count("tracks", 1);
  input.tracks.reserve(num_tracks);
  std::vector<std::uint64_t> ids;
  std::set<std::uint64_t> different;
  for (std::size_t left = num_tracks; left > 0; --left) {
    ids.push_back(ReadTrackRow(reader, views, input));
    if (!different.insert(ids.back()).second) {
      reader.Fail("track " + std::to_string(ids.back()) + " is there twice");
    }
  }
  const std::map<std::uint64_t, TrackId> numbers = NumberIds(different, input.track_name);
  for (std::size_t k = 0; k < ids.size(); ++k) input.tracks[k].id = numbers.at(ids[k]);
}

// Makes one of two observations of a track in a view.
void MergeDoubles(KnownRotationInput& input) {
  constexpr double kSamePlacePx = 1.0;
  int num_merged = 0;
  int num_apart = 0;
  std::string first;
  for (Track& track : input.tracks) {
    std::map<FrameId, std::vector<std::size_t>> by_view;
    for (std::size_t k = 0; k < track.observations.size(); ++k) {
      by_view[track.observations[k].frame].push_back(k);
    }
    if (by_view.size() == track.observations.size()) continue;
    std::vector<Observation> merged;
    for (std::size_t k = 0; k < track.observations.size(); ++k) {
      const std::vector<std::size_t>& same = by_view.at(track.observations[k].frame);
      if (same.front() != k) continue;
      Observation one = track.observations[k];
      if (same.size() == 1) {
        merged.push_back(one);
        continue;
      }
      if (first.empty()) first = NameOf(input, track.id) + " in view " + NameOf(input, one.frame);
      Eigen::Vector2d mean_px = Eigen::Vector2d::Zero();
      double spread_px = 0.0;
      for (const std::size_t other : same) {
        const Observation& observation = track.observations[other];
        mean_px += observation.keypoint_px / static_cast<double>(same.size());
        spread_px = std::max(spread_px, (observation.keypoint_px - one.keypoint_px).norm());
        one.sigma_px = std::min(one.sigma_px, observation.sigma_px);
      }
      const auto bearing = input.camera.Unproject(mean_px);
      if (spread_px > kSamePlacePx || !bearing) {
        ++num_apart;
        continue;
      }
      ++num_merged;
      one.keypoint_px = mean_px;
      one.bearing = *bearing;
      merged.push_back(one);
    }
    track.observations = std::move(merged);
  }
  if (num_merged + num_apart == 0) return;
  std::string note = std::to_string(num_merged + num_apart) +
                     " times a track has several observations in a view, first track " + first +
                     ": " + std::to_string(num_merged) + " merged";
  if (num_apart > 0) {
    note += ", " + std::to_string(num_apart) + " left out, since they are apart";
  }
  input.notes.push_back(std::move(note));
}

KnownRotationInput ReadOurs(const fs::path& path) {
  KnownRotationInput input;
  input.format = "rotslam";
  RowReader reader(path);
  reader.Next();
  reader.Expect(kMagic);
  if (reader.Integer("version", 0.0) != 1) reader.Fail("the version is not 1");
  input.camera = ReadCameraRow(reader);
  reader.Next();
  reader.Expect("views");
  const std::map<std::uint64_t, FrameId> views = ReadViewRows(reader, input);
  reader.Next();
  reader.Expect("tracks");
  ReadTrackRows(reader, views, input);
  if (reader.RowsLeft() > 0) {
    reader.Next();
    reader.Fail("there are more lines than the file says it has tracks");
  }
  MergeDoubles(input);
  return input;
}

// BAL ----------------------------------------------------------------------------------------

struct BalObservation {
  int camera = 0;
  int point = 0;
  Eigen::Vector2d xy;  // pixels from the principal point, y up
};

// One camera of the file: turned to our axes, and with its lens.
std::pair<Rotation, Camera> ReadBalCamera(RowReader& reader, const auto& number) {
  double values[9];
  for (double& value : values) value = number();
  Camera camera;
  camera.model = CameraModel::kRadtan;
  camera.fx = camera.fy = values[6];
  camera.distortion = {values[7], values[8]};
  if (const auto problem = camera.Problem()) reader.Fail("camera: " + *problem);
  const Eigen::Vector3d rotation_vector(values[0], values[1], values[2]);
  if (!std::isfinite(rotation_vector.norm())) reader.Fail("a rotation vector is out of range");
  const Rotation half_turn = Rotation::Exp({std::numbers::pi, 0.0, 0.0});
  return {half_turn * Rotation::Exp(rotation_vector), camera};
}

KnownRotationInput ReadBal(const fs::path& path) {
  RowReader reader(path);
  reader.Next();
  const int num_cameras = reader.Integer("the number of cameras", 1.0);
  const int num_points = reader.Integer("the number of points", 0.0);
  const std::size_t num_observations = reader.Count("observations", 1);
  std::vector<BalObservation> observations(num_observations);
  for (BalObservation& observation : observations) {
    reader.Next();
    observation.camera = reader.Integer("camera", 0.0);
    observation.point = reader.Integer("point", 0.0);
    observation.xy.x() = reader.Number();
    observation.xy.y() = reader.Number();
    if (observation.camera >= num_cameras || observation.point >= num_points) {
      reader.Fail("camera or point beyond the number that the first line says");
    }
  }
  // The rest are numbers, commonly one a line.
  const auto number = [&] {
    while (reader.WordsLeft() == 0) reader.Next();
    return reader.Number();
  };
  KnownRotationInput input;
  input.format = "BAL";
  std::vector<Camera> cameras;
  std::vector<double> focals_px;
  for (int k = 0; k < num_cameras; ++k) {
    const auto [cam_from_world, camera] = ReadBalCamera(reader, number);
    input.cam_from_world[FrameId{k}] = cam_from_world;
    cameras.push_back(camera);
    focals_px.push_back(camera.fx);
  }
  input.camera.fx = input.camera.fy = Median(focals_px);
  std::map<int, Track> tracks;
  for (const BalObservation& seen : observations) {
    const Camera& camera = cameras[seen.camera];
    const auto bearing = camera.Unproject({seen.xy.x(), -seen.xy.y()});
    const auto keypoint_px = bearing ? input.camera.Project(*bearing) : std::nullopt;
    if (!keypoint_px) continue;
    tracks[seen.point].observations.push_back(
        {FrameId{seen.camera}, *keypoint_px, *bearing, input.camera.fx / camera.fx});
  }
  for (auto& [point, track] : tracks) {
    track.id = TrackId{point};
    std::sort(track.observations.begin(),
              track.observations.end(),
              [](const Observation& a, const Observation& b) { return a.frame < b.frame; });
    input.tracks.push_back(std::move(track));
  }
  MergeDoubles(input);
  return input;
}

KnownRotationInput FromColmap(std::shared_ptr<const ColmapModel> model) {
  KnownRotationInput input;
  input.format = "COLMAP";
  input.camera = model->camera;
  input.cam_from_world = model->reconstruction.cam_from_world;
  input.tracks = model->reconstruction.tracks;
  for (const auto& [track, id] : model->point_id) {
    if (id != static_cast<std::uint64_t>(track.value)) input.track_name[track] = std::to_string(id);
  }
  if (model->num_doubled > 0) {
    input.notes.push_back("points have a second keypoint in an image " +
                          std::to_string(model->num_doubled) + " times: the first one is kept");
  }
  if (model->HasSeveralCameras()) {
    input.notes.push_back(
        "the images have " + std::to_string(model->cameras.size()) +
        " cameras: they are solved as one without distortion, through their own lenses, "
        "which stay as they are");
  }
  input.colmap = std::move(model);
  return input;
}

bool IsColmapModel(const fs::path& folder) {
  return fs::exists(folder / "images.bin") || fs::exists(folder / "images.txt");
}

}  // namespace

std::string NameOf(const KnownRotationInput& input, FrameId view) {
  const auto name = input.view_name.find(view);
  return name == input.view_name.end() ? std::to_string(view.value) : name->second;
}

std::string NameOf(const KnownRotationInput& input, TrackId track) {
  const auto name = input.track_name.find(track);
  return name == input.track_name.end() ? std::to_string(track.value) : name->second;
}

KnownRotationInput WithViewsInOrder(const KnownRotationInput& input) {
  KnownRotationInput ordered = input;
  ordered.cam_from_world.clear();
  ordered.timestamp_s.clear();
  ordered.sigma_rad.clear();
  ordered.view_name.clear();
  std::map<FrameId, FrameId> number;
  for (const auto& [view, rotation] : input.cam_from_world) {
    const FrameId place{static_cast<int>(number.size())};
    number[view] = place;
    ordered.cam_from_world[place] = rotation;
    const std::string name = NameOf(input, view);
    ordered.view_name[place] = name;
    const auto timestamp = input.timestamp_s.find(view);
    ordered.timestamp_s[place] =
        timestamp == input.timestamp_s.end() ? std::stod(name) : timestamp->second;
    const auto sigma = input.sigma_rad.find(view);
    if (sigma != input.sigma_rad.end()) ordered.sigma_rad[place] = sigma->second;
  }
  for (Track& track : ordered.tracks) {
    std::erase_if(track.observations, [&](const Observation& observation) {
      return !number.contains(observation.frame);
    });
    for (Observation& observation : track.observations) {
      observation.frame = number.at(observation.frame);
    }
  }
  return ordered;
}

KnownRotationInput ReadKnownRotation(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (IsColmapModel(path)) {
      return FromColmap(std::make_shared<const ColmapModel>(ReadColmapModel(path)));
    }
    const fs::path ours = path / "known_rotation.txt";
    if (!fs::exists(ours)) {
      throw std::runtime_error(path.string() +
                               ": holds neither known_rotation.txt, as `rotslam run` leaves it, "
                               "nor a COLMAP model (cameras, images, points3D)");
    }
    return ReadOurs(ours);
  }
  RowReader reader(path);
  if (reader.RowsLeft() == 0) throw std::runtime_error(path.string() + ": is empty");
  if (reader.Peek().words.front() == kMagic) return ReadOurs(path);
  const std::vector<std::string>& words = reader.Peek().words;
  const bool is_bal =
      words.size() == 3 && words.front().find_first_not_of("0123456789") == std::string::npos;
  if (is_bal) return ReadBal(path);
  throw std::runtime_error(path.string() + ": is neither our text (its first word is " + kMagic +
                           ") nor BAL (its first line: cameras points observations)");
}

void WriteKnownRotation(const fs::path& path, const KnownRotationInput& input) {
  std::string text =
      std::string(kMagic) + " 1\n# camera model width height fx fy cx cy distortion\n";
  const auto add = [&](const char* format, double value) {
    text += ' ';
    text += FormatNumber(format, value);
  };
  const Camera& camera = input.camera;
  text += std::string("camera ") + Name(camera.model) + " " + std::to_string(camera.width) + " " +
          std::to_string(camera.height);
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) add("%.17g", value);
  for (std::size_t k = 0; k < NumCoefficients(camera.model); ++k) {
    add("%.17g", camera.distortion[k]);
  }
  text += "\n# view timestamp_s qx qy qz qw (camera to world) sigma_deg\nviews " +
          std::to_string(input.cam_from_world.size()) + "\n";
  for (const auto& [view, cam_from_world] : input.cam_from_world) {
    text += std::to_string(view.value);
    const auto timestamp = input.timestamp_s.find(view);
    add("%.17g", timestamp == input.timestamp_s.end() ? view.value : timestamp->second);
    const Eigen::Vector4d q = cam_from_world.Inverse().Quaternion().coeffs();
    for (int k = 0; k < 4; ++k) add("%.17g", q[k]);
    const auto sigma = input.sigma_rad.find(view);
    add("%.6g", sigma == input.sigma_rad.end() ? 0.0 : sigma->second * kDegFromRad);
    text += '\n';
  }
  text += "# track r g b count, then view x y sigma_px per observation\ntracks " +
          std::to_string(input.tracks.size()) + "\n";
  for (const Track& track : input.tracks) {
    text += std::to_string(track.id.value);
    for (const std::uint8_t value : track.rgb) text += " " + std::to_string(value);
    text += " " + std::to_string(track.observations.size());
    for (const Observation& observation : track.observations) {
      text += "  " + std::to_string(observation.frame.value);
      add("%.4f", observation.keypoint_px.x());
      add("%.4f", observation.keypoint_px.y());
      add("%.6g", observation.sigma_px);
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

}  // namespace rotslam
