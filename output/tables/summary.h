#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "output/files/option_list.h"
#include "output/tables/segments.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// Names and values in the order in which they shall stand in the file. Dots in a name nest:
/// "inliers.median" becomes {"inliers": {"median": ..}} with its neighbours.
using SummaryValue = std::variant<bool, std::int64_t, double, std::string>;
using SummaryTable = std::vector<std::pair<std::string, SummaryValue>>;

/// The bracket that krot proved. gamma is in normalised image units, gamma_px in pixels.
struct SummaryKrot {
  std::string status;
  double gamma_low = 0.0;
  double gamma_high = std::numeric_limits<double>::infinity();
  double gamma_low_px = 0.0;
  double gamma_high_px = std::numeric_limits<double>::infinity();
  std::int64_t removed = 0;  // observations taken out as outliers
  SummaryTable more;         // further figures, under the same "krot"
};

/// Everything summary.json says about a run. The keys of the file are the names of the fields;
/// parts that a command does not run stay nullopt and are absent from the file.
struct RunSummary {
  std::string command;  // "run", "rotations"
  // Ctrl-C ended the command early: what it had by then is here. Absent from the file when false.
  bool interrupted = false;
  std::vector<OptionEntry> options;
  SummaryTable sequence;
  std::optional<Camera> camera;
  std::optional<SummaryTable> calibration;  // of a camera that no calibration file gives
  std::optional<SummaryTable> readout;      // of a sensor that no calibration file tells of
  std::optional<SummaryTable> masks;        // absent where nothing is masked
  std::optional<SummaryTable> lens_checks;  // absent where nothing speaks against the calibration
  SummaryTable counts;
  SummaryTable seconds;
  std::optional<SummaryTable> rotodom;
  std::optional<SummaryKrot> krot;
  std::optional<SummaryTable> ba;
  std::optional<std::vector<Segment>> segments;
  std::optional<SummaryTable> loops;
};

/// This library's version, "0.1.0".
std::string Version();

/// summary.json: indented, keys in the order of `RunSummary` after "version"; numbers that are not
/// finite become null. Only `seconds` differs between two runs with the same input and options.
std::string SummaryJson(const RunSummary& summary);

/// Writes SummaryJson to `path`; throws std::runtime_error when the file cannot be written.
void WriteSummary(const std::filesystem::path& path, const RunSummary& summary);

}  // namespace rotslam
