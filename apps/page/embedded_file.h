#pragma once

#include <string_view>

// Puts a file of the source tree into the program. The assembler copies it into the object, which
// is quicker to compile than a literal. At file scope; `name` is unique in the program, `path` a
// string literal.
#define ROTSLAM_EMBED(name, path)                 \
  asm(".pushsection .rodata\n"                    \
      ".global rotslam_" #name                    \
      "_begin\n"                                  \
      ".global rotslam_" #name                    \
      "_end\n"                                    \
      "rotslam_" #name                            \
      "_begin:\n"                                 \
      ".incbin \"" path                           \
      "\"\n"                                      \
      "rotslam_" #name                            \
      "_end:\n"                                   \
      ".byte 0\n"                                 \
      ".popsection\n");                           \
  extern "C" const char rotslam_##name##_begin[]; \
  extern "C" const char rotslam_##name##_end[]

// The text of such a file.
#define ROTSLAM_EMBEDDED(name) \
  std::string_view(rotslam_##name##_begin, rotslam_##name##_end - rotslam_##name##_begin)
