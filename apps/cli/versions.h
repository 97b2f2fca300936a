#pragma once

#include <string>

namespace rotslam {

/// What --version prints: this program, what compiled it, the libraries it uses. Where a library
/// tells at run time which one it is, that is asked.
std::string VersionText();

}  // namespace rotslam
