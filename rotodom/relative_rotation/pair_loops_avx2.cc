static constexpr int kDoubles = 4;
#include "rotodom/relative_rotation/pair_loops.inc"

namespace rotslam {
const PairLoops kPairLoopsAvx2 = kLoops;
}  // namespace rotslam
