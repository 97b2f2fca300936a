#pragma once

#include "apps/cli/commands/track_input.h"
#include "apps/cli/input/run_options.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// As ReadRunOptions, but the configuration file and the flags override PaperDefaults. Throws
/// std::runtime_error in a build without OpenGV, too.
RunOptions ReadPaperOptions(const CommonFlags& common, const InputFlags& input);

/// Finds orientations by the paper's method (PaperOdometry) instead of FindOrientations. Throws
/// std::runtime_error where too little of the sequence could be read or matched.
Orientations FindPaperOrientations(TrackedInput& input, const OrientationInputs& inputs);

}  // namespace rotslam
