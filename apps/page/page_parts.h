#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rotslam {

/// The content that replaces a mark of a template.
struct PagePart {
  std::string_view mark;
  std::string_view content;
};

/// The parts that our pages share: {{three_license}}, {{style}}, {{three}}, {{orbit_controls}},
/// {{helpers_script}}, {{chart_script}} and {{view_script}}.
std::vector<PagePart> SharedPageParts();

/// A page: every mark that `page_template` has is replaced by its content, which may hold marks
/// itself and is taken as it is. Throws std::logic_error where a mark has no part.
std::string FillPage(std::string_view page_template, const std::vector<PagePart>& parts);

}  // namespace rotslam
