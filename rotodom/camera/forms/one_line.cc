#include <algorithm>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"
#include "rotodom/camera/number_table.h"

namespace rotslam {
namespace {

CameraFile ReadOneLine(const CameraDocument& document) {
  const NumberTable table = ReadNumberTable(document);
  const std::vector<std::string>& words = table[0].words;
  const int line = table[0].line;
  if (words.size() != 4 && words.size() != 8 && words.size() != 9 && words.size() != 12) {
    FailAt(document.file(),
           line,
           "has " + std::to_string(words.size()) +
               " numbers, must have 4, 8, 9 or 12: fx fy cx cy [k1 k2 p1 p2 [k3 [k4 k5 k6]]]");
  }
  Camera camera;
  camera.fx = PositiveNumber(document.file(), line, "fx", words[0]);
  camera.fy = PositiveNumber(document.file(), line, "fy", words[1]);
  camera.cx = FiniteNumber(document.file(), line, "cx", words[2]);
  camera.cy = FiniteNumber(document.file(), line, "cy", words[3]);
  if (camera.cx < 1.0 && camera.cy < 1.0 && camera.fx < 20.0) {
    FailAt(document.file(),
           line,
           "numbers look relative to the size of the images; give pixels, or the size in a second "
           "line `width height`");
  }
  std::vector<double> distortion;
  for (std::size_t k = 4; k < words.size(); ++k) {
    distortion.push_back(
        FiniteNumber(document.file(), line, "coefficient " + std::to_string(k - 3), words[k]));
  }
  if (const auto problem = SetOpenCvDistortion(distortion, camera)) {
    FailAt(document.file(), line, *problem);
  }
  CameraFile file;
  file.cameras.push_back({"", camera, {}, ""});
  if (words.size() == 8) {
    file.notes.push_back(
        "the 4 values behind fx fy cx cy are taken as k1 k2 p1 p2, not as those "
        "of a fisheye lens");
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormOneLine() {
  CameraForm form;
  form.name = "one line";
  form.description =
      "DROID-SLAM and DPVO: one line `fx fy cx cy [k1 k2 p1 p2 [k3 [k4 k5 k6]]]`, blanks or commas";
  form.file_names = {"calibration.txt", "intrinsics.txt"};
  form.recognises = [](const CameraDocument& document) {
    const NumberTable table = ReadNumberTable(document);
    return table.size() == 1 && table[0].words.size() >= 4 && !IsMatrixTable(table);
  };
  form.read = ReadOneLine;
  return form;
}

}  // namespace forms
}  // namespace rotslam
