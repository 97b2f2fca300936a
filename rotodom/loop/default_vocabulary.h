#pragma once

#include "rotodom/loop/vocabulary.h"

namespace rotslam {

/// The vocabulary that is part of the library; config/vocabulary/README.md says what it was trained
/// on.
/// Cost:    4 ms per call; keep the result.
Vocabulary DefaultVocabulary();

}  // namespace rotslam
