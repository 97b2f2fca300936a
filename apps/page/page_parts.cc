#include "apps/page/page_parts.h"

#include <algorithm>
#include <stdexcept>

#include "apps/page/embedded_file.h"

ROTSLAM_EMBED(three_license, ROTSLAM_PAGE_DIR "/three_license.html");
ROTSLAM_EMBED(page_style, ROTSLAM_PAGE_DIR "/style.css");
ROTSLAM_EMBED(three, ROTSLAM_THREE_DIR "/three.min.js");
ROTSLAM_EMBED(orbit_controls, ROTSLAM_THREE_DIR "/examples/js/controls/OrbitControls.js");
ROTSLAM_EMBED(helpers_script, ROTSLAM_PAGE_DIR "/helpers.js");
ROTSLAM_EMBED(chart_script, ROTSLAM_PAGE_DIR "/chart.js");
ROTSLAM_EMBED(view_script, ROTSLAM_PAGE_DIR "/view.js");

namespace rotslam {

std::vector<PagePart> SharedPageParts() {
  return {{"{{three_license}}", ROTSLAM_EMBEDDED(three_license)},
          {"{{style}}", ROTSLAM_EMBEDDED(page_style)},
          {"{{three}}", ROTSLAM_EMBEDDED(three)},
          {"{{orbit_controls}}", ROTSLAM_EMBEDDED(orbit_controls)},
          {"{{helpers_script}}", ROTSLAM_EMBEDDED(helpers_script)},
          {"{{chart_script}}", ROTSLAM_EMBEDDED(chart_script)},
          {"{{view_script}}", ROTSLAM_EMBEDDED(view_script)}};
}

std::string FillPage(std::string_view page_template, const std::vector<PagePart>& parts) {
  std::string page;
  for (std::size_t at = 0; (at = page_template.find("{{")) != std::string_view::npos;) {
    const std::string_view rest = page_template.substr(at);
    const auto part = std::find_if(parts.begin(), parts.end(), [&](const PagePart& candidate) {
      return rest.starts_with(candidate.mark);
    });
    if (part == parts.end()) {
      throw std::logic_error("a page has no part for " + std::string(rest.substr(0, 40)));
    }
    page.append(page_template.substr(0, at)).append(part->content);
    page_template.remove_prefix(at + part->mark.size());
  }
  return page.append(page_template);
}

}  // namespace rotslam
