#pragma once

#include <string>
#include <string_view>

namespace rotslam {

/// Whether the commas of a text can only be decimal ones: no number has a point, and every comma
/// stands between the two digits of a word that has no other. Blanks, tabs and semicolons separate
/// the words; lines that start with '#' do not count.
bool HasDecimalCommas(std::string_view text);

/// The text with points in place of the commas of its numbers.
std::string WithDecimalPoints(std::string text);

}  // namespace rotslam
