#include "rotodom/loop/default_vocabulary.h"

#include <span>

#include "rotodom/loop/vocabulary_file.h"

// The assembler copies the file into the object. Compiling a string literal of megabytes takes
// minutes, and a path to a file would not be valid on other machines.
asm(".pushsection .rodata\n"
    ".balign 16\n"
    ".global rotslam_default_vocabulary_begin\n"
    ".global rotslam_default_vocabulary_end\n"
    "rotslam_default_vocabulary_begin:\n"
    ".incbin \"" ROTSLAM_DEFAULT_VOCABULARY
    "\"\n"
    "rotslam_default_vocabulary_end:\n"
    ".byte 0\n"
    ".popsection\n");

extern "C" const char rotslam_default_vocabulary_begin[];
extern "C" const char rotslam_default_vocabulary_end[];

namespace rotslam {

Vocabulary DefaultVocabulary() {
  return DecodeBinary({rotslam_default_vocabulary_begin, rotslam_default_vocabulary_end},
                      "the vocabulary in this program");
}

}  // namespace rotslam
