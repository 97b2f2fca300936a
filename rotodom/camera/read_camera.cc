#include "rotodom/camera/read_camera.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

namespace rotslam {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const fs::path& file, const std::string& reason) {
  std::string text = file.string() + ": " + reason;
  std::replace(text.begin(), text.end(), '\n', ' ');  // which a word of a YAML file may hold
  throw std::runtime_error(text);
}

std::string Lower(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

double FiniteNumber(const fs::path& file, const std::string& key, const std::string& text) {
  double value = 0.0;
  const char* begin = text.data() + (text.size() > 1 && text.front() == '+' ? 1 : 0);
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(begin, end, value);
  if (text.empty() || result.ec != std::errc() || result.ptr != end || !std::isfinite(value)) {
    Fail(file, key + " is '" + text + "', must be a finite number");
  }
  return value;
}

double PositiveNumber(const fs::path& file, const std::string& key, const std::string& text) {
  const double value = FiniteNumber(file, key, text);
  if (!(value > 0.0)) Fail(file, key + " is '" + text + "', must be positive");
  return value;
}

int PixelCount(const fs::path& file, const std::string& key, const std::string& text) {
  const double value = FiniteNumber(file, key, text);
  if (value < 0.0 || value > 1e6 || value != std::floor(value)) {
    Fail(file, key + " is '" + text + "', must be a whole number of pixels");
  }
  return static_cast<int>(value);
}

// A map of a YAML file, with the place it has there, so that what is wrong can be named.
class Section {
 public:
  Section(fs::path file, const YAML::Node& node, std::string prefix)
      : file_(std::move(file)), node_(node), prefix_(std::move(prefix)) {}

  const fs::path& file() const { return file_; }
  std::string FullKey(const std::string& key) const { return prefix_ + key; }
  bool Has(const std::string& key) const { return Find(key).IsDefined() && !Find(key).IsNull(); }

  std::string Text(const std::string& key) const {
    if (!Has(key)) Fail(file_, FullKey(key) + " is missing");
    const YAML::Node value = Find(key);
    if (!value.IsScalar()) Fail(file_, FullKey(key) + " must be a single value");
    return value.Scalar();
  }
  double Finite(const std::string& key) const {
    return FiniteNumber(file_, FullKey(key), Text(key));
  }
  double Positive(const std::string& key) const {
    return PositiveNumber(file_, FullKey(key), Text(key));
  }
  double FiniteOrZero(const std::string& key) const { return Has(key) ? Finite(key) : 0.0; }
  int PixelsOrZero(const std::string& key) const {
    return Has(key) ? PixelCount(file_, FullKey(key), Text(key)) : 0;
  }

  // The values of a list, as text; empty when the key is missing or empty.
  std::vector<std::string> List(const std::string& key) const {
    std::vector<std::string> values;
    if (!Has(key)) return values;
    const YAML::Node list = Find(key);
    if (!list.IsSequence()) Fail(file_, FullKey(key) + " must be a list: [..]");
    for (const YAML::Node& value : list) {
      if (!value.IsScalar()) Fail(file_, FullKey(key) + " must be a list of numbers");
      values.push_back(value.Scalar());
    }
    return values;
  }

 private:
  YAML::Node Find(const std::string& key) const { return node_[key]; }

  fs::path file_;
  const YAML::Node node_;  // const: looking a key up must not create it
  std::string prefix_;
};

std::array<double, 8> ReadDistortion(const Section& section,
                                     const std::string& key,
                                     CameraModel model) {
  const std::vector<std::string> texts = section.List(key);
  const auto names = DistortionNames(model);
  // OpenCV takes a distortion without k3 as well.
  const bool right_count = texts.size() == names.size() ||
                           (model == CameraModel::kRadtan && texts.size() + 1 == names.size());
  std::array<double, 8> distortion = {};
  for (std::size_t k = 0; k < texts.size(); ++k) {
    const std::string name = section.FullKey(key) + "[" + std::to_string(k) + "]";
    const double value = FiniteNumber(section.file(), name, texts[k]);
    if (k < distortion.size()) distortion[k] = value;
  }
  // Zeros say nothing: pinhole files often carry four of them.
  const bool silent = model == CameraModel::kPinhole && distortion == std::array<double, 8>{};
  if (!right_count && !(silent && texts.size() <= distortion.size())) {
    std::string expected = model == CameraModel::kRadtan ? "4 or " : "";
    expected += names.empty() ? "none" : std::to_string(names.size()) + ":";
    for (const char* name : names) {
      const bool is_optional = model == CameraModel::kRadtan && name == names.back();
      expected.append(is_optional ? " [" : " ").append(name).append(is_optional ? "]" : "");
    }
    Fail(section.file(),
         section.FullKey(key) + " has " + std::to_string(texts.size()) + " values, " + Name(model) +
             " takes " + expected);
  }
  return distortion;
}

// The simplest model that is the same: kRational without a denominator is kRadtan; kRadtan and kFov
// without coefficients are kPinhole.
CameraModel WithoutEmptyDistortion(const Camera& camera) {
  const auto& d = camera.distortion;
  CameraModel model = camera.model;
  if (model == CameraModel::kRational && d[5] == 0.0 && d[6] == 0.0 && d[7] == 0.0) {
    model = CameraModel::kRadtan;
  }
  if (model == CameraModel::kEquidistant || d != std::array<double, 8>{}) return model;
  return CameraModel::kPinhole;
}

Camera ReadOurs(const fs::path& file, const YAML::Node& root) {
  static const std::vector<std::string> kKeys = {"model",
                                                 "width",
                                                 "height",
                                                 "fx",
                                                 "fy",
                                                 "cx",
                                                 "cy",
                                                 "distortion",
                                                 "readout_s",
                                                 "readout_from"};
  for (const auto& entry : root) {
    const std::string key = entry.first.Scalar();
    if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end()) {
      Fail(file,
           "line " + std::to_string(entry.first.Mark().line + 1) + ": " + key +
               " is no key of a camera file; known are model, width, height, fx, fy, cx, cy, "
               "distortion, readout_s, readout_from");
    }
  }
  const Section section(file, root, "");
  const std::string name_of_model = section.Text("model");
  const auto model = FindCameraModel(name_of_model);
  if (!model) {
    std::string known;
    for (const CameraModel each : AllCameraModels()) {
      known.append(known.empty() ? "" : ", ").append(Name(each));
    }
    Fail(file, "model is '" + name_of_model + "', must be one of " + known);
  }
  Camera camera;
  camera.model = *model;
  camera.width = section.PixelsOrZero("width");
  camera.height = section.PixelsOrZero("height");
  camera.fx = section.Positive("fx");
  camera.fy = section.Positive("fy");
  camera.cx = section.Finite("cx");
  camera.cy = section.Finite("cy");
  if (camera.model != CameraModel::kPinhole && !section.Has("distortion")) {
    Fail(file, "distortion is missing");
  }
  camera.distortion = ReadDistortion(section, "distortion", camera.model);
  camera.readout_s = section.FiniteOrZero("readout_s");
  camera.knows_readout = section.Has("readout_s");
  if (section.Has("readout_from")) {
    const std::string name = section.Text("readout_from");
    const auto start = FindReadoutStart(name);
    if (!start) Fail(file, "readout_from is '" + name + "', must be top, bottom, left or right");
    camera.readout_from = *start;
  }
  return camera;
}

// ORB-SLAM 1 and 2 write Camera.fx; ORB-SLAM 3 Camera1.fx, but Camera.type and Camera.width.
Camera ReadOrbSlam(const fs::path& file, const YAML::Node& root) {
  const Section section(file, root, "");
  const std::string lens = section.Has("Camera1.fx") ? "Camera1." : "Camera.";
  const std::string type = section.Has("Camera.type") ? section.Text("Camera.type") : "PinHole";
  Camera camera;
  if (Lower(type) == "pinhole") {
    camera.model = CameraModel::kRadtan;
  } else if (Lower(type) == "rectified") {
    camera.model = CameraModel::kPinhole;
  } else if (Lower(type) == "kannalabrandt8") {
    camera.model = CameraModel::kEquidistant;
  } else {
    Fail(file, "Camera.type is '" + type + "', must be PinHole, Rectified or KannalaBrandt8");
  }
  camera.width = section.PixelsOrZero("Camera.width");
  camera.height = section.PixelsOrZero("Camera.height");
  camera.fx = section.Positive(lens + "fx");
  camera.fy = section.Positive(lens + "fy");
  camera.cx = section.Finite(lens + "cx");
  camera.cy = section.Finite(lens + "cy");
  const auto read = [&](std::initializer_list<const char*> names) {
    std::size_t k = 0;
    for (const char* name : names) camera.distortion[k++] = section.FiniteOrZero(lens + name);
  };
  if (camera.model == CameraModel::kRadtan) read({"k1", "k2", "p1", "p2", "k3"});
  if (camera.model == CameraModel::kEquidistant) {
    for (const char* name : {"k1", "k2", "k3", "k4"}) section.Finite(lens + name);
    read({"k1", "k2", "k3", "k4"});
  }
  camera.model = WithoutEmptyDistortion(camera);
  return camera;
}

// One camera of a Kalibr chain, or an EuRoC sensor: the same keys but for one.
Camera ReadKalibrOrEuroc(const Section& section) {
  Camera camera;
  const std::string projection = section.Text("camera_model");
  if (projection != "pinhole") {
    Fail(section.file(),
         section.FullKey("camera_model") + " is '" + projection + "', must be pinhole");
  }
  const std::string model =
      section.Has("distortion_model") ? section.Text("distortion_model") : "none";
  if (model == "radtan" || model == "radial-tangential") {
    camera.model = CameraModel::kRadtan;
  } else if (model == "equidistant") {
    camera.model = CameraModel::kEquidistant;
  } else if (model == "none") {
    camera.model = CameraModel::kPinhole;
  } else {
    Fail(section.file(),
         section.FullKey("distortion_model") + " is '" + model +
             "', must be radtan, radial-tangential, equidistant or none");
  }
  const std::vector<std::string> intrinsics = section.List("intrinsics");
  if (intrinsics.size() != 4) {
    Fail(section.file(),
         section.FullKey("intrinsics") + " has " + std::to_string(intrinsics.size()) +
             " values, must have 4: fx fy cx cy");
  }
  const auto name = [&](const char* key, int k) {
    return section.FullKey(key) + "[" + std::to_string(k) + "]";
  };
  camera.fx = PositiveNumber(section.file(), name("intrinsics", 0), intrinsics[0]);
  camera.fy = PositiveNumber(section.file(), name("intrinsics", 1), intrinsics[1]);
  camera.cx = FiniteNumber(section.file(), name("intrinsics", 2), intrinsics[2]);
  camera.cy = FiniteNumber(section.file(), name("intrinsics", 3), intrinsics[3]);
  const std::vector<std::string> resolution = section.List("resolution");
  if (!resolution.empty() && resolution.size() != 2) {
    Fail(section.file(), section.FullKey("resolution") + " must have 2 values: width height");
  }
  if (!resolution.empty()) {
    camera.width = PixelCount(section.file(), name("resolution", 0), resolution[0]);
    camera.height = PixelCount(section.file(), name("resolution", 1), resolution[1]);
  }
  const char* key =
      section.Has("distortion_coeffs") ? "distortion_coeffs" : "distortion_coefficients";
  camera.distortion = ReadDistortion(section, key, camera.model);
  camera.model = WithoutEmptyDistortion(camera);
  return camera;
}

std::vector<std::string> Words(const std::string& line) {
  std::istringstream stream(line);
  return {std::istream_iterator<std::string>(stream), {}};
}

// Lines that are neither blank nor comments, as words.
std::vector<std::vector<std::string>> WordLines(const std::string& text) {
  std::vector<std::vector<std::string>> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    std::vector<std::string> words = Words(line);
    if (!words.empty() && words.front().front() != '#') lines.push_back(std::move(words));
  }
  return lines;
}

Camera ReadKitti(const fs::path& file, const std::vector<std::string>& row) {
  if (row.size() != 13) {
    Fail(file, "P0 has " + std::to_string(row.size() - 1) + " values, must have 12");
  }
  std::array<double, 12> P = {};
  for (std::size_t k = 0; k < P.size(); ++k) {
    P[k] = FiniteNumber(file, "P0[" + std::to_string(k) + "]", row[k + 1]);
  }
  if (P[1] != 0.0 || P[4] != 0.0 || P[8] != 0.0 || P[9] != 0.0 || P[10] != 1.0) {
    Fail(file, "P0 is not of the form fx 0 cx . 0 fy cy . 0 0 1 .");
  }
  Camera camera;
  camera.fx = PositiveNumber(file, "P0[0], the focal length,", row[1]);
  camera.fy = PositiveNumber(file, "P0[5], the focal length,", row[6]);
  camera.cx = P[2];
  camera.cy = P[6];
  return camera;
}

// What the parameters of a COLMAP model mean, in their order: f is fx and fy at once.
struct ColmapModel {
  const char* name;
  CameraModel model;
  std::vector<std::string> parameters;
};

const std::vector<ColmapModel>& ColmapModels() {
  static const std::vector<ColmapModel> kModels = {
      {"SIMPLE_PINHOLE", CameraModel::kPinhole, {"f", "cx", "cy"}},
      {"PINHOLE", CameraModel::kPinhole, {"fx", "fy", "cx", "cy"}},
      {"SIMPLE_RADIAL", CameraModel::kRadtan, {"f", "cx", "cy", "k1"}},
      {"RADIAL", CameraModel::kRadtan, {"f", "cx", "cy", "k1", "k2"}},
      {"OPENCV", CameraModel::kRadtan, {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}},
      {"FULL_OPENCV",
       CameraModel::kRational,
       {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}},
      {"FOV", CameraModel::kFov, {"fx", "fy", "cx", "cy", "w"}},
      {"SIMPLE_RADIAL_FISHEYE", CameraModel::kEquidistant, {"f", "cx", "cy", "k1"}},
      {"RADIAL_FISHEYE", CameraModel::kEquidistant, {"f", "cx", "cy", "k1", "k2"}},
      {"OPENCV_FISHEYE",
       CameraModel::kEquidistant,
       {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}}};
  return kModels;
}

Camera ReadColmap(const fs::path& file, const std::vector<std::vector<std::string>>& lines) {
  const Camera camera = ReadColmapCamera(file, lines.front());
  for (const std::vector<std::string>& words : lines) {
    if (words.size() < 4 || ReadColmapCamera(file, words) != camera) {
      Fail(file,
           "cameras " + lines.front().front() + " and " + words.front() +
               " differ; keep the line of the one to use");
    }
  }
  return camera;
}

bool IsColmapLine(const std::vector<std::string>& words) {
  const auto all = [](const std::string& text, const char* characters) {
    return text.find_first_not_of(characters) == std::string::npos;
  };
  return words.size() >= 4 && all(words[0], "0123456789") &&
         all(words[1], "ABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789") && all(words[2], "0123456789");
}

// OpenCV's first line, "%YAML:1.0", is a directive without a meaning to yaml-cpp, which skips it.
Camera ReadYaml(const fs::path& file, const std::string& text) {
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    Fail(file, "line " + std::to_string(error.mark.line + 1) + " is not YAML: " + error.msg);
  }
  if (root.IsMap()) {
    const Section section(file, root, "");
    for (const auto& entry : root) {
      const std::string key = entry.first.Scalar();
      if (key.rfind("Camera.", 0) == 0 || key.rfind("Camera1.", 0) == 0) {
        return ReadOrbSlam(file, root);
      }
    }
    if (section.Has("cam0")) {
      if (!root["cam0"].IsMap()) Fail(file, "cam0 must be a map");
      return ReadKalibrOrEuroc(Section(file, root["cam0"], "cam0."));
    }
    if (section.Has("camera_model") || section.Has("intrinsics")) return ReadKalibrOrEuroc(section);
    if (section.Has("model") || section.Has("fx")) return ReadOurs(file, root);
  }
  Fail(file,
       "no camera found; known are our own YAML (model, fx, ...), ORB-SLAM YAML, Kalibr chain, "
       "EuRoC sensor.yaml, KITTI calib.txt and COLMAP cameras.txt");
}

Camera ReadText(const fs::path& file, const std::string& text) {
  if (text.find('\0') != std::string::npos) Fail(file, "is not a text file");
  const auto lines = WordLines(text);
  if (lines.empty()) Fail(file, "is empty");
  for (const std::vector<std::string>& words : lines) {
    if (words.front() == "P0:") return ReadKitti(file, words);
  }
  if (IsColmapLine(lines.front())) return ReadColmap(file, lines);
  return ReadYaml(file, text);
}

fs::path FileToRead(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) Fail(path, "no such camera file");
  if (!fs::is_directory(path, ignored)) return path;
  for (const char* name :
       {"camera.yaml", "calib.txt", "sensor.yaml", "mav0/cam0/sensor.yaml", "cameras.txt"}) {
    if (fs::is_regular_file(path / name, ignored)) return path / name;
  }
  Fail(path, "is a folder without a camera file; give the file");
}

std::string NumberText(double value) {
  char buffer[40];
  const auto result = std::to_chars(std::begin(buffer), std::end(buffer), value);
  return {buffer, result.ptr};
}

}  // namespace

Camera ReadCamera(const CameraReference& reference, const std::filesystem::path&) {
  return ReadCamera(reference.file);
}

Camera ReadColmapCamera(const fs::path& file, const std::vector<std::string>& words) {
  const std::string who = "camera " + words[0] + ": ";
  const auto& models = ColmapModels();
  const auto found = std::find_if(models.begin(), models.end(), [&](const ColmapModel& model) {
    return words[1] == model.name;
  });
  if (found == models.end()) {
    std::string known;
    for (const ColmapModel& model : models) {
      known.append(known.empty() ? "" : ", ").append(model.name);
    }
    Fail(file, who + "model is '" + words[1] + "', must be one of " + known);
  }
  const std::size_t num_given = words.size() - std::min<std::size_t>(words.size(), 4);
  if (num_given != found->parameters.size()) {
    Fail(file,
         who + found->name + " has " + std::to_string(num_given) + " parameters, must have " +
             std::to_string(found->parameters.size()));
  }
  Camera camera;
  camera.model = found->model;
  camera.width = PixelCount(file, who + "width", words[2]);
  camera.height = PixelCount(file, who + "height", words[3]);
  for (std::size_t k = 0; k < num_given; ++k) {
    const std::string& name = found->parameters[k];
    const std::string& text = words[4 + k];
    const std::string key = who + name;
    const double value = FiniteNumber(file, key, text);
    if (name == "f") camera.fx = camera.fy = PositiveNumber(file, key, text);
    if (name == "fx") camera.fx = PositiveNumber(file, key, text);
    if (name == "fy") camera.fy = PositiveNumber(file, key, text);
    if (name == "cx") camera.cx = value - 0.5;
    if (name == "cy") camera.cy = value - 0.5;
    const auto coefficients = DistortionNames(camera.model);
    for (std::size_t c = 0; c < coefficients.size(); ++c) {
      if (name == coefficients[c]) camera.distortion[c] = value;
    }
  }
  camera.model = WithoutEmptyDistortion(camera);
  return camera;
}

Camera ReadCamera(const fs::path& path) {
  const fs::path file = FileToRead(path);
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (!stream.is_open() || stream.bad()) Fail(file, "cannot be read");
  const Camera camera = ReadText(file, text);
  if (const auto problem = camera.Problem()) Fail(file, *problem);
  return camera;
}

std::string CameraYaml(const Camera& camera) {
  std::string text = "model: " + std::string(Name(camera.model)) + "\n";
  text += "width: " + std::to_string(camera.width) + "\n";
  text += "height: " + std::to_string(camera.height) + "\n";
  text += "fx: " + NumberText(camera.fx) + "\n";
  text += "fy: " + NumberText(camera.fy) + "\n";
  text += "cx: " + NumberText(camera.cx) + "\n";
  text += "cy: " + NumberText(camera.cy) + "\n";
  const std::size_t count = DistortionNames(camera.model).size();
  text += "distortion: [";
  for (std::size_t k = 0; k < count; ++k) {
    if (k > 0) text += ", ";
    text += NumberText(camera.distortion[k]);
  }
  text += "]\n";
  if (camera.knows_readout) text += "readout_s: " + NumberText(camera.readout_s) + "\n";
  if (camera.readout_s > 0.0) {
    text += "readout_from: " + std::string(Name(camera.readout_from)) + "\n";
  }
  return text;
}

void WriteCameraYaml(const fs::path& file, const Camera& camera) {
  if (const auto problem = camera.Problem()) throw std::invalid_argument("camera: " + *problem);
  const fs::path beside = file.string() + ".tmp";
  std::ofstream stream(beside, std::ios::binary);
  stream << CameraYaml(camera);
  stream.close();
  std::error_code error;
  if (stream) fs::rename(beside, file, error);
  if (!stream || error) {
    std::error_code ignored;
    fs::remove(beside, ignored);
    Fail(file, "cannot be written");
  }
}

}  // namespace rotslam
