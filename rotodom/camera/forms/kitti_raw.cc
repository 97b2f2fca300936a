#include <array>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

const TextRow* FindKittiRow(const CameraDocument& document, const std::string& name) {
  for (const TextRow& row : document.rows()) {
    if (row.words[0] == name || row.words[0] == name + ":") return &row;
  }
  return nullptr;
}

std::vector<double> KittiNumbers(const CameraDocument& document,
                                 const std::string& name,
                                 std::size_t count) {
  const TextRow* row = FindKittiRow(document, name);
  if (row == nullptr) FailAt(document.file(), 1, name + " is missing");
  if (row->words.size() != count + 1) {
    FailAt(document.file(),
           row->line,
           name + " has " + std::to_string(row->words.size() - 1) + " values, must have " +
               std::to_string(count));
  }
  std::vector<double> numbers;
  for (std::size_t k = 0; k < count; ++k) {
    const std::string key = name + "[" + std::to_string(k) + "]";
    numbers.push_back(FiniteNumber(document.file(), row->line, key, row->words[k + 1]));
  }
  return numbers;
}

void ReadKittiSize(const CameraDocument& document, const std::string& name, Camera& camera) {
  const TextRow* row = FindKittiRow(document, name);
  if (row == nullptr) return;
  KittiNumbers(document, name, 2);
  camera.width = PixelCount(document.file(), row->line, name + "[0]", row->words[1]);
  camera.height = PixelCount(document.file(), row->line, name + "[1]", row->words[2]);
  if ((camera.width == 0) != (camera.height == 0)) {
    FailAt(document.file(), row->line, name + " has a 0, must have two positive numbers");
  }
}

Camera ReadRectified(const CameraDocument& document, const std::string& number) {
  const std::string name = "P_rect_" + number;
  const std::vector<double> P = KittiNumbers(document, name, 12);
  const std::array<double, 9> K = {P[0], P[1], P[2], P[4], P[5], P[6], P[8], P[9], P[10]};
  Camera camera;
  if (const auto problem = SetMatrix(K, camera)) {
    FailAt(document.file(), FindKittiRow(document, name)->line, name + " " + *problem);
  }
  ReadKittiSize(document, "S_rect_" + number, camera);
  return camera;
}

Camera ReadDistorted(const CameraDocument& document, const std::string& number) {
  Camera camera;
  const std::string K = "K_" + number;
  const std::string D = "D_" + number;
  if (const auto problem = SetMatrix(KittiNumbers(document, K, 9), camera)) {
    FailAt(document.file(), FindKittiRow(document, K)->line, K + " " + *problem);
  }
  if (const auto problem = SetOpenCvDistortion(KittiNumbers(document, D, 5), camera)) {
    FailAt(document.file(), FindKittiRow(document, D)->line, D + " " + *problem);
  }
  ReadKittiSize(document, "S_" + number, camera);
  return camera;
}

bool AllSame(const std::vector<NamedCamera>& cameras) {
  for (const NamedCamera& camera : cameras) {
    if (camera.camera != cameras.front().camera || !camera.problem.empty()) return false;
  }
  return true;
}

CameraFile ReadKittiRaw(const CameraDocument& document) {
  CameraFile file;
  for (const TextRow& row : document.rows()) {
    const std::string name = row.words[0].substr(0, row.words[0].find(':'));
    if (!name.starts_with("P_rect_")) continue;
    file.Add(name, [&] { return ReadRectified(document, name.substr(7)); });
  }
  // Drives are rectified where nothing else is said.
  file.first_is_default = AllSame(file.cameras);
  bool has_distorted = false;
  for (const TextRow& row : document.rows()) {
    const std::string name = row.words[0].substr(0, row.words[0].find(':'));
    if (!name.starts_with("K_")) continue;
    file.Add(name, [&] { return ReadDistorted(document, name.substr(2)); });
    has_distorted = true;
  }
  if (has_distorted) {
    file.notes.push_back(
        "P_rect_00 to P_rect_03 belong to rectified images (drives named _sync); "
        "for those before rectification (_extract) take K_00 to K_03");
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormKittiRaw() {
  CameraForm form;
  form.name = "KITTI calib_cam_to_cam.txt";
  form.description = "KITTI raw drives: rows `P_rect_00:`, `S_rect_00:`, `K_00:`, `D_00:`";
  form.file_names = {"calib_cam_to_cam.txt"};
  form.recognises = [](const CameraDocument& document) {
    for (const TextRow& row : document.rows()) {
      if (row.words[0].starts_with("P_rect_0")) return true;
    }
    return false;
  };
  form.read = ReadKittiRaw;
  return form;
}

}  // namespace forms
}  // namespace rotslam
