#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "rotodom/loop/vocabulary.h"

namespace rotslam {

/// Reads a vocabulary, whichever of two kinds the file is:
///   text    ORB-SLAM2's `ORBvoc.txt`: a line `k L scoring weighting`, then one line
///           `parent is_leaf d0 ... d31 weight` per node, nodes numbered from 1, the root being 0
///   binary  what EncodeBinary gives
/// Throws std::runtime_error with path, line of a text file, what is wrong and what to do, in one
/// line. Text that is cut off is told by a last line without end or by a branch without words; when
/// whole words at the end are missing nothing in the format shows it.
/// Cost:    4 ms for the 4 MB of 100,000 words in binary; reads the file into memory.
Vocabulary ReadVocabulary(const std::filesystem::path& path);

/// The content of a file for ORB-SLAM2 and its like. Weights have the digits that give the same
/// float again.
std::string EncodeText(const Vocabulary& vocabulary);

/// The content of a file that is small and quick to load: a header of ten 4-byte numbers behind
/// eight bytes that name the format; for each node, level by level, its number of children (1
/// byte); but for the root, its descriptor (32 bytes); the words' weights (4-byte floats); the
/// nodes' ids (4 bytes each) where they are not those places; a checksum (8 bytes). Little-endian.
std::string EncodeBinary(const Vocabulary& vocabulary);

/// The inverse of EncodeBinary; messages refer to the file as `name`.
Vocabulary DecodeBinary(std::span<const char> bytes, const std::string& name);

/// Checksum at the end of EncodeBinary's result. It detects damage, not manipulation.
std::uint64_t VocabularyChecksum(std::string_view bytes);

}  // namespace rotslam
