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
/// as the form of the input says. Throws std::runtime_error with one clear line.
void ReadCalibration(const InputFlags& flags, Input& input);

/// Opens the sequence, reads its camera (`flags.camera`, else what lies with the images; or guesses
/// it where `flags.focal_guess`) and says what was understood through `tell`; reads
/// `flags.rotations`, too. Throws std::runtime_error with one clear line.
Input OpenInput(const InputFlags& flags,
                const SequenceOptions& options,
                const std::function<void(const std::string&)>& tell);

}  // namespace rotslam
