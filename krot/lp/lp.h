#pragma once

#include "krot/lp/linear_program.h"

namespace rotslam {

/// Whether this build has the engine.
bool HasLpEngine(LpEngine engine);

/// Prints nothing and gives the same digits on every call.
/// Throws std::invalid_argument when `program` is not one (see Problem()) or this build lacks the
/// engine.
LpResult SolveLp(const LinearProgram& program, const LpOptions& options = {});

}  // namespace rotslam
