#pragma once

#include <cstddef>

namespace rotslam {

/// The most bytes that any `new` of this program has asked for at once since it was set to zero:
/// vectors, strings and maps pass there. Parsers that believe a file's counts show in it.
extern std::size_t largest_allocation;

}  // namespace rotslam
