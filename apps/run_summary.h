#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// summary.json of a run's folder. Throws std::runtime_error with path and reason.
nlohmann::ordered_json ReadSummaryOf(const std::filesystem::path& run);

/// Which frames of its sequence the run has used. Throws nlohmann::json::exception where the
/// summary does not say.
SequenceOptions SequenceOptionsOf(const nlohmann::ordered_json& summary);

}  // namespace rotslam
