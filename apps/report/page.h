#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/report/page_data.h"
#include "apps/report/run_data.h"
#include "apps/report/thumbnails.h"

namespace rotslam {

/// Contents and size of a report.
struct ReportOptions {
  PageLimits limits;
  ThumbnailOptions thumbnails;
  std::string sequence;  // where the images are now; empty: where the run has found them
  // Pictures are left out, every second one at a time, until the page is no larger.
  std::size_t max_bytes = 15'000'000;
};

/// A self-contained HTML page of a run: styles, scripts and data are in it, so that it opens
/// without a network.
std::string ReportPage(const RunData& run, const ReportOptions& options);

/// Serialises `data` for the page; the text cannot end the script element that contains it.
std::string EmbeddedJson(const nlohmann::ordered_json& data);

}  // namespace rotslam
