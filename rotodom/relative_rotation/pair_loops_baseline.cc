static constexpr int kDoubles = 2;
#include "rotodom/relative_rotation/pair_loops.inc"

namespace rotslam {
const PairLoops kPairLoopsBaseline = kLoops;
}  // namespace rotslam
