#include <gtest/gtest.h>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>

#include "tests/rotodom/relative_rotation/pair_scene.h"

namespace rotslam {
namespace {

// OpenGV's eigensolver minimises the same cost, so from the same start both end at the same
// rotation.
TEST(MinimizeNormalEpipolar, AgreesWithOpenGv) {
  for (const double baseline : {0.05, 0.1, 0.2}) {
    const PairScene scene = MakePairScene({.baseline_over_depth = baseline, .noise_px = 0.3});
    NormalEpipolarSums sums;
    opengv::bearingVectors_t bearings_i;
    opengv::bearingVectors_t bearings_j;
    for (const BearingPair& pair : scene.pairs) {
      sums.Add(pair);
      bearings_i.push_back(pair.bearing_i);
      bearings_j.push_back(pair.bearing_j);
    }
    const NormalEpipolarMinimum ours = MinimizeNormalEpipolar(sums, Rotation(), 50);
    // OpenGV's rotation takes the second view's bearings to the first.
    opengv::relative_pose::CentralRelativeAdapter adapter(bearings_i, bearings_j);
    const Rotation theirs =
        Rotation::FromMatrix(opengv::relative_pose::eigensolver(adapter)).Inverse();
    EXPECT_LT((ours.j_from_i * theirs.Inverse()).AngleDeg(), 2e-3) << baseline;
  }
}

}  // namespace
}  // namespace rotslam
