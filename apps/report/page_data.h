#pragma once

#include <nlohmann/json.hpp>

#include "apps/report/run_data.h"
#include "apps/report/thumbnails.h"

namespace rotslam {

/// Limits of the data in a report.
struct PageLimits {
  // More points are thinned out evenly over the cloud's order.
  int max_points = 50000;
  // More frames, or edges, are thinned out evenly; the page says so.
  int max_frames = 20000;
  int max_edges = 100000;
  int max_features_per_frame = 400;
};

/// The data of the page, under the names that its scripts use. Arrays of numbers are {"type",
/// "columns", "data"} with little-endian numbers in base64; all of them are finite, unknown
/// standard deviations are -1.
nlohmann::ordered_json PageData(const RunData& run,
                                const Thumbnails& thumbnails,
                                const PageLimits& limits);

}  // namespace rotslam
