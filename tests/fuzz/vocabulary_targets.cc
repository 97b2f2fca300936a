#include <algorithm>
#include <cstdint>
#include <cstring>

#include "rotodom/loop/vocabulary_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

// As the binary form has it at its end: without the right one nothing behind it is ever reached.
std::uint64_t Checksum(std::string_view bytes) {
  std::uint64_t sum = 0x243F6A8885A308D3U + bytes.size();
  while (!bytes.empty()) {
    std::uint64_t word = 0;
    const std::size_t length = std::min(bytes.size(), sizeof(word));
    std::memcpy(&word, bytes.data(), length);
    bytes.remove_prefix(length);
    sum = (sum ^ word) * 0x9E3779B97F4A7C15U;
    sum ^= sum >> 32;
  }
  return sum;
}

void Use(const Vocabulary& vocabulary) {
  const std::vector<BinaryDescriptor> descriptors(3);
  vocabulary.Transform(descriptors, 2);
  EncodeText(vocabulary);
  EncodeBinary(vocabulary);
}

const RegisterFuzzTarget text("vocabulary_text",
                              [](std::string_view bytes, const TemporaryFolder& folder) {
                                Use(ReadVocabulary(folder.Write("words.txt", std::string(bytes))));
                              });

// The bytes but for the checksum.
const RegisterFuzzTarget binary("vocabulary_binary",
                                [](std::string_view bytes, const TemporaryFolder& folder) {
                                  std::string file(bytes);
                                  const std::uint64_t checksum = Checksum(bytes);
                                  file.append(reinterpret_cast<const char*>(&checksum),
                                              sizeof(checksum));
                                  Use(ReadVocabulary(folder.Write("words.rotvoc", file)));
                                });

}  // namespace
}  // namespace rotslam
