#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rotodom/camera/read_camera.h"

namespace rotslam {

// What the forms in rotodom/sequence/forms have in common: looking around on disk.

bool IsFolder(const std::filesystem::path& path);
bool IsFile(const std::filesystem::path& path);

/// The extension in lower case: ".png"; empty where there is none.
std::string LowerExtension(const std::filesystem::path& file);

/// Is it called like an image that ReadImageFile reads?
bool IsImageName(const std::filesystem::path& file);

/// The images of a folder, ordered by name as NaturalLess says. Throws std::runtime_error when the
/// folder cannot be listed.
std::vector<std::filesystem::path> ImagesIn(const std::filesystem::path& folder);

/// The first of the candidates that is a file.
std::optional<std::filesystem::path> FirstFile(
    std::initializer_list<std::filesystem::path> candidates);

/// The same as a reference to a calibration file whose camera the images tell.
std::optional<CameraReference> FirstCamera(std::initializer_list<std::filesystem::path> candidates);

/// `groundtruth_tum.txt`, `groundtruth_cam0_tum.txt`, `groundtruth.txt` or `poses.txt` in `root`.
std::optional<std::filesystem::path> FindGroundTruth(const std::filesystem::path& root);

/// `text` without the blanks at both ends.
std::string_view Trimmed(std::string_view text);

/// A line of a text file.
struct TextLine {
  int number = 0;  // 1 is the file's first
  std::string text;
};

/// The lines of a text file that are neither blank nor start with '#', trimmed. Throws as ReadText.
std::vector<TextLine> ReadLines(const std::filesystem::path& file);

/// Throws std::runtime_error: "path: reason".
[[noreturn]] void Fail(const std::filesystem::path& path, const std::string& reason);

/// Throws std::runtime_error: "path:line: is '...', expected ...".
[[noreturn]] void FailAtLine(const std::filesystem::path& file,
                             const TextLine& line,
                             const std::string& expected);

}  // namespace rotslam
