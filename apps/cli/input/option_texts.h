#pragma once

#include <string>
#include <vector>

#include "output/files/option_list.h"

namespace rotslam {

/// The options of a run as YAML that --config takes: each with its present value, behind which a
/// comment has its unit and one line of explanation.
/// @param options  of RunOptions. Throws std::logic_error when the table of explanations is not of
///                 these options in this order.
std::string OptionsAsYaml(const std::vector<OptionRef>& options);

}  // namespace rotslam
