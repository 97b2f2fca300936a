#pragma once

#include "apps/cli/commands/track_input.h"

namespace rotslam {

/// Options that `rotations --method paper` starts from: PaperDefaults. Throws std::runtime_error
/// in a build without OpenGV.
RunOptions PaperRunOptions();

/// Finds orientations by the paper's method (PaperOdometry) instead of FindOrientations. Throws
/// std::runtime_error where too little of the sequence could be read or matched.
Orientations FindPaperOrientations(TrackedInput& input, const OrientationInputs& inputs);

}  // namespace rotslam
