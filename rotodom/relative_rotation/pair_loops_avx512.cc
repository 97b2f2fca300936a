static constexpr int kDoubles = 8;
#include "rotodom/relative_rotation/pair_loops.inc"

namespace rotslam {
const PairLoops kPairLoopsAvx512 = kLoops;
}  // namespace rotslam
