#pragma once

#include <string>

namespace rotslam {

/// What became of a key that was an option of earlier versions, in one sentence: fixed or called
/// otherwise. Empty for others.
/// @param key  with its groups; "options." in front as in the list of a batch.
std::string FormerOption(const std::string& key);

}  // namespace rotslam
