#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/report/page_data.h"
#include "apps/report/run_data.h"
#include "apps/report/thumbnails.h"

namespace rotslam {

/// What a report shows, and how large it may become.
struct ReportOptions {
  PageLimits limits;
  ThumbnailOptions thumbnails;
  std::string sequence;  // where the images are now; empty: where the run has found them
  // Pictures are left out, every second one at a time, until the page is no larger.
  std::size_t max_bytes = 15'000'000;
};

/// A page that shows all of a run and opens without network: styles, scripts and data are in it.
std::string ReportPage(const RunData& run, const ReportOptions& options);

/// `data` as it stands in the page: no name from the world ends the element that it is in.
std::string EmbeddedJson(const nlohmann::ordered_json& data);

}  // namespace rotslam
