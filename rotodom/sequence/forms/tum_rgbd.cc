#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/sequence/times.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

Layout ListTum(const fs::path& root) {
  Layout layout;
  layout.times_source = "rgb.txt";
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
  layout.camera = FirstCamera({root / "camera.yaml"});
  layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

}  // namespace

SequenceForm SequenceFormTumRgbd() {
  SequenceForm form;
  form.name = "TUM RGB-D";
  form.description = "`rgb.txt`: a time and the name of an image in each line";
  form.recognises = [](const fs::path& path) { return IsFile(path / "rgb.txt"); };
  form.list = [](const fs::path& path, const SequenceOptions&) { return ListTum(path); };
  return form;
}

}  // namespace rotslam::forms
