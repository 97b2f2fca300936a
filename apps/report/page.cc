#include "apps/report/page.h"

#include <string_view>
#include <utility>
#include <vector>

// The assembler copies the files into the object; see rotodom/loop/default_vocabulary.cc.
#define ROTSLAM_EMBED(name, path)                 \
  asm(".pushsection .rodata\n"                    \
      ".global rotslam_" #name                    \
      "_begin\n"                                  \
      ".global rotslam_" #name                    \
      "_end\n"                                    \
      "rotslam_" #name                            \
      "_begin:\n"                                 \
      ".incbin \"" path                           \
      "\"\n"                                      \
      "rotslam_" #name                            \
      "_end:\n"                                   \
      ".byte 0\n"                                 \
      ".popsection\n");                           \
  extern "C" const char rotslam_##name##_begin[]; \
  extern "C" const char rotslam_##name##_end[]

ROTSLAM_EMBED(page, ROTSLAM_REPORT_DIR "/page.html");
ROTSLAM_EMBED(style, ROTSLAM_REPORT_DIR "/style.css");
ROTSLAM_EMBED(data_script, ROTSLAM_REPORT_DIR "/data.js");
ROTSLAM_EMBED(chart_script, ROTSLAM_REPORT_DIR "/chart.js");
ROTSLAM_EMBED(scene_script, ROTSLAM_REPORT_DIR "/scene.js");
ROTSLAM_EMBED(panels_script, ROTSLAM_REPORT_DIR "/panels.js");
ROTSLAM_EMBED(three, ROTSLAM_THREE_DIR "/three.min.js");
ROTSLAM_EMBED(orbit_controls, ROTSLAM_THREE_DIR "/examples/js/controls/OrbitControls.js");

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

#define ROTSLAM_EMBEDDED(name) \
  std::string_view(rotslam_##name##_begin, rotslam_##name##_end - rotslam_##name##_begin)

std::string Page(const Json& data) {
  const std::string json = EmbeddedJson(data);
  const std::vector<std::pair<std::string_view, std::string_view>> parts = {
      {"{{style}}", ROTSLAM_EMBEDDED(style)},
      {"{{three}}", ROTSLAM_EMBEDDED(three)},
      {"{{orbit_controls}}", ROTSLAM_EMBEDDED(orbit_controls)},
      {"{{data}}", json},
      {"{{data_script}}", ROTSLAM_EMBEDDED(data_script)},
      {"{{chart_script}}", ROTSLAM_EMBEDDED(chart_script)},
      {"{{scene_script}}", ROTSLAM_EMBEDDED(scene_script)},
      {"{{panels_script}}", ROTSLAM_EMBEDDED(panels_script)}};
  std::string_view rest = ROTSLAM_EMBEDDED(page);
  std::string page;
  for (const auto& [mark, content] : parts) {
    const std::size_t at = rest.find(mark);
    page.append(rest.substr(0, at)).append(content);
    rest.remove_prefix(at + mark.size());
  }
  return page.append(rest);
}

// Every second of the thumbnails.
Thumbnails Halved(const Thumbnails& thumbnails) {
  Thumbnails half;
  for (std::size_t k = 0; k < thumbnails.frames.size(); k += 2) {
    half.frames.push_back(thumbnails.frames[k]);
    half.jpegs.push_back(thumbnails.jpegs[k]);
  }
  return half;
}

}  // namespace

std::string EmbeddedJson(const Json& data) {
  std::string text;
  // Names of files may be no UTF-8.
  for (const char c : data.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

std::string ReportPage(const RunData& run, const ReportOptions& options) {
  Thumbnails thumbnails = MakeThumbnails(run, options.sequence, options.thumbnails);
  std::string page = Page(PageData(run, thumbnails, options.limits));
  while (page.size() > options.max_bytes && thumbnails.frames.size() > 1) {
    thumbnails = Halved(thumbnails);
    page = Page(PageData(run, thumbnails, options.limits));
  }
  return page;
}

}  // namespace rotslam
