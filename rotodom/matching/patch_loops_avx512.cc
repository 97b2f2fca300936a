static constexpr int kFloats = 16;
#include "rotodom/matching/patch_loops.inc"

namespace rotslam {
const PatchLoops kPatchLoopsAvx512 = kLoops;
}  // namespace rotslam
