#pragma once

#include <vector>

#include "rotodom/sequence/decoded_image.h"

namespace rotslam {

/// Does the file begin as HEIC, HEIF or AVIF?
bool IsHeif(const std::vector<unsigned char>& bytes);

/// Its primary image as it is stored, 8 bits and three channels. Without libheif, or a decoder of
/// it, the problem says what to do. Does not throw.
DecodedImage DecodeHeif(const std::vector<unsigned char>& bytes);

}  // namespace rotslam
