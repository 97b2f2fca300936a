#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

// "P2" of "P2:", "P2" or "P2:7.1e2"; empty where the word is no projection matrix.
std::string MatrixName(const std::string& word) {
  const bool is_name = word.size() >= 2 && word[0] == 'P' && word[1] >= '0' && word[1] <= '9' &&
                       (word.size() == 2 || word[2] == ':');
  return is_name ? word.substr(0, 2) : "";
}

// False for the key of a YAML file: "P1: !!opencv-matrix", "P1: [", or "P1:" above "rows: 3".
bool IsMatrixRow(const std::vector<TextRow>& rows, std::size_t r) {
  const std::vector<std::string>& words = rows[r].words;
  if (MatrixName(words[0]).empty()) return false;
  if (words.size() > 1) return words[1].front() != '!' && words[1].front() != '[';
  if (words[0].size() > 3) return words[0][3] != '!' && words[0][3] != '[';
  return r + 1 == rows.size() || IsNumber(rows[r + 1].words[0]);
}

struct Word {
  int line = 0;
  std::string text;
};

// The words of the matrix that begins in row `begin`, those of its next rows included where they
// have nothing but numbers.
std::vector<Word> MatrixWords(const std::vector<TextRow>& rows, std::size_t begin) {
  std::vector<Word> words;
  const TextRow& first = rows[begin];
  if (first.words[0].size() > 3) words.push_back({first.line, first.words[0].substr(3)});
  for (std::size_t k = 1; k < first.words.size(); ++k) {
    if (k == 1 && first.words[k] == ":") continue;
    words.push_back({first.line, first.words[k]});
  }
  for (std::size_t r = begin + 1; r < rows.size() && words.size() < 12; ++r) {
    if (!IsNumber(rows[r].words[0])) break;
    for (const std::string& text : rows[r].words) words.push_back({rows[r].line, text});
  }
  return words;
}

Camera ReadKittiMatrix(const CameraDocument& document, std::size_t row) {
  const std::string name = MatrixName(document.rows()[row].words[0]);
  const int line = document.rows()[row].line;
  const std::vector<Word> words = MatrixWords(document.rows(), row);
  if (words.size() != 12) {
    FailAt(document.file(),
           line,
           name + " has " + std::to_string(words.size()) + " values, must have 12");
  }
  std::array<double, 12> P = {};
  for (std::size_t k = 0; k < P.size(); ++k) {
    P[k] = FiniteNumber(
        document.file(), words[k].line, name + "[" + std::to_string(k) + "]", words[k].text);
  }
  Camera camera;
  const std::array<double, 9> K = {P[0], P[1], P[2], P[4], P[5], P[6], P[8], P[9], P[10]};
  if (const auto problem = SetMatrix(K, camera)) {
    FailAt(document.file(), line, name + " " + *problem);
  }
  return camera;
}

}  // namespace

namespace forms {

CameraForm CameraFormKittiOdometry() {
  CameraForm form;
  form.name = "KITTI calib.txt";
  form.description = "KITTI odometry and objects: rows `P0: fx 0 cx . 0 fy cy . 0 0 1 .` to `P3:`";
  form.file_names = {"calib.txt"};
  form.recognises = [](const CameraDocument& document) {
    for (std::size_t r = 0; r < document.rows().size(); ++r) {
      if (IsMatrixRow(document.rows(), r)) return true;
    }
    return false;
  };
  form.read = [](const CameraDocument& document) {
    CameraFile file;
    for (std::size_t r = 0; r < document.rows().size(); ++r) {
      if (!IsMatrixRow(document.rows(), r)) continue;
      file.Add(MatrixName(document.rows()[r].words[0]),
               [&] { return ReadKittiMatrix(document, r); });
    }
    return file;
  };
  return form;
}

}  // namespace forms
}  // namespace rotslam
