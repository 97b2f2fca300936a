#include "rotodom/sequence/image_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "rotodom/camera/camera_form.h"
#include "rotodom/sequence/times.h"
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

InputReference ParseInputReference(const fs::path& path) {
  std::error_code error;
  if (fs::exists(path, error)) return {path, {}};
  const std::string text = path.string();
  for (std::size_t colon = text.find(':'); colon != std::string::npos;
       colon = text.find(':', colon + 1)) {
    const fs::path file = text.substr(0, colon);
    if (fs::exists(file, error)) return {file, text.substr(colon + 1)};
  }
  return {path, {}};
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) {
    return static_cast<char>(c < 128 ? std::tolower(c) : c);
  });
  return lower;
}

std::string LowerExtension(const fs::path& file) { return Lower(file.extension().string()); }

bool IsImageName(const fs::path& file) {
  static constexpr std::array<std::string_view, 13> kExtensions = {".png",
                                                                   ".jpg",
                                                                   ".jpeg",
                                                                   ".bmp",
                                                                   ".tif",
                                                                   ".tiff",
                                                                   ".pgm",
                                                                   ".ppm",
                                                                   ".pnm",
                                                                   ".webp",
                                                                   ".heic",
                                                                   ".heif",
                                                                   ".avif"};
  const std::string extension = LowerExtension(file);
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end() &&
         file.filename().string().front() != '.';
}

bool NaturalLess(const std::string& a, const std::string& b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
      continue;
    }
    const auto run = [&](const std::string& text, std::size_t& from) {
      while (from < text.size() && text[from] == '0') ++from;
      const std::size_t begin = from;
      while (from < text.size() && is_digit(text[from])) ++from;
      return std::string_view(text).substr(begin, from - begin);
    };
    const std::string_view number_a = run(a, i);
    const std::string_view number_b = run(b, j);
    if (number_a.size() != number_b.size()) return number_a.size() < number_b.size();
    if (number_a != number_b) return number_a < number_b;
  }
  const std::size_t rest_a = a.size() - i;
  const std::size_t rest_b = b.size() - j;
  if (rest_a != rest_b) return rest_a < rest_b;
  return a < b;  // equal but for leading zeros
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

namespace {

// Names of calibration files, the likelier ones first.
std::vector<std::string> CalibrationNames() {
  std::vector<std::string> names = {"camera.yaml", "camera.yml"};
  for (const CameraForm& form : CameraForms()) {
    names.insert(names.end(), form.file_names.begin(), form.file_names.end());
  }
  // Names that say nothing of the form.
  names.insert(names.end(),
               {"calibration.yaml",
                "calib.yaml",
                "calibration.yml",
                "calib.yml",
                "intrinsics.yaml",
                "intrinsics.yml",
                "calibration.xml",
                "calib.json"});
  // A calibration was measured; the camera of a reconstruction may be anything.
  std::stable_partition(names.begin(), names.end(), [](const std::string& name) {
    return !name.ends_with(".json") && !name.starts_with("cameras.");
  });
  return names;
}

}  // namespace

std::optional<CameraReference> FindCamera(const std::vector<fs::path>& folders,
                                          std::vector<std::string>& notes) {
  std::vector<fs::path> found;
  for (const std::string& name : CalibrationNames()) {
    for (const fs::path& folder : folders) {
      const fs::path file = folder / name;
      const bool is_new = std::find(found.begin(), found.end(), file) == found.end();
      if (is_new && IsFile(file)) found.push_back(file);
    }
  }
  if (found.empty()) return std::nullopt;
  if (found.size() > 1) {
    std::vector<std::string> others;
    for (std::size_t k = 1; k < found.size(); ++k) others.push_back(found[k].string());
    notes.push_back("the calibration is " + found.front().string() + "; not used: " +
                    SomeOf(others, others.size()) + " (--camera FILE takes another)");
  }
  return CameraReference{found.front(), {}};
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

std::vector<std::string> CutIntoCells(std::string_view line) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const std::string_view text = Trimmed(line);
  char separator = ' ';
  if (text.find(';') != std::string_view::npos) {
    separator = ';';
  } else if (text.find(',') != std::string_view::npos) {
    const bool has_blanks = text.find_first_of(" \t") != std::string_view::npos;
    bool all_are_decimal = has_blanks;
    for (std::size_t k = 0; k < text.size(); ++k) {
      if (text[k] != ',') continue;
      all_are_decimal = all_are_decimal && k > 0 && is_digit(text[k - 1]) && k + 1 < text.size() &&
                        is_digit(text[k + 1]);
    }
    if (!all_are_decimal) separator = ',';
  }
  std::vector<std::string> cells;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end =
        std::min(separator == ' ' ? text.find_first_of(" \t", begin) : text.find(separator, begin),
                 text.size());
    std::string_view cell = Trimmed(text.substr(begin, end - begin));
    if (cell.size() > 1 && cell.front() == '"' && cell.back() == '"') {
      cell = cell.substr(1, cell.size() - 2);
    }
    // Blanks in a row are one separator; commas leave empty cells.
    const bool is_clock =
        !cells.empty() && separator == ' ' && ParseDate(cells.back() + " " + std::string(cell));
    if (is_clock) {
      cells.back() += " " + std::string(cell);
    } else if (separator != ' ' || !cell.empty()) {
      cells.emplace_back(cell);
    }
    begin = end + 1;
  }
  return cells;
}

void Fail(const fs::path& path, const std::string& reason) {
  throw std::runtime_error(path.string() + ": " + reason);
}

void FailAtLine(const fs::path& file, const TextLine& line, const std::string& expected) {
  throw std::runtime_error(
      AtLine(file, line.number, "is '" + line.text.substr(0, 60) + "', expected " + expected));
}

std::string SomeOf(const std::vector<std::string>& names, std::size_t count) {
  constexpr std::size_t kShown = 3;
  std::string text;
  const std::size_t shown = count > kShown ? kShown - 1 : count;
  for (std::size_t k = 0; k < std::min(shown, names.size()); ++k) {
    const bool is_last = k + 1 == count;
    text += (k == 0 ? "" : is_last ? " and " : ", ") + names[k];
  }
  return count > shown ? text + " and " + std::to_string(count - shown) + " more" : text;
}

// ---- ListedFiles

ListedFiles::ListedFiles(fs::path list, std::vector<fs::path> folders)
    : list_(std::move(list)), folders_(std::move(folders)) {}

const ListedFiles::Index& ListedFiles::IndexOf(const fs::path& folder) {
  const auto known = indices_.find(folder);
  if (known != indices_.end()) return known->second;
  Index& index = indices_[folder];
  std::error_code error;
  for (fs::directory_iterator entries(folder, error), end; !error && entries != end;
       entries.increment(error)) {
    const fs::path& file = entries->path();
    const std::string name = file.filename().string();
    index[Lower(Trimmed(name))] = file;
    if (IsImageName(file)) index.emplace(Lower(file.stem().string()), file);
  }
  return index;
}

fs::path ListedFiles::Find(const std::string& name) {
  ++count_;
  std::string text(Trimmed(name));
  std::replace(text.begin(), text.end(), '\\', '/');
  const bool has_drive = text.size() > 2 && text[1] == ':' && text[2] == '/';
  if (has_drive) text.erase(0, 2);
  const fs::path listed(text);
  const bool is_absolute = text.starts_with('/');
  fs::path expected = is_absolute ? listed : (folders_.front() / listed).lexically_normal();
  std::error_code ignored;
  if (!has_drive && fs::exists(expected, ignored)) return expected;
  for (const fs::path& folder : folders_) {
    // The listed folder, and the folder itself for a path of another machine.
    const fs::path relative = is_absolute ? listed.relative_path() : listed;
    for (const fs::path& place : {(folder / relative).parent_path(), folder}) {
      fs::path there = (place / listed.filename()).lexically_normal();
      if (fs::exists(there, ignored)) {
        elsewhere_.push_back(name);
        return there;
      }
      const Index& index = IndexOf(place);
      auto found = index.find(Lower(listed.filename().string()));
      if (found == index.end() && IsImageName(listed)) {
        found = index.find(Lower(listed.stem().string()));
      }
      if (found == index.end()) continue;
      renamed_.push_back(name);
      return found->second;
    }
  }
  missing_.push_back(name);
  return expected;
}

void ListedFiles::AddNotes(std::vector<std::string>& notes) const {
  const std::string list = list_.filename().string();
  if (!elsewhere_.empty()) {
    notes.push_back(list + " names files in other folders (" + elsewhere_.front() +
                    "): those of the same name beside the list are taken");
  }
  if (!renamed_.empty()) {
    notes.push_back(list + " spells " + std::to_string(renamed_.size()) +
                    " names another way than the files do (" + renamed_.front() +
                    "): the files are taken");
  }
  if (!missing_.empty()) {
    notes.push_back(list + " lists " + std::to_string(missing_.size()) + " of " +
                    std::to_string(count_) + " files that are not there (" +
                    SomeOf(missing_, missing_.size()) + "): they count as unreadable frames");
  }
}

}  // namespace rotslam
