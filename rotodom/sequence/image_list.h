#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rotodom/camera/read_camera.h"

namespace rotslam {

// Functions on files and folders that the forms in rotodom/sequence/forms share.

bool IsFolder(const std::filesystem::path& path);
bool IsFile(const std::filesystem::path& path);

/// A file or folder and, after a colon, a part of it: "walk.bag:/cam0/image_raw". A path that
/// exists as it stands has no part, nor has one none of whose beginnings exists.
struct InputReference {
  std::filesystem::path file;
  std::string part;
};
InputReference ParseInputReference(const std::filesystem::path& path);

/// `text` with small letters instead of capital ones, as far as it is ASCII.
std::string Lower(std::string_view text);

/// The extension in lower case: ".png"; empty where there is none.
std::string LowerExtension(const std::filesystem::path& file);

/// Is it called like an image that ReadImageFile reads?
bool IsImageName(const std::filesystem::path& file);

/// Order of names in which runs of digits count as numbers: frame2 < frame10.
bool NaturalLess(const std::string& a, const std::string& b);

/// The images of a folder, ordered by name as NaturalLess says. Throws std::runtime_error when the
/// folder cannot be listed.
std::vector<std::filesystem::path> ImagesIn(const std::filesystem::path& folder);

/// The first of the candidates that is a file.
std::optional<std::filesystem::path> FirstFile(
    std::initializer_list<std::filesystem::path> candidates);

/// The same as a reference to a calibration file whose camera the images tell.
std::optional<CameraReference> FirstCamera(std::initializer_list<std::filesystem::path> candidates);

/// The calibration in one of `folders`, the first of: our `camera.yaml`, then files with the names
/// that other programs give. Further ones are named in `notes`.
std::optional<CameraReference> FindCamera(const std::vector<std::filesystem::path>& folders,
                                          std::vector<std::string>& notes);

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

/// The cells of a line, which semicolons separate, else commas, else blanks. A comma between digits
/// in a line with blanks is a decimal one. A date and the time of day behind it are one cell.
std::vector<std::string> CutIntoCells(std::string_view line);

/// Throws std::runtime_error: "path: reason".
[[noreturn]] void Fail(const std::filesystem::path& path, const std::string& reason);

/// Throws std::runtime_error: "path:line: is '...', expected ...".
[[noreturn]] void FailAtLine(const std::filesystem::path& file,
                             const TextLine& line,
                             const std::string& expected);

/// "a.png, b.png and 3 more".
std::string SomeOf(const std::vector<std::string>& names, std::size_t count);

/// Finds the files that a list names, also where the list comes from another system: backslashes,
/// absolute paths of another machine, another case or, for images, another extension.
class ListedFiles {
 public:
  /// @param folders  where the names count from, and where else a file of that name may lie.
  ListedFiles(std::filesystem::path list, std::vector<std::filesystem::path> folders);

  /// The file of this name; where it is not there, the path at which it should be.
  std::filesystem::path Find(const std::string& name);

  /// Adds the assumptions of Find(), and the files that are missing.
  void AddNotes(std::vector<std::string>& notes) const;

 private:
  using Index = std::map<std::string, std::filesystem::path>;

  const Index& IndexOf(const std::filesystem::path& folder);

  std::filesystem::path list_;
  std::vector<std::filesystem::path> folders_;
  std::map<std::filesystem::path, Index> indices_;  // by name in small letters and by its stem
  std::vector<std::string> elsewhere_;
  std::vector<std::string> renamed_;
  std::vector<std::string> missing_;
  std::size_t count_ = 0;
};

}  // namespace rotslam
