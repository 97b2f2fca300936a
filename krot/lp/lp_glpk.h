#pragma once

#include "krot/lp/linear_program.h"

namespace rotslam {

/// SolveLp by GLPK: the status, primal and dual of `result`.
void SolveWithGlpk(const LinearProgram& program, const LpOptions& options, LpResult& result);

}  // namespace rotslam
