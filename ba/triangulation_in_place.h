#pragma once

#include "ba/bundle_adjustment.h"

namespace rotslam {

/// TriangulateTracks in the memory of `problem`: of a long sequence its tracks are most of what is
/// kept. Points of the start are where theirs are looked for first.
Reconstruction TriangulateInPlace(BundleProblem problem, const BundleOptions& options);

/// WithoutShallowPoints in place.
void DropShallowPoints(double min_angle_deg, Reconstruction& reconstruction);

}  // namespace rotslam
