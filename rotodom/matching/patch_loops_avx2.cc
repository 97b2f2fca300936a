static constexpr int kFloats = 8;
#include "rotodom/matching/patch_loops.inc"

namespace rotslam {
const PatchLoops kPatchLoopsAvx2 = kLoops;
}  // namespace rotslam
