#pragma once

#include <memory>

#include "rotodom/sequence/frames.h"
#include "rotodom/sequence/layout.h"

namespace rotslam {

/// The frames of the video file `layout.folder`, upright, see VideoFile. Throws std::runtime_error,
/// with path and reason in one line, when it cannot be read or ends before `options.first`.
std::unique_ptr<Sequence> OpenVideo(const Layout& layout, const SequenceOptions& options);

}  // namespace rotslam
