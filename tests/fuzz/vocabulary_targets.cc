#include <cstdint>

#include "rotodom/loop/vocabulary_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

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

// The bytes but for the checksum, without which nothing behind it is ever reached.
const RegisterFuzzTarget binary("vocabulary_binary",
                                [](std::string_view bytes, const TemporaryFolder& folder) {
                                  std::string file(bytes);
                                  const std::uint64_t checksum = VocabularyChecksum(bytes);
                                  file.append(reinterpret_cast<const char*>(&checksum),
                                              sizeof(checksum));
                                  Use(ReadVocabulary(folder.Write("words.rotvoc", file)));
                                });

}  // namespace
}  // namespace rotslam
