#pragma once

#include <functional>
#include <memory>
#include <string>

#include "apps/cli/input/input.h"
#include "rotodom/loop/loop_closure.h"

namespace rotslam {

/// The vocabulary that --vocabulary names; null when it names none. Throws std::runtime_error with
/// one clear line.
std::shared_ptr<const Vocabulary> OpenVocabulary(const InputFlags& flags);

/// Reads the camera of `input`'s sequence: from --camera, else from what lies with the images, else
/// as the form of the input says.
/// @return  whether there is one; false also with `--camera none`.
/// Throws std::runtime_error with one clear line where it cannot be read.
bool ReadCalibration(const InputFlags& flags, Input& input);

/// Opens the sequence, reads its camera (ReadCalibration), guesses one where there is none, and
/// says what was understood through `tell`; reads `flags.rotations`, too. Throws std::runtime_error
/// with one clear line.
Input OpenInput(const InputFlags& flags,
                const SequenceOptions& options,
                const std::function<void(const std::string&)>& tell);

}  // namespace rotslam
