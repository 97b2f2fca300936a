#pragma once

#include <string>
#include <vector>

#include "apps/batch/record.h"

namespace rotslam {

/// The table as CSV, one line per sequence; missing figures are empty. Two lines follow over the
/// sequences that are done: "(median)", and "(worst)", whose status says how many failed.
std::string ResultsCsv(const std::vector<BatchResult>& results);

/// The table as a page that needs no other file, light or dark as the reader's system is.
/// @param title  plain text.
std::string ResultsHtml(const std::vector<BatchResult>& results, const std::string& title);

}  // namespace rotslam
