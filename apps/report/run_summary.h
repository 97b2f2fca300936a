#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// Reads a JSON file that contains an object; nullopt where the file is missing, incomplete or
/// nested deeper than any of ours. Serialising a value recurses into each level, and thousands
/// would overflow the stack.
std::optional<nlohmann::ordered_json> ReadJsonObject(const std::filesystem::path& path);

/// Reads summary.json of a run's folder. Throws std::runtime_error with path and reason.
nlohmann::ordered_json ReadSummaryOf(const std::filesystem::path& run);

/// A number of a group of the summary; 0 where it has none.
double SummaryNumber(const nlohmann::ordered_json& summary,
                     const std::string& group,
                     const std::string& key);

/// The frames of its sequence that the run has used. Throws std::runtime_error where the summary
/// does not contain them.
SequenceOptions SequenceOptionsOf(const nlohmann::ordered_json& summary);

}  // namespace rotslam
