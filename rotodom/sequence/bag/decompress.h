#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace rotslam {

/// Whether the program was built with the decompressor of this name: "bz2", "lz4" or "zstd".
bool CanDecompress(std::string_view compression);

/// Decompresses `packed` into exactly `raw_size` bytes. Memory grows with what comes out, not with
/// what `raw_size` claims.
/// Throws std::runtime_error, without a path: the bytes are damaged, another number comes out, it
/// is more than 2 GiB, or the program was built without the decompressor.
std::string Decompress(std::string_view compression,
                       std::string_view packed,
                       std::uint64_t raw_size);

/// Whether `bytes` begin as a Zstandard frame does. A CDR message never begins so.
bool IsZstdFrame(std::string_view bytes);

/// A message that rosbag2 compressed on its own (`compression_mode: message`): a Zstandard frame,
/// of which `most_bytes` are wanted at most. Throws as Decompress does.
std::string DecompressMessage(std::string_view packed, std::uint64_t most_bytes);

}  // namespace rotslam
