#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

// Models by the first word of the file, in lower case.
const std::map<std::string, CameraModel>& DsoModels() {
  static const std::map<std::string, CameraModel> kModels = {
      {"pinhole", CameraModel::kPinhole},
      {"radtan", CameraModel::kRadtan},
      {"kannalabrandt", CameraModel::kEquidistant},
      {"equidistant", CameraModel::kEquidistant},
      {"fov", CameraModel::kFov},
      {"atan", CameraModel::kFov}};
  return kModels;
}

bool AllNumbers(const std::vector<std::string>& words, std::size_t begin) {
  return std::all_of(words.begin() + static_cast<std::ptrdiff_t>(begin), words.end(), IsNumber);
}

bool IsSizeRow(const TextRow& row) {
  return row.words.size() == 2 &&
         row.words[0].find_first_not_of("0123456789") == std::string::npos &&
         row.words[1].find_first_not_of("0123456789") == std::string::npos;
}

bool IsDso(const CameraDocument& document) {
  const auto& rows = document.rows();
  if (rows.empty()) return false;
  const std::vector<std::string>& first = rows[0].words;
  if (DsoModels().contains(Lower(first[0]))) return true;
  // Without a model: FOV, or as LSD-SLAM has it k1 k2 p1 p2; then the line with the size.
  return rows.size() > 1 && IsSizeRow(rows[1]) && (first.size() == 5 || first.size() == 8) &&
         AllNumbers(first, 0);
}

void SetDsoDistortion(CameraModel model,
                      std::span<const double> values,
                      const CameraDocument& document,
                      const std::string& name,
                      Camera& camera) {
  const int line = document.rows()[0].line;
  std::optional<std::string> problem;
  if (model == CameraModel::kPinhole) {
    camera.model = model;
    if (values.size() > 1) {
      problem =
          "has " + std::to_string(values.size() + 4) + " values, must have 4 or 5: fx fy cx cy 0";
    } else if (!values.empty() && values[0] != 0.0) {
      problem = "has a fifth value that is not 0; remove it, or write FOV in place of Pinhole";
    }
  } else if (values.size() != (model == CameraModel::kFov ? 1 : 4)) {
    problem =
        "has " + std::to_string(values.size() + 4) + " values, must have " +
        (model == CameraModel::kFov ? "5: fx fy cx cy w" : "8: fx fy cx cy and 4 coefficients");
  } else if (model == CameraModel::kRadtan) {
    problem = SetOpenCvDistortion(values, camera);
  } else if (model == CameraModel::kEquidistant) {
    problem = SetFisheyeDistortion(values, camera);
  } else {
    problem = SetFovDistortion(values, camera);
  }
  if (problem) FailAt(document.file(), line, name + " " + *problem);
}

Camera ReadDsoCamera(const CameraDocument& document) {
  const TextRow& row = document.rows()[0];
  const auto found = DsoModels().find(Lower(row.words[0]));
  const bool has_name = found != DsoModels().end();
  const std::size_t begin = has_name ? 1 : 0;
  const std::string name = has_name ? row.words[0] : "the first line";
  std::vector<double> values;
  for (std::size_t k = begin; k < row.words.size(); ++k) {
    const std::string key = "value " + std::to_string(k - begin + 1) + " of " + name;
    values.push_back(FiniteNumber(document.file(), row.line, key, row.words[k]));
  }
  if (values.size() < 4) {
    FailAt(document.file(),
           row.line,
           name + " has " + std::to_string(values.size()) + " values, must begin with fx fy cx cy");
  }
  const CameraModel model = has_name             ? found->second
                            : values.size() == 5 ? CameraModel::kFov
                                                 : CameraModel::kRadtan;
  Camera camera;
  SetDsoDistortion(model, std::span(values).subspan(4), document, name, camera);
  camera.fx = values[0];
  camera.fy = values[1];
  camera.cx = values[2];
  camera.cy = values[3];
  if (!(camera.fx > 0.0 && camera.fy > 0.0)) {
    FailAt(document.file(), row.line, name + " has a focal length that is not positive");
  }
  const bool has_size = document.rows().size() > 1;
  if (has_size) {
    const TextRow& size = document.rows()[1];
    if (size.words.size() != 2) {
      FailAt(document.file(), size.line, "must be the width and height of the images");
    }
    camera.width = PixelCount(document.file(), size.line, "width", size.words[0]);
    camera.height = PixelCount(document.file(), size.line, "height", size.words[1]);
    if (camera.width == 0 || camera.height == 0) {
      FailAt(document.file(), size.line, "width and height must be positive");
    }
  }
  // Relative to the size of the images, whose edges are 0 and 1 then.
  if (camera.cx < 1.0 && camera.cy < 1.0) {
    if (!has_size) {
      FailAt(document.file(),
             row.line,
             "numbers are relative to the size of the images, which the second line must give");
    }
    camera.fx *= camera.width;
    camera.fy *= camera.height;
    camera.cx = camera.cx * camera.width - 0.5;
    camera.cy = camera.cy * camera.height - 0.5;
  }
  return camera;
}

CameraFile ReadDso(const CameraDocument& document) {
  CameraFile file;
  file.cameras.push_back({"", ReadDsoCamera(document), {}, ""});
  if (document.rows().size() > 2) {
    file.notes.push_back(
        "lines 3 and 4 (how DSO crops and scales images) are ignored: images are "
        "used in their own size");
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormDso() {
  CameraForm form;
  form.name = "DSO camera.txt";
  form.description =
      "DSO, LSD-SLAM and TUM mono: `RadTan fx fy cx cy k1 k2 p1 p2` (or Pinhole, KannalaBrandt, "
      "EquiDistant, FOV, or `fx fy cx cy w` alone), below it width and height";
  form.file_names = {"camera.txt"};
  form.recognises = IsDso;
  form.read = ReadDso;
  return form;
}

}  // namespace forms
}  // namespace rotslam
