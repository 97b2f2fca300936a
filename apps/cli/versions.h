#pragma once

#include <string>

namespace rotslam {

/// The text of --version: this program, its compiler, the libraries it uses. Libraries that tell
/// their version at run time are asked for it.
std::string VersionText();

}  // namespace rotslam
