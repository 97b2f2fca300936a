#include "rotodom/sequence/image_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "rotodom/sequence/layout.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

namespace fs = std::filesystem;

bool IsFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

std::string LowerExtension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return extension;
}

bool IsImageName(const fs::path& file) {
  static constexpr std::array<std::string_view, 10> kExtensions = {
      ".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".pnm", ".webp"};
  const std::string extension = LowerExtension(file);
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end() &&
         file.filename().string().front() != '.';
}

std::vector<fs::path> ImagesIn(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) Fail(folder, "cannot be listed: " + error.message());
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : entries) {
    if (!entry.is_directory() && IsImageName(entry.path())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return files;
}

std::optional<fs::path> FirstFile(std::initializer_list<fs::path> candidates) {
  for (const fs::path& candidate : candidates) {
    if (IsFile(candidate)) return candidate;
  }
  return std::nullopt;
}

std::optional<CameraReference> FirstCamera(std::initializer_list<fs::path> candidates) {
  const std::optional<fs::path> file = FirstFile(candidates);
  return file ? std::optional<CameraReference>({*file, {}}) : std::nullopt;
}

std::optional<fs::path> FindGroundTruth(const fs::path& root) {
  return FirstFile({root / "groundtruth_tum.txt",
                    root / "groundtruth_cam0_tum.txt",
                    root / "groundtruth.txt",
                    root / "poses.txt"});
}

std::string_view Trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

std::vector<TextLine> ReadLines(const fs::path& file) {
  std::istringstream stream(ReadText(file));
  std::vector<TextLine> lines;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::string_view text = Trimmed(line);
    if (!text.empty() && text.front() != '#') lines.push_back({number, std::string(text)});
  }
  return lines;
}

void Fail(const fs::path& path, const std::string& reason) {
  throw std::runtime_error(path.string() + ": " + reason);
}

void FailAtLine(const fs::path& file, const TextLine& line, const std::string& expected) {
  throw std::runtime_error(
      AtLine(file, line.number, "is '" + line.text.substr(0, 60) + "', expected " + expected));
}

}  // namespace rotslam
