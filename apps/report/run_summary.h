#pragma once

#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>

#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// A JSON file that holds an object; nullopt where there is no such file or not a whole one, or it
/// nests deeper than any of ours: who writes it out again descends into each level, and thousands
/// end the stack.
std::optional<nlohmann::ordered_json> ReadJsonObject(const std::filesystem::path& path);

/// summary.json of a run's folder. Throws std::runtime_error with path and reason.
nlohmann::ordered_json ReadSummaryOf(const std::filesystem::path& run);

/// Which frames of its sequence the run has used. Throws std::runtime_error where the summary does
/// not say.
SequenceOptions SequenceOptionsOf(const nlohmann::ordered_json& summary);

}  // namespace rotslam
