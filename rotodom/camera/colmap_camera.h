#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// A camera model of COLMAP's binary files: its number there, its name in text files and the number
/// of its parameters.
struct ColmapModelId {
  int id = 0;
  const char* name = "";
  std::size_t num_parameters = 0;
};

/// Null: no such model is known.
const ColmapModelId* FindColmapModel(int id);

/// One camera of a COLMAP model from the words of its line in `cameras.txt`: id, model, width,
/// height, parameters. COLMAP puts pixel centres at one half: cx and cy lose 0.5.
/// Models with terms that we lack are read where these are zero. Throws std::runtime_error as
/// "file:line: camera 1: ..."; without a line where it is 0.
Camera ReadColmapCamera(const std::filesystem::path& file,
                        const std::vector<std::string>& words,
                        int line = 0);

}  // namespace rotslam
