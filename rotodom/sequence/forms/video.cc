#include "rotodom/sequence/video/video.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// FFmpeg shows some of these as film (text as teletype, pictures as one-frame clips).
bool IsNoVideoName(const fs::path& file) {
  static constexpr std::array<std::string_view, 9> kExtensions = {
      ".txt", ".csv", ".yaml", ".yml", ".json", ".xml", ".ply", ".md", ".g2o"};
  const std::string extension = LowerExtension(file);
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

}  // namespace

SequenceForm SequenceFormVideo() {
  SequenceForm form;
  form.name = "video";
  form.description = "a file that FFmpeg can open";
  form.rank = 100;
  form.recognises = [](const fs::path& path) {
    return IsFile(path) && !IsImageName(path) && !IsNoVideoName(path);
  };
  form.list = [](const fs::path& path, const SequenceOptions&) {
    Layout layout;
    layout.is_video = true;
    layout.folder = path;
    layout.camera = FirstCamera(
        {fs::path(path).replace_extension(".yaml"), path.parent_path() / "camera.yaml"});
    return layout;
  };
  form.open = OpenVideo;
  return form;
}

}  // namespace rotslam::forms
