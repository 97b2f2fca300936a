#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"
#include "rotodom/camera/number_table.h"

namespace rotslam {
namespace {

CameraFile ReadMatrix(const CameraDocument& document) {
  const NumberTable table = ReadNumberTable(document);
  std::vector<double> K;
  for (const TextRow& row : table) {
    const std::size_t width = table.size() == 1 ? 9 : 3;
    for (std::size_t k = 0; k < width && K.size() < 9; ++k) {
      const std::string key = "value " + std::to_string(k + 1);
      K.push_back(FiniteNumber(document.file(), row.line, key, row.words[k]));
    }
  }
  Camera camera;
  if (const auto problem = SetMatrix(K, camera)) {
    FailAt(document.file(), table[0].line, "the matrix " + *problem);
  }
  CameraFile file;
  file.cameras.push_back({"", camera, {}, ""});
  file.notes.push_back("a camera matrix alone: taken as a camera without distortion");
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormMatrix() {
  CameraForm form;
  form.name = "camera matrix";
  form.description =
      "ScanNet and others: nothing but a matrix fx 0 cx 0 fy cy 0 0 1, in three lines, or 4 by 4";
  form.file_names = {"intrinsic_color.txt", "intrinsics_color.txt"};
  form.recognises = [](const CameraDocument& document) {
    return IsMatrixTable(ReadNumberTable(document));
  };
  form.read = ReadMatrix;
  return form;
}

}  // namespace forms
}  // namespace rotslam
