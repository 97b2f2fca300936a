#pragma once

#include "apps/cli/input/input.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/terminal/common_flags.h"
#include "apps/slam/input/frame_source.h"
#include "apps/slam/observer.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// As ReadRunOptions, but the configuration file and the flags override PaperDefaults. Throws
/// std::runtime_error in a build without OpenGV, too.
RunOptions ReadPaperOptions(const CommonFlags& common, const InputFlags& input);

/// Finds orientations by the paper's method (PaperOdometry), called like FindOrientations. Nothing
/// is recorded; static content is tracked, rolling shutters are not corrected and orientations get
/// no covariance. Throws std::runtime_error where too little of the sequence could be read or
/// matched.
Orientations FindPaperOrientations(FrameSource& frames,
                                   const Camera& camera,
                                   const SlamOptions& options,
                                   const OrientationInputs& inputs,
                                   SlamObserver& observer);

}  // namespace rotslam
