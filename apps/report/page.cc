#include "apps/report/page.h"

#include <vector>

#include "apps/page/embedded_file.h"
#include "apps/page/page_parts.h"

ROTSLAM_EMBED(page, ROTSLAM_REPORT_DIR "/page.html");
ROTSLAM_EMBED(data_script, ROTSLAM_REPORT_DIR "/data.js");
ROTSLAM_EMBED(scene_script, ROTSLAM_REPORT_DIR "/scene.js");
ROTSLAM_EMBED(panels_script, ROTSLAM_REPORT_DIR "/panels.js");

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

std::string Page(const Json& data) {
  const std::string json = EmbeddedJson(data);
  std::vector<PagePart> parts = SharedPageParts();
  parts.insert(parts.end(),
               {{"{{data}}", json},
                {"{{data_script}}", ROTSLAM_EMBEDDED(data_script)},
                {"{{scene_script}}", ROTSLAM_EMBEDDED(scene_script)},
                {"{{panels_script}}", ROTSLAM_EMBEDDED(panels_script)}});
  return FillPage(ROTSLAM_EMBEDDED(page), parts);
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
