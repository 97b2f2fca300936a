#pragma once

#include "rotodom/loop/vocabulary.h"

namespace rotslam {

/// The vocabulary that ships with the library, within it; config/vocabulary/README.md says what it
/// was trained on.
/// Cost:    4 ms; the caller keeps it.
Vocabulary DefaultVocabulary();

}  // namespace rotslam
