#pragma once

#include <string>

namespace rotslam {

/// Says in one sentence whether an option of an earlier version is fixed now or has another name.
/// Empty for keys that were no options.
/// @param key  with its groups; "options." in front as in the list of a batch.
std::string FormerOption(const std::string& key);

}  // namespace rotslam
