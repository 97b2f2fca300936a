#include <algorithm>
#include <array>
#include <map>
#include <string_view>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// Names of folders that hold the images of the folder above them and nothing else.
constexpr std::array<std::string_view, 6> kImageFolders = {
    "images", "image", "rgb", "color", "frames", "data"};

// What converts files with this extension; empty where they are nothing to convert.
std::string Conversion(const std::string& extension) {
  static const std::map<std::string, std::string> kCommands = {
      {".gif", "ffmpeg -i in.gif %06d.png"},
      {".dng", "darktable-cli in.dng out.png, or dcraw -T in.dng"},
      {".jxl", "djxl in.jxl out.png"},
      {".jp2", "convert in.jp2 out.png"},
      {".exr", "convert in.exr out.tiff"},
      {".tga", "convert in.tga out.png"}};
  const auto found = kCommands.find(extension);
  if (found != kCommands.end()) return found->second;
  for (const char* raw : {".raw", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".raf", ".pef"}) {
    if (extension == raw) return kCommands.at(".dng");
  }
  return {};
}

// Why a folder without images is none, and what to give instead.
std::string WhyNoImages(const fs::path& folder) {
  std::map<std::string, std::size_t> counts;
  std::vector<std::string> folders;
  std::string video;
  std::string archive;
  std::error_code error;
  for (fs::directory_iterator entries(folder, error), end; !error && entries != end;
       entries.increment(error)) {
    const fs::path& file = entries->path();
    const std::string extension = LowerExtension(file);
    std::error_code ignored;
    if (entries->is_directory(ignored)) {
      fs::directory_iterator inner(file, ignored);
      const bool has_images = std::any_of(fs::begin(inner), fs::end(inner), [](const auto& entry) {
        return IsImageName(entry.path());
      });
      if (has_images) folders.push_back(file.filename().string());
      continue;
    }
    if (!Conversion(extension).empty()) ++counts[extension];
    for (const char* name : {".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v"}) {
      if (extension == name) video = file.filename().string();
    }
    for (const char* name : {".zip", ".tar", ".gz", ".tgz", ".7z"}) {
      if (extension == name) archive = file.filename().string();
    }
  }
  std::sort(folders.begin(), folders.end());
  if (!folders.empty()) {
    return "holds no images itself, but " + SomeOf(folders, folders.size()) + " in it " +
           (folders.size() == 1 ? "does" : "do") + ": give " + (folder / folders.front()).string();
  }
  if (!counts.empty()) {
    const auto& [extension, count] = *counts.begin();
    return "holds " + std::to_string(count) + " files " + extension +
           ", which are not read; convert them: " + Conversion(extension);
  }
  if (!video.empty()) return "holds no images; for the video give " + (folder / video).string();
  if (!archive.empty()) return "holds no images, but " + archive + ": unpack it";
  return "holds no images, and nothing that names a known data set layout";
}

Layout ListImageFolder(const fs::path& path, const SequenceOptions& options) {
  Layout layout;
  layout.folder = path;
  std::vector<fs::path> files = ImagesIn(path);
  for (const std::string_view name : kImageFolders) {
    if (!files.empty() || !IsFolder(path / name)) continue;
    layout.folder = path / name;
    files = ImagesIn(layout.folder);
  }
  if (files.empty()) Fail(path, WhyNoImages(path));
  const std::string name = layout.folder.filename().string();
  const bool is_part =
      std::find(kImageFolders.begin(), kImageFolders.end(), name) != kImageFolders.end();
  const fs::path root = is_part ? layout.folder.parent_path() : layout.folder;
  AddImages(std::move(files), {layout.folder, layout.folder.parent_path()}, options, layout);
  layout.camera = FindCamera({layout.folder, root}, layout.notes);
  layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

}  // namespace

SequenceForm SequenceFormImageFolder() {
  SequenceForm form;
  form.name = "image folder";
  form.description =
      "images in the folder itself, else in its `images/`, `rgb/`, `color/`, `frames/`";
  form.rank = 100;
  form.recognises = IsFolder;
  form.list = ListImageFolder;
  return form;
}

}  // namespace rotslam::forms
