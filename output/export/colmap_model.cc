#include "output/export/colmap_model.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "output/files/binary_file.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/camera/colmap_camera.h"
#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct PointTrack {
  std::uint64_t id = 0;
  Eigen::Vector3d point_in_world;
  std::array<std::uint8_t, 3> rgb = {};
  std::vector<std::pair<std::uint64_t, std::uint64_t>> sights;  // image, keypoint
};

[[noreturn]] void Fail(const fs::path& file, const std::string& reason) {
  throw std::runtime_error(file.string() + ": " + reason);
}

int SmallId(const fs::path& file, const char* what, std::uint64_t id) {
  if (id > static_cast<std::uint64_t>(std::numeric_limits<int>::max())) {
    Fail(file, std::string(what) + " " + std::to_string(id) + " is beyond 2^31 - 1");
  }
  return static_cast<int>(id);
}

// Pixels per radian where a camera shows a bearing, the geometric mean over all directions.
double PixelsPerRadian(const Camera& camera, const Eigen::Vector3d& bearing) {
  Eigen::Matrix<double, 2, 3> J;
  if (!camera.Project(bearing, &J)) return camera.MeanFocal();
  return std::sqrt(std::sqrt((J * J.transpose()).determinant()));
}

// The parts of a model, however they were written.
class ModelBuilder {
 public:
  void AddImage(const fs::path& file,
                std::uint64_t id,
                const std::array<double, 7>& qvec_tvec,
                std::string name,
                ColmapImage image) {
    const FrameId frame{SmallId(file, "image", id)};
    const std::string who = "image " + std::to_string(id);
    const Eigen::Quaterniond q(qvec_tvec[0], qvec_tvec[1], qvec_tvec[2], qvec_tvec[3]);
    const Eigen::Vector3d t(qvec_tvec[4], qvec_tvec[5], qvec_tvec[6]);
    if (!q.coeffs().allFinite() || !t.allFinite()) Fail(file, who + ": its pose is not finite");
    if (!IsUnitLength(q.norm())) {
      Fail(file, who + ": its quaternion is not of length 1");
    }
    for (const Eigen::Vector2d& keypoint_px : image.keypoints_px) {
      if (!keypoint_px.allFinite()) Fail(file, who + ": a keypoint is not finite");
    }
    const Rotation cam_from_world(q);
    if (!model_.reconstruction.cam_from_world.emplace(frame, cam_from_world).second) {
      Fail(file, who + " is there twice");
    }
    model_.reconstruction.center_in_world[frame] = -(cam_from_world.Inverse() * t);
    if (!model_.cameras.contains(image.camera)) {
      Fail(file, who + " names camera " + std::to_string(image.camera) + ", which there is not");
    }
    model_.image_name[frame] = std::move(name);
    model_.images[frame] = std::move(image);
  }

  // To be called between images and points.
  void ChooseCamera() {
    if (!model_.HasSeveralCameras()) {
      const bool has_images = !model_.images.empty();
      model_.camera = has_images ? model_.cameras.at(model_.images.begin()->second.camera)
                                 : model_.cameras.begin()->second;
      return;
    }
    std::vector<double> focals_px;
    for (const auto& [frame, image] : model_.images) {
      const Camera& camera = model_.cameras.at(image.camera);
      focals_px.push_back(camera.MeanFocal());
      if (camera.model == CameraModel::kEquidistant || camera.model == CameraModel::kFov) {
        model_.camera.model = CameraModel::kEquidistant;
      }
    }
    model_.camera.fx = model_.camera.fy = Median(std::move(focals_px));
    is_common_ = true;
    ChooseSize();
  }

  void AddPoint(const fs::path& file, const PointTrack& point) {
    const std::string who = "point " + std::to_string(point.id);
    if (!point.point_in_world.allFinite()) Fail(file, who + " is not finite");
    if (!points_.insert(point.id).second) Fail(file, who + " is there twice");
    Track track;
    track.rgb = point.rgb;
    std::map<FrameId, int> keypoint_of;
    for (const auto& [image_id, index] : point.sights) {
      const FrameId frame{SmallId(file, "image", image_id)};
      const auto image = model_.images.find(frame);
      if (image == model_.images.end()) {
        Fail(file, who + " names image " + std::to_string(image_id) + ", which there is not");
      }
      if (index >= image->second.keypoints_px.size()) {
        Fail(file,
             who + " names keypoint " + std::to_string(index) + " of image " +
                 std::to_string(image_id) + ", which has " +
                 std::to_string(image->second.keypoints_px.size()));
      }
      const Camera& camera = model_.cameras.at(image->second.camera);
      Eigen::Vector2d keypoint_px = image->second.keypoints_px[index] - Eigen::Vector2d(0.5, 0.5);
      const auto bearing = camera.Unproject(keypoint_px);
      if (!bearing) continue;
      double sigma_px = 1.0;
      if (is_common_) {
        const auto moved_px = model_.camera.Project(*bearing);
        if (!moved_px) continue;
        keypoint_px = *moved_px;
        sigma_px = PixelsPerRadian(model_.camera, *bearing) / PixelsPerRadian(camera, *bearing);
      }
      if (!keypoint_of.try_emplace(frame, static_cast<int>(index)).second) {
        ++model_.num_doubled;
        continue;
      }
      track.observations.push_back({frame, keypoint_px, *bearing, sigma_px});
    }
    std::sort(track.observations.begin(),
              track.observations.end(),
              [](const Observation& a, const Observation& b) { return a.frame < b.frame; });
    track.id = TrackId{static_cast<int>(model_.reconstruction.tracks.size())};
    model_.point_id[track.id] = point.id;
    std::vector<int>& keypoints = model_.keypoints[track.id];
    for (const auto& [frame, keypoint] : keypoint_of) keypoints.push_back(keypoint);
    model_.reconstruction.point_in_world[track.id] = point.point_in_world;
    model_.reconstruction.tracks.push_back(std::move(track));
  }

  void AddCamera(const fs::path& file, const std::vector<std::string>& words) {
    const Camera camera = ReadColmapCamera(file, words);
    std::int64_t id = 0;
    const std::string& word = words.front();
    const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), id);
    if (code != std::errc() || stop != word.data() + word.size()) {
      Fail(file, "expected a camera's id, found \"" + word + "\"");
    }
    if (!model_.cameras.emplace(id, camera).second)
      Fail(file, "camera " + word + " is there twice");
  }

  bool has_camera() const { return !model_.cameras.empty(); }
  ColmapModel Take() { return std::move(model_); }

 private:
  // Makes the common camera as large as the largest of its images, seen at its focal length.
  void ChooseSize() {
    Camera& common = model_.camera;
    for (const auto& [frame, image] : model_.images) {
      const Camera& camera = model_.cameras.at(image.camera);
      const double scale = common.fx / camera.MeanFocal();
      common.width = std::max(common.width, static_cast<int>(std::ceil(scale * camera.width)));
      common.height = std::max(common.height, static_cast<int>(std::ceil(scale * camera.height)));
    }
    common.cx = 0.5 * (common.width - 1);
    common.cy = 0.5 * (common.height - 1);
  }

  ColmapModel model_;
  bool is_common_ = false;  // keypoints are moved to a camera of all
  std::set<std::uint64_t> points_;
};

void ReadBinaryCameras(const fs::path& file, ModelBuilder& builder) {
  BinaryReader bytes(file);
  for (auto left = bytes.Count("cameras", 24); left > 0; --left) {
    const std::string id = std::to_string(bytes.Get<std::uint32_t>());
    const int model_id = bytes.Get<std::int32_t>();
    const ColmapModelId* model = FindColmapModel(model_id);
    if (model == nullptr) {
      Fail(file,
           "camera " + id + ": its model, number " + std::to_string(model_id) +
               ", is not supported");
    }
    std::vector<std::string> words = {id, model->name};
    for (int k = 0; k < 2; ++k) words.push_back(std::to_string(bytes.Get<std::uint64_t>()));
    for (std::size_t k = 0; k < model->num_parameters; ++k) {
      words.push_back(FormatNumber("%.17g", bytes.Get<double>()));
    }
    builder.AddCamera(file, words);
  }
  bytes.ExpectEnd();
}

void ReadBinaryImages(const fs::path& file, ModelBuilder& builder) {
  BinaryReader bytes(file);
  for (auto left = bytes.Count("images", 73); left > 0; --left) {
    const auto id = bytes.Get<std::uint32_t>();
    std::array<double, 7> pose;
    for (double& value : pose) value = bytes.Get<double>();
    ColmapImage image;
    image.camera = bytes.Get<std::uint32_t>();
    std::string name = bytes.Name();
    const auto count = bytes.Count("keypoints", 24);
    image.keypoints_px.reserve(count);
    for (std::uint64_t k = 0; k < count; ++k) {
      const double x = bytes.Get<double>();
      const double y = bytes.Get<double>();
      bytes.Get<std::uint64_t>();  // its point; the points name their keypoints, too
      image.keypoints_px.emplace_back(x, y);
    }
    builder.AddImage(file, id, pose, std::move(name), std::move(image));
  }
  bytes.ExpectEnd();
}

void ReadBinaryPoints(const fs::path& file, ModelBuilder& builder) {
  BinaryReader bytes(file);
  for (auto left = bytes.Count("points", 51); left > 0; --left) {
    PointTrack point;
    point.id = bytes.Get<std::uint64_t>();
    for (int k = 0; k < 3; ++k) point.point_in_world[k] = bytes.Get<double>();
    for (std::uint8_t& value : point.rgb) value = bytes.Get<std::uint8_t>();
    bytes.Get<double>();  // mean error
    const auto count = bytes.Count("observations", 8);
    point.sights.reserve(count);
    for (std::uint64_t k = 0; k < count; ++k) {
      const auto image = bytes.Get<std::uint32_t>();
      point.sights.emplace_back(image, bytes.Get<std::uint32_t>());
    }
    builder.AddPoint(file, point);
  }
  bytes.ExpectEnd();
}

// Lines without comments, their words at blanks; empty ones stay, since an image without keypoints
// has one.
std::vector<TextRow> TextLines(const fs::path& file) {
  std::vector<TextRow> rows;
  std::istringstream stream(ReadBytes(file));
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (!line.empty() && line.front() == '#') continue;
    std::istringstream words(line);
    rows.push_back({number, {std::istream_iterator<std::string>(words), {}}});
  }
  while (!rows.empty() && rows.back().words.empty()) rows.pop_back();
  return rows;
}

std::uint64_t IdAt(const fs::path& file, const TextRow& row, std::size_t position) {
  const double value = NumberAt(file, row, position);
  if (value < 0.0 || value != std::floor(value) || value > 1e15) {
    throw std::runtime_error(
        AtLine(file, row.line, "expected an id, found \"" + row.words[position] + "\""));
  }
  return static_cast<std::uint64_t>(value);
}

void ReadTextImages(const fs::path& file, ModelBuilder& builder) {
  const std::vector<TextRow> rows = TextLines(file);
  for (std::size_t k = 0; k < rows.size(); k += 2) {
    const TextRow& row = rows[k];
    const std::uint64_t id = IdAt(file, row, 0);
    std::array<double, 7> pose;
    for (std::size_t p = 0; p < pose.size(); ++p) pose[p] = NumberAt(file, row, 1 + p);
    ColmapImage image;
    image.camera = static_cast<std::int64_t>(IdAt(file, row, 8));
    if (k + 1 < rows.size()) {
      const TextRow& keypoints = rows[k + 1];
      if (keypoints.words.size() % 3 != 0) {
        throw std::runtime_error(
            AtLine(file, keypoints.line, "the keypoints are not in groups of x y point"));
      }
      for (std::size_t p = 0; p < keypoints.words.size(); p += 3) {
        image.keypoints_px.emplace_back(NumberAt(file, keypoints, p),
                                        NumberAt(file, keypoints, p + 1));
      }
    }
    builder.AddImage(
        file, id, pose, row.words.size() > 9 ? row.words[9] : std::string(), std::move(image));
  }
}

void ReadTextPoints(const fs::path& file, ModelBuilder& builder) {
  for (const TextRow& row : TextLines(file)) {
    if (row.words.empty()) continue;
    PointTrack point;
    point.id = IdAt(file, row, 0);
    for (int k = 0; k < 3; ++k) point.point_in_world[k] = NumberAt(file, row, 1 + k);
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t value = IdAt(file, row, 4 + k);
      if (value > 255) throw std::runtime_error(AtLine(file, row.line, "a colour is above 255"));
      point.rgb[k] = static_cast<std::uint8_t>(value);
    }
    NumberAt(file, row, 7);
    if (row.words.size() % 2 != 0) {
      throw std::runtime_error(AtLine(file, row.line, "the track is not in pairs image keypoint"));
    }
    for (std::size_t k = 8; k < row.words.size(); k += 2) {
      point.sights.emplace_back(IdAt(file, row, k), IdAt(file, row, k + 1));
    }
    builder.AddPoint(file, point);
  }
}

void ReadTextCameras(const fs::path& file, ModelBuilder& builder) {
  for (const TextRow& row : TextLines(file)) {
    if (row.words.empty()) continue;
    if (row.words.size() < 4) {
      throw std::runtime_error(AtLine(file, row.line, "the line ends too early"));
    }
    builder.AddCamera(file, row.words);
  }
}

}  // namespace

bool ColmapModel::HasSeveralCameras() const {
  return std::any_of(images.begin(), images.end(), [&](const auto& entry) {
    return cameras.at(entry.second.camera) != cameras.at(images.begin()->second.camera);
  });
}

ColmapModel ReadColmapModel(const fs::path& folder) {
  ModelBuilder builder;
  const bool is_binary = fs::exists(folder / "images.bin");
  const std::string ending = is_binary ? ".bin" : ".txt";
  const fs::path cameras = folder / ("cameras" + ending);
  is_binary ? ReadBinaryCameras(cameras, builder) : ReadTextCameras(cameras, builder);
  if (!builder.has_camera()) Fail(cameras, "has no camera");
  const fs::path images = folder / ("images" + ending);
  is_binary ? ReadBinaryImages(images, builder) : ReadTextImages(images, builder);
  builder.ChooseCamera();
  const fs::path points = folder / ("points3D" + ending);
  is_binary ? ReadBinaryPoints(points, builder) : ReadTextPoints(points, builder);
  return builder.Take();
}

}  // namespace rotslam
