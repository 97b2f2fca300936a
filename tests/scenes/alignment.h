#pragma once

#include "rotodom/types/maps.h"
#include "rotodom/types/similarity.h"

namespace rotslam {

/// Least-squares similarity taking `estimate` onto `truth` over the frames in both (Umeyama 1991).
/// Throws std::invalid_argument for fewer than three shared frames.
Similarity AlignCenters(const CenterMap& estimate, const CenterMap& truth);

/// Scale and translation alone: the gauge left when rotations are known. At least two shared
/// frames.
Similarity AlignCentersKnownRotation(const CenterMap& estimate, const CenterMap& truth);

/// Largest and root-mean-square distance of aligned centres to the truth, over shared frames.
struct CenterError {
  int count = 0;
  double max = 0.0;
  double rmse = 0.0;
};
CenterError CompareCenters(const CenterMap& estimate,
                           const CenterMap& truth,
                           const Similarity& truth_from_estimate);

/// Largest distance of aligned points to the truth, over shared tracks.
double MaxPointError(const PointMap& estimate,
                     const PointMap& truth,
                     const Similarity& truth_from_estimate);

}  // namespace rotslam
