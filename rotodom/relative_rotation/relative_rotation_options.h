#pragma once

#include <optional>
#include <string>

#include "rotodom/relative_rotation/baseline_evidence.h"

namespace rotslam {

/// Options of the relative rotation of one pair of views.
struct RelativeRotationOptions {
  // A match counts for a hypothesis while its Sampson distance is below this; larger values let
  // wrong matches vote.
  double inlier_px = 1.5;
  // Part of a match's error that its neighbours share, so that the scatter does not show it:
  // patches deform as the view turns. A baseline must show more flow than this to count as
  // evidence, and a turn without a baseline is uncertain by half of it. Larger values take slow
  // translations for rotations: at 0.1, 21 of 298 steps of rendered walks passed for rotations,
  // wrong by 0.14 deg (chained RPE_1 0.032 to 0.040 deg; 0.005 to 0.006 at 0.02), while exact
  // rotations stay what they are (pan720: 0.0004 deg from 0.02 to 0.1).
  double shared_error_px = 0.02;
  // Sampling stops after this many samples in any case. 250 take 0.9 ms; 400 failed a third less
  // often on 500 matches half of which were wrong at baselines of 10 and 30 % of the depth (10 and
  // 19 of 960).
  int max_samples = 250;
  // Fewer inliers than this are no measurement. The paper's theta_matches is 100; see
  // `ViewGraphOptions` for the threshold on edges.
  int min_inliers = 15;
  // Whether the views are from one place.
  BaselineTestOptions baseline;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("inlier_px", inlier_px);
    visit("max_samples", max_samples);
    visit("baseline", baseline);
  }
};

}  // namespace rotslam
