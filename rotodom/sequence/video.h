#pragma once

#include <memory>

#include "rotodom/sequence/layout.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// The frames of the video `layout.folder`. Throws std::runtime_error, with path and reason in one
/// line, when it cannot be read.
std::unique_ptr<Sequence> OpenVideo(Layout layout, const SequenceOptions& options);

}  // namespace rotslam
