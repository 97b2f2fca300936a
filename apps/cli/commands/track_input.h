#pragma once

#include <memory>

#include "apps/cli/input/input.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/slam_progress.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Finds the focal length of an input whose camera is a guess; of another one nothing. A request to
/// stop ends the program meanwhile: nothing is lost yet.
void RefineGuess(const RunOptions& options,
                 Interruption& interruption,
                 Progress& progress,
                 Input& input);

/// The first stage of `run` and `rotations`. The input's camera gets the readout that the images
/// tell. Throws what FindOrientations throws; InterruptedError where a request to stop came before
/// there was anything to write.
Orientations TrackInput(const RunOptions& options,
                        std::shared_ptr<const Vocabulary> vocabulary,
                        bool keep_features,
                        SlamProgress& observer,
                        Checkpoint& checkpoint,
                        Input& input);

}  // namespace rotslam
