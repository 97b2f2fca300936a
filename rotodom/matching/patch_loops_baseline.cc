static constexpr int kFloats = 4;
#include "rotodom/matching/patch_loops.inc"

namespace rotslam {
const PatchLoops kPatchLoopsBaseline = kLoops;
}  // namespace rotslam
