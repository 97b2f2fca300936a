#include "rotodom/camera/read_camera.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/section.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

fs::path FileToRead(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) FailAt(path, 0, "no such camera file");
  if (!fs::is_directory(path, ignored)) return path;
  if (fs::is_regular_file(path / "camera.yaml", ignored)) return path / "camera.yaml";
  std::vector<std::string> found;  // one for each form
  for (const CameraForm& form : CameraForms()) {
    for (const std::string& name : form.file_names) {
      if (!fs::is_regular_file(path / name, ignored)) continue;
      found.push_back(name);
      break;
    }
  }
  if (found.empty()) FailAt(path, 0, "is a folder without a camera file; give the file");
  if (found.size() > 1) {
    FailAt(path, 0, "has the camera files " + found[0] + " and " + found[1] + "; give one of them");
  }
  return path / found[0];
}

[[noreturn]] void FailUnknown(const CameraDocument& document) {
  if (!document.binary().empty()) {
    FailAt(document.file(), 0, "is not a text file, and no cameras.bin of COLMAP");
  }
  if (document.rows().empty()) FailAt(document.file(), 0, "is empty");
  if (!document.parse_problem().empty()) throw std::runtime_error(document.parse_problem());
  FailAt(document.file(), 0, "no camera found; known are " + CameraFormNames());
}

const CameraForm& FormOf(const CameraDocument& document) {
  const CameraForm* found = nullptr;
  for (const CameraForm& form : CameraForms()) {
    if (!form.recognises(document)) continue;
    if (found != nullptr) {
      FailAt(document.file(),
             0,
             "has the keys of two forms, " + found->name + " and " + form.name +
                 "; remove those that are not meant");
    }
    found = &form;
  }
  if (found == nullptr) FailUnknown(document);
  return *found;
}

std::string NamesOf(const CameraFile& file) {
  constexpr std::size_t kMost = 8;
  std::string names;
  for (std::size_t k = 0; k < file.cameras.size() && k < kMost; ++k) {
    names += (k == 0 ? "" : ", ") + file.cameras[k].name;
  }
  return file.cameras.size() > kMost ? names + ", ..." : names;
}

bool SameNumbers(const NamedCamera& a, const NamedCamera& b) {
  return a.problem.empty() && b.problem.empty() && a.camera == b.camera &&
         a.view_angle_x_rad == b.view_angle_x_rad;
}

// The number at the end of `word` behind one of the beginnings; -1: there is none.
int NumberBehind(const std::string& word, std::initializer_list<const char*> beginnings) {
  for (const std::string beginning : beginnings) {
    if (!word.starts_with(beginning)) continue;
    const char* begin = word.data() + beginning.size();
    const char* end = word.data() + word.size();
    int number = 0;
    const auto result = std::from_chars(begin, end, number);
    if (begin != end && result.ec == std::errc() && result.ptr == end && number >= 0 &&
        number < 100) {
      return number;
    }
  }
  return -1;
}

// Names, in lower case, that the forms give to the camera of a stereo pair, or of a chain.
std::vector<std::string> NamesOfNumber(int number) {
  const std::string index = std::to_string(number);
  const std::string ordinal = std::to_string(number + 1);
  std::vector<std::string> names = {"cam" + index,
                                    "camera" + ordinal,
                                    "m" + ordinal,
                                    "k" + ordinal,
                                    "cameramatrix" + ordinal,
                                    "camera_matrix_" + ordinal};
  if (number == 0) names.insert(names.end(), {"left", "camera_matrix_left", "camera"});
  if (number == 1) names.insert(names.end(), {"right", "camera_matrix_right"});
  return names;
}

// Names, in lower case, of the cameras that a component of the images' path stands for.
std::vector<std::string> NamesFor(const std::string& component, bool is_unrectified) {
  const std::string word = Lower(component);
  const int camera = NumberBehind(word, {"cam", "cam_", "camera", "camera_"});
  if (camera >= 0) return NamesOfNumber(camera);
  if (const int image = NumberBehind(word, {"image_"}); image >= 0) {
    const std::string number = (image < 10 ? "0" : "") + std::to_string(image);
    return {"p" + std::to_string(image), (is_unrectified ? "k_" : "p_rect_") + number};
  }
  if (word == "left" || word == "image_left" || word == "left_image") return NamesOfNumber(0);
  if (word == "right" || word == "image_right" || word == "right_image") return NamesOfNumber(1);
  if (word.starts_with("image_rect") || word == "rectified") return {"rectified"};
  return {};
}

const NamedCamera* FindByNames(const CameraFile& file, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    for (const NamedCamera& camera : file.cameras) {
      if (Lower(camera.name) == name) return &camera;
    }
  }
  return nullptr;
}

const NamedCamera* FindByName(const CameraFile& file, const std::string& name) {
  for (const NamedCamera& camera : file.cameras) {
    if (camera.name == name) return &camera;
  }
  if (const NamedCamera* found = FindByNames(file, {Lower(name)})) return found;
  return FindByNames(file, NamesFor(name, false));
}

const NamedCamera* FindByFolder(const CameraFile& file, const fs::path& image_folder) {
  constexpr int kMostComponents = 4;  // above, folders say where images lie
  const bool is_unrectified = image_folder.string().find("_extract") != std::string::npos;
  fs::path folder = image_folder;
  for (int k = 0; k < kMostComponents && !folder.empty(); ++k, folder = folder.parent_path()) {
    const auto names = NamesFor(folder.filename().string(), is_unrectified);
    if (const NamedCamera* found = FindByNames(file, names)) return found;
    if (folder == folder.parent_path()) break;
  }
  return nullptr;
}

const NamedCamera& Choose(const CameraFile& file,
                          const CameraReference& reference,
                          const fs::path& image_folder) {
  if (!reference.name.empty()) {
    const NamedCamera* found = FindByName(file, reference.name);
    if (found != nullptr) return *found;
    const std::string names = NamesOf(file);
    FailAt(reference.file,
           0,
           "has no camera '" + reference.name + "'" +
               (names.empty() ? ", only one without a name" : "; it has " + names));
  }
  if (file.cameras.size() == 1) return file.cameras.front();
  if (const NamedCamera* found = FindByFolder(file, image_folder)) return *found;
  if (file.first_is_default) return file.cameras.front();
  for (const NamedCamera& camera : file.cameras) {
    if (SameNumbers(camera, file.cameras.front())) continue;
    FailAt(reference.file,
           0,
           "has cameras that differ: " + NamesOf(file) + "; say which with --camera " +
               reference.file.filename().string() + ":" + file.cameras.front().name);
  }
  return file.cameras.front();
}

std::string NumberText(double value) {
  char buffer[40];
  const auto result = std::to_chars(std::begin(buffer), std::end(buffer), value);
  return {buffer, result.ptr};
}

std::string ListText(std::span<const double> values) {
  std::string text = "[";
  for (const double value : values) text += (text.size() > 1 ? ", " : "") + NumberText(value);
  return text + "]";
}

}  // namespace

std::string CameraFormNames() {
  std::string names;
  for (const CameraForm& form : CameraForms()) names += (names.empty() ? "" : ", ") + form.name;
  return names;
}

void CameraFile::Add(const std::string& name, const std::function<Camera()>& read) {
  NamedCamera camera;
  camera.name = name;
  try {
    camera.camera = read();
  } catch (const std::runtime_error& error) {
    camera.problem = error.what();
  }
  cameras.push_back(std::move(camera));
}

Camera AtSize(const NamedCamera& named, int width, int height) {
  Camera camera = named.camera;
  if (!named.view_angle_x_rad) return camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.5 * width / std::tan(0.5 * *named.view_angle_x_rad);
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

CameraFile ReadCameraFile(const fs::path& path) {
  const CameraDocument document(FileToRead(path));
  const CameraForm& form = FormOf(document);
  CameraFile file = form.read(document);
  file.form = form.name;
  if (file.cameras.empty()) FailAt(document.file(), 0, "no camera found in this " + form.name);
  for (NamedCamera& camera : file.cameras) {
    if (!camera.problem.empty()) continue;
    const auto problem = AtSize(camera, 2, 2).Problem();
    if (!problem) continue;
    camera.problem = document.file().string() + ": " +
                     (camera.name.empty() ? "" : camera.name + ": ") + *problem;
  }
  const auto is_good = [](const NamedCamera& camera) { return camera.problem.empty(); };
  if (std::none_of(file.cameras.begin(), file.cameras.end(), is_good)) {
    throw std::runtime_error(file.cameras.front().problem);
  }
  return file;
}

std::optional<std::string> RecogniseCameraFile(const fs::path& path) {
  const CameraDocument document(FileToRead(path));
  std::optional<std::string> name;
  for (const CameraForm& form : CameraForms()) {
    if (!form.recognises(document)) continue;
    if (name) return std::nullopt;
    name = form.name;
  }
  return name;
}

CameraReference ParseCameraReference(const std::string& text) {
  std::error_code ignored;
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || fs::exists(text, ignored)) return {text, ""};
  const bool is_name =
      colon > 1 && colon + 1 < text.size();  // colon 1: the drive of a Windows path
  const bool has_folders = text.find_first_of("/\\", colon) != std::string::npos;
  const bool is_file = is_name && fs::exists(text.substr(0, colon), ignored);
  if (!is_name || (has_folders && !is_file)) return {text, ""};
  return {text.substr(0, colon), text.substr(colon + 1)};
}

NamedCamera ChooseCamera(const CameraFile& file,
                         const CameraReference& reference,
                         const fs::path& image_folder) {
  const NamedCamera& camera = Choose(file, reference, image_folder);
  if (!camera.problem.empty()) throw std::runtime_error(camera.problem);
  return camera;
}

Camera ReadCamera(const CameraReference& reference,
                  const fs::path& image_folder,
                  const std::array<int, 2>& image_size) {
  const NamedCamera camera = ChooseCamera(ReadCameraFile(reference.file), reference, image_folder);
  if (camera.view_angle_x_rad && image_size[0] <= 0) {
    FailAt(reference.file,
           0,
           "gives an angle of view in place of a focal length, and not the size of the images (w "
           "and h) that it needs with it");
  }
  return AtSize(camera, image_size[0], image_size[1]);
}

Camera ReadCamera(const fs::path& file) { return ReadCamera(CameraReference{file, ""}); }

std::string CameraYaml(const Camera& camera, const std::optional<LensSigmas>& sigmas) {
  std::string text = "model: " + std::string(Name(camera.model)) + "\n";
  text += "width: " + std::to_string(camera.width) + "\n";
  text += "height: " + std::to_string(camera.height) + "\n";
  text += "fx: " + NumberText(camera.fx) + "\n";
  text += "fy: " + NumberText(camera.fy) + "\n";
  text += "cx: " + NumberText(camera.cx) + "\n";
  text += "cy: " + NumberText(camera.cy) + "\n";
  const std::size_t count = DistortionNames(camera.model).size();
  text += "distortion: " + ListText({camera.distortion.data(), count}) + "\n";
  if (camera.knows_readout) text += "readout_s: " + NumberText(camera.readout_s) + "\n";
  if (camera.readout_s > 0.0) {
    text += "readout_from: " + std::string(Name(camera.readout_from)) + "\n";
  }
  if (!sigmas) return text;
  text += "sigma_focal_px: " + NumberText(sigmas->focal_px) + "\n";
  text += "sigma_cx_px: " + NumberText(sigmas->cx_px) + "\n";
  text += "sigma_cy_px: " + NumberText(sigmas->cy_px) + "\n";
  const auto num_sigmas = static_cast<std::size_t>(NumLensCoefficients(camera.model));
  text += "sigma_distortion: " + ListText({sigmas->distortion.data(), num_sigmas}) + "\n";
  return text;
}

void WriteCameraYaml(const fs::path& file,
                     const Camera& camera,
                     const std::optional<LensSigmas>& sigmas) {
  if (const auto problem = camera.Problem()) throw std::invalid_argument("camera: " + *problem);
  const fs::path beside = file.string() + ".tmp";
  std::ofstream stream(beside, std::ios::binary);
  stream << CameraYaml(camera, sigmas);
  stream.close();
  std::error_code error;
  if (stream) fs::rename(beside, file, error);
  if (!stream || error) {
    std::error_code ignored;
    fs::remove(beside, ignored);
    FailAt(file, 0, "cannot be written");
  }
}

}  // namespace rotslam
