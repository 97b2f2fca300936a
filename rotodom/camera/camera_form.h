#pragma once

#include <functional>
#include <string>
#include <vector>

#include "rotodom/camera/camera_document.h"
#include "rotodom/camera/camera_file.h"

namespace rotslam {

/// One form of calibration files: how it is told from the others, and its reader.
struct CameraForm {
  std::string name;         // "ORB-SLAM YAML"
  std::string description;  // what such a file looks like, one line
  // Names under which a file of this form is found in a folder, the likeliest first.
  std::vector<std::string> file_names;
  /// True for files that look like this form; exactly one form recognises a good file. Throws only
  /// where a key is given twice.
  std::function<bool(const CameraDocument&)> recognises;
  /// Throws std::runtime_error in one line "file:line: what was found, what is expected".
  std::function<CameraFile(const CameraDocument&)> read;
};

/// All forms, made from the files of rotodom/camera/forms: a new form is a new file there.
const std::vector<CameraForm>& CameraForms();

/// The names of all forms, separated by commas.
std::string CameraFormNames();

}  // namespace rotslam
