#include "rotodom/sequence/layout.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <initializer_list>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

namespace rotslam {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const fs::path& path, const std::string& reason) {
  throw std::runtime_error(path.string() + ": " + reason);
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

bool AllDigits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), IsDigit);
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

// FFmpeg shows some of these as film (text as teletype, pictures as one-frame clips).
bool IsNoVideoName(const fs::path& file) {
  static constexpr std::array<std::string_view, 9> kExtensions = {
      ".txt", ".csv", ".yaml", ".yml", ".json", ".xml", ".ply", ".md", ".g2o"};
  const std::string extension = LowerExtension(file);
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

std::optional<double> ParseSeconds(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<std::int64_t> ParseInteger(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Whole and fractional part apart, so that no digit is lost before the last division.
double SecondsFromTicks(std::int64_t ticks, std::int64_t ticks_per_second) {
  const std::int64_t seconds = ticks / ticks_per_second;
  const std::int64_t rest = ticks % ticks_per_second;
  return static_cast<double>(seconds) +
         static_cast<double>(rest) / static_cast<double>(ticks_per_second);
}

std::string_view Trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

struct TextLine {
  int number = 0;  // from 1
  std::string text;
};

// Lines of a text file that are neither blank nor comments, trimmed.
std::vector<TextLine> ReadLines(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) Fail(file, "cannot be opened");
  std::vector<TextLine> lines;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::string_view text = Trimmed(line);
    if (!text.empty() && text.front() != '#') lines.push_back({number, std::string(text)});
  }
  if (stream.bad()) Fail(file, "cannot be read");
  return lines;
}

[[noreturn]] void FailAtLine(const fs::path& file,
                             const TextLine& line,
                             const std::string& wanted) {
  Fail(file,
       "line " + std::to_string(line.number) + " is '" + line.text.substr(0, 60) + "', expected " +
           wanted);
}

bool IsFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
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

// The times of a list, the first word of each line: seconds, or where all of them say so as
// file names do, ms, us or ns since 1970.
std::vector<double> TimesOf(const fs::path& list,
                            const std::vector<TextLine>& lines,
                            const std::string& wanted) {
  std::vector<std::string> words;
  words.reserve(lines.size());
  for (const TextLine& line : lines) {
    words.push_back(line.text.substr(0, line.text.find_first_of(" \t")));
  }
  if (auto times_s = TimestampsFromNames(words); times_s && !words.empty()) return *times_s;
  std::vector<double> times_s;
  times_s.reserve(lines.size());
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const auto time_s = ParseSeconds(words[k]);
    if (!time_s) FailAtLine(list, lines[k], wanted);
    times_s.push_back(*time_s);
  }
  return times_s;
}

std::optional<fs::path> FirstFile(std::initializer_list<fs::path> candidates) {
  for (const fs::path& candidate : candidates) {
    if (IsFile(candidate)) return candidate;
  }
  return std::nullopt;
}

std::optional<fs::path> FindGroundTruth(const fs::path& root) {
  return FirstFile({root / "groundtruth_tum.txt",
                    root / "groundtruth_cam0_tum.txt",
                    root / "groundtruth.txt",
                    root / "poses.txt"});
}

Layout ListEuroc(const fs::path& camera_folder) {
  Layout layout;
  layout.kind = SequenceKind::kEuroc;
  layout.folder = camera_folder / "data";
  const fs::path list = camera_folder / "data.csv";
  for (const TextLine& line : ReadLines(list)) {
    const std::size_t comma = line.text.find(',');
    const auto nanoseconds = ParseInteger(Trimmed(std::string_view(line.text).substr(0, comma)));
    if (!nanoseconds || comma == std::string::npos) {
      FailAtLine(list, line, "'nanoseconds,file name'");
    }
    const std::string name(Trimmed(std::string_view(line.text).substr(comma + 1)));
    layout.entries.push_back({layout.folder / name, SecondsFromTicks(*nanoseconds, 1'000'000'000)});
  }
  if (layout.entries.empty()) Fail(list, "lists no images");
  const fs::path root = camera_folder.parent_path().parent_path();
  layout.camera_file = FirstFile({root / "camera.yaml",
                                  camera_folder.parent_path() / "camera.yaml",
                                  camera_folder / "camera.yaml",
                                  camera_folder / "sensor.yaml"});
  // A data set's ground truth is of its cam0.
  if (camera_folder.filename() == "cam0") layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

Layout ListKitti(const fs::path& image_folder) {
  const fs::path root = image_folder.parent_path();
  Layout layout;
  layout.kind = SequenceKind::kKittiOdometry;
  layout.folder = image_folder;
  const fs::path list = root / "times.txt";
  if (!IsFile(list)) {
    Fail(list, "is missing; give " + image_folder.string() + " to take the images without it");
  }
  const std::vector<TextLine> lines = ReadLines(list);
  for (const TextLine& line : lines) {
    if (line.text.find_first_of(" \t") != std::string::npos) FailAtLine(list, line, "seconds");
  }
  const std::vector<double> times_s = TimesOf(list, lines, "seconds");
  const std::vector<fs::path> files = ImagesIn(image_folder);
  if (files.empty()) Fail(image_folder, "holds no images");
  for (std::size_t k = 0; k < files.size(); ++k) {
    // The name is the number of the line, so a part of the images may be given with all the times.
    const std::string stem = files[k].stem().string();
    const auto number = AllDigits(stem) ? ParseInteger(stem) : std::nullopt;
    const auto row = number ? static_cast<std::size_t>(*number) : k;
    if (row >= times_s.size()) {
      Fail(list, "has " + std::to_string(times_s.size()) + " times, none for " + files[k].string());
    }
    layout.entries.push_back({files[k], times_s[row]});
  }
  layout.camera_file = FirstFile({root / "camera.yaml", root / "calib.txt"});
  const fs::path poses = (root.filename().string() + ".txt");
  layout.ground_truth_file = FindGroundTruth(root);
  if (!layout.ground_truth_file) {
    layout.ground_truth_file = FirstFile({root.parent_path().parent_path() / "poses" / poses});
  }
  return layout;
}

Layout ListTum(const fs::path& root) {
  Layout layout;
  layout.kind = SequenceKind::kTumRgbd;
  layout.folder = root;
  const fs::path list = root / "rgb.txt";
  const std::vector<TextLine> lines = ReadLines(list);
  const std::vector<double> times_s = TimesOf(list, lines, "'seconds file name'");
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const std::string_view text = lines[k].text;
    const std::size_t blank = text.find_first_of(" \t");
    if (blank == std::string_view::npos) FailAtLine(list, lines[k], "'seconds file name'");
    layout.entries.push_back({root / std::string(Trimmed(text.substr(blank))), times_s[k]});
  }
  if (layout.entries.empty()) Fail(list, "lists no images");
  layout.camera_file = FirstFile({root / "camera.yaml"});
  layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

Layout ListImageFolder(const fs::path& path, double fps) {
  Layout layout;
  layout.kind = SequenceKind::kImageFolder;
  layout.folder = path;
  std::vector<fs::path> files = ImagesIn(path);
  if (files.empty() && IsFolder(path / "images")) {
    layout.folder = path / "images";
    files = ImagesIn(layout.folder);
  }
  // 7-Scenes keeps the depth maps beside the pictures, told apart by `.color.` in the name.
  const auto is_colour = [](const fs::path& file) { return file.stem().extension() == ".color"; };
  if (std::any_of(files.begin(), files.end(), is_colour)) {
    std::erase_if(files, [&](const fs::path& file) { return !is_colour(file); });
  }
  if (files.empty()) {
    Fail(layout.folder, "holds no images, and nothing that names a known data set layout");
  }
  std::vector<std::string> stems;
  stems.reserve(files.size());
  for (const fs::path& file : files) stems.push_back(file.stem().string());
  const auto times_s = TimestampsFromNames(stems);
  for (std::size_t k = 0; k < files.size(); ++k) {
    const double time_s = times_s ? (*times_s)[k] : static_cast<double>(k) / fps;
    layout.entries.push_back({std::move(files[k]), time_s});
  }
  std::stable_sort(
      layout.entries.begin(), layout.entries.end(), [](const ImageEntry& a, const ImageEntry& b) {
        return a.timestamp_s < b.timestamp_s;
      });
  const fs::path root =
      layout.folder.filename() == "images" ? layout.folder.parent_path() : layout.folder;
  layout.camera_file = FirstFile({layout.folder / "camera.yaml", root / "camera.yaml"});
  layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

// Seconds of one decimal number with a point, such as 1000.033333.
std::optional<double> SecondsWithPoint(const std::string& stem) {
  const std::size_t point = stem.find('.');
  if (point == std::string::npos) return std::nullopt;
  if (!AllDigits(stem.substr(0, point)) || !AllDigits(stem.substr(point + 1))) return std::nullopt;
  return ParseSeconds(stem);
}

// Seconds of a count of ticks since 1970, if that is a date from 2000 to 2099.
std::optional<double> SecondsSince1970(const std::string& stem, std::int64_t ticks_per_second) {
  constexpr std::int64_t kYear2000 = 946'684'800;
  constexpr std::int64_t kYear2100 = 4'102'444'800;
  const auto ticks = AllDigits(stem) ? ParseInteger(stem) : std::nullopt;
  if (!ticks || *ticks / ticks_per_second < kYear2000 || *ticks / ticks_per_second >= kYear2100) {
    return std::nullopt;
  }
  return SecondsFromTicks(*ticks, ticks_per_second);
}

}  // namespace

bool NaturalLess(const std::string& a, const std::string& b) {
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!IsDigit(a[i]) || !IsDigit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
      continue;
    }
    const auto run = [](const std::string& text, std::size_t& from) {
      while (from < text.size() && text[from] == '0') ++from;
      const std::size_t begin = from;
      while (from < text.size() && IsDigit(text[from])) ++from;
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

std::optional<std::vector<double>> TimestampsFromNames(const std::vector<std::string>& stems) {
  const auto read_all = [&](const auto& read) -> std::optional<std::vector<double>> {
    std::vector<double> times_s;
    for (const std::string& stem : stems) {
      const std::optional<double> time = read(stem);
      if (!time) return std::nullopt;
      times_s.push_back(*time);
    }
    return times_s;
  };
  if (auto times_s = read_all(SecondsWithPoint)) return times_s;
  for (const std::int64_t ticks_per_second : {1'000LL, 1'000'000LL, 1'000'000'000LL}) {
    const auto read = [&](const std::string& stem) {
      return SecondsSince1970(stem, ticks_per_second);
    };
    if (auto times_s = read_all(read)) return times_s;
  }
  return std::nullopt;
}

Layout FindLayout(const fs::path& given, double fps) {
  std::error_code error;
  if (!fs::exists(given, error)) Fail(given, "no such file or folder");
  // Without a trailing slash or dots, so that names and parents are what they seem.
  fs::path path = fs::absolute(given).lexically_normal();
  if (path.filename().empty()) path = path.parent_path();
  if (!IsFolder(path)) {
    if (IsImageName(path)) Fail(path, "is a single image; give the folder that holds the images");
    if (IsNoVideoName(path)) Fail(path, "is no video; give the folder of the data set");
    Layout layout;
    layout.kind = SequenceKind::kVideo;
    layout.folder = path;
    layout.camera_file =
        FirstFile({fs::path(path).replace_extension(".yaml"), path.parent_path() / "camera.yaml"});
    return layout;
  }
  for (const fs::path& camera_folder : {path / "mav0" / "cam0", path / "cam0", path}) {
    if (IsFile(camera_folder / "data.csv")) return ListEuroc(camera_folder);
  }
  if (IsFolder(path / "mav0")) Fail(path / "mav0" / "cam0" / "data.csv", "is missing");
  for (const char* name : {"image_0", "image_2"}) {
    if (IsFolder(path / name)) return ListKitti(path / name);
  }
  if (path.filename().string().rfind("image_", 0) == 0 &&
      IsFile(path.parent_path() / "times.txt")) {
    return ListKitti(path);
  }
  if (IsFile(path / "rgb.txt")) return ListTum(path);
  return ListImageFolder(path, fps);
}

}  // namespace rotslam
