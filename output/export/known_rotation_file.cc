#include "output/export/known_rotation_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
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

void ReadViewRow(RowReader& reader, KnownRotationInput& input) {
  reader.Next();
  const FrameId view{reader.Integer("view", 0.0)};
  const double timestamp_s = reader.Number();
  Eigen::Vector4d q;
  for (int k = 0; k < 4; ++k) q[k] = reader.Number();
  if (!IsUnitLength(q.norm())) reader.Fail("the quaternion is not of length 1");
  const double sigma_deg = reader.Number();
  if (sigma_deg < 0.0) reader.Fail("sigma is negative");
  const Rotation world_from_cam(Eigen::Quaterniond(q[3], q[0], q[1], q[2]));
  if (!input.cam_from_world.emplace(view, world_from_cam.Inverse()).second) {
    reader.Fail("view " + std::to_string(view.value) + " is there twice");
  }
  input.timestamp_s[view] = timestamp_s;
  if (sigma_deg > 0.0) input.sigma_rad[view] = sigma_deg * kRadFromDeg;
}

void ReadTrackRow(RowReader& reader, KnownRotationInput& input) {
  reader.Next();
  Track track;
  track.id = TrackId{reader.Integer("track", 0.0)};
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
    observation.frame = FrameId{reader.Integer("view", 0.0)};
    observation.keypoint_px.x() = reader.Number();
    observation.keypoint_px.y() = reader.Number();
    observation.sigma_px = reader.Number();
    if (!(observation.sigma_px > 0.0)) reader.Fail("sigma_px must be positive");
    if (!input.cam_from_world.contains(observation.frame)) {
      reader.Fail("view " + std::to_string(observation.frame.value) + " is not among the views");
    }
    const auto bearing = input.camera.Unproject(observation.keypoint_px);
    if (!bearing) continue;
    observation.bearing = *bearing;
    track.observations.push_back(observation);
  }
  input.tracks.push_back(std::move(track));
}

void RefuseDoubles(const fs::path& path, const std::vector<Track>& tracks) {
  std::set<TrackId> ids;
  for (const Track& track : tracks) {
    const std::string name = "track " + std::to_string(track.id.value);
    if (!ids.insert(track.id).second) {
      throw std::runtime_error(path.string() + ": " + name + " is there twice");
    }
    std::set<FrameId> frames;
    for (const Observation& observation : track.observations) {
      if (frames.insert(observation.frame).second) continue;
      throw std::runtime_error(path.string() + ": " + name + " has two observations in view " +
                               std::to_string(observation.frame.value));
    }
  }
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
  for (std::size_t left = reader.Count("views", 1); left > 0; --left) ReadViewRow(reader, input);
  reader.Next();
  reader.Expect("tracks");
  const std::size_t num_tracks = reader.Count("tracks", 1);
  input.tracks.reserve(num_tracks);
  for (std::size_t left = num_tracks; left > 0; --left) ReadTrackRow(reader, input);
  if (reader.RowsLeft() > 0) {
    reader.Next();
    reader.Fail("there are more lines than the file says it has tracks");
  }
  RefuseDoubles(path, input.tracks);
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
  RefuseDoubles(path, input.tracks);
  return input;
}

bool IsColmapModel(const fs::path& folder) {
  return fs::exists(folder / "images.bin") || fs::exists(folder / "images.txt");
}

}  // namespace

KnownRotationInput ReadKnownRotation(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (IsColmapModel(path)) {
      const ColmapModel model = ReadColmapModel(path);
      KnownRotationInput input{
          "COLMAP", model.camera, model.reconstruction.cam_from_world, {}, {}, {}};
      input.tracks = model.reconstruction.tracks;
      RefuseDoubles(path, input.tracks);
      return input;
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
