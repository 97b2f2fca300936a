#pragma once

#include <vector>

#include "rotodom/camera/camera_document.h"

namespace rotslam {

/// The lines of a file of nothing but numbers.
using NumberTable = std::vector<TextRow>;

/// The lines of such a file, cut at blanks and at commas that separate numbers; empty where a line
/// has something else. Commas within words of a line with blanks ("380,5 382,0") are taken for
/// decimal commas and stay, so that reading the number names them.
NumberTable ReadNumberTable(const CameraDocument& document);

/// True for the shapes of a camera matrix: 3 or 4 lines of 3 or 4 numbers, or 9 numbers in one line
/// with zeros where a matrix has them.
bool IsMatrixTable(const NumberTable& table);

}  // namespace rotslam
