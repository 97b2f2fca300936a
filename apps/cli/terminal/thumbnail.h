#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// A picture for a terminal, two pixels a character: half blocks in colour, or ten shades of text.
/// @param image    8 bits, 1 channel or 3 (blue, green, red); not empty.
/// @param columns  characters a line, at least 8.
/// @return  lines that end in '\n'.
std::string TerminalPicture(const cv::Mat& image, int columns, bool in_colour);

}  // namespace rotslam
