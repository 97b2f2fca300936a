#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rotodom/relative_rotation/baseline_evidence.h"
#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Of the relative rotation of one pair of views.
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

/// What two views' matches say about the rotation between them.
struct RelativeRotationEstimate {
  Rotation j_from_i;
  Eigen::Matrix3d covariance;  // of delta in Exp(delta) * j_from_i, rad^2
  // x_j = R x_i + s t, s > 0; unit, or zero when rotation_only or j_from_i is that of no baseline.
  Eigen::Vector3d translation_direction;
  // Of the direction's small changes, rad^2: rank two, zero along the direction; zero when
  // rotation_only.
  Eigen::Matrix3d translation_covariance;
  bool rotation_only = false;  // rotation alone explains the matches: no evidence of a baseline
  BaselineEvidence baseline;   // what that was decided by
  double noise_px = 0.0;       // robust standard deviation of the inliers' Sampson distance
  double parallax_px = 0.0;  // root mean square of the inliers' flow that rotation does not explain
  std::vector<int> inliers;  // positions in `pairs`, ascending
  int num_samples = 0;
  // What its score lacks to that of the best hypothesis, nats by inlier of that one.
  double excess = 0.0;
};

/// Estimates the rotation between two views from matched bearings, whatever the baseline, zero
/// included.
///
/// Hypotheses come from descents on part of the matches and from small samples and are scored by
/// the truncated Sampson distance, which stays valid as the baseline vanishes (consensus.h), points
/// behind the cameras being none: a plane alone has a second motion that fits all its lines. The
/// best is refined on all matches but those that only chance makes agree: once as (rotation,
/// translation direction) on the Sampson distance and once as rotation alone, both with a
/// redescending loss. TestBaseline decides whether there is a baseline, Torr's geometric
/// information criterion which of the two rotations is the better one; they ask different questions
/// and differ where the baseline is at the limit. Matches that carry a MatchNoise are weighted by
/// it throughout.
/// @param pairs                matched bearings, wrong ones among them; a bearing that is not
/// finite
///                             or a covariance that is none throws std::invalid_argument.
/// @param predicted_j_from_i   where to start; may be far off.
/// @param focal_px             pixels per radian, for the thresholds.
/// @param seed                 same seed, same answer.
/// @param covariances          one per pair, or none; for the test of the baseline only.
/// @return  nullopt when fewer than options.min_inliers matches agree, or do not fix the rotation.
/// Error:   medians of 80 scenes, 1,000 matches, 0.5 px at f = 700, 0 / 25 / 50 % wrong: 0.005 /
///          0.006 / 0.006 deg without baseline, 0.020 / 0.030 / 0.035 at 1 % of the depth, 0.018 /
///          0.027 / 0.032 at 10 %; mean squared Mahalanobis distance / 3 of the rotation 0.8
///          to 2.2. A baseline too small for the evidence (0.3 % at 1 px) goes into the rotation
///          and not into its covariance.
/// Cost:    0.3 ms for 1,000 matches with AVX2, 1.2 ms when samples must be drawn to the end.
/// Source:  Torr, Geometric motion segmentation and model selection, 1998 (criterion); Muhle et
/// al., The Probabilistic Normal Epipolar Constraint, CVPR 2022 (weights).
std::optional<RelativeRotationEstimate> EstimateRelativeRotation(
    const std::vector<BearingPair>& pairs,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options,
    std::uint64_t seed,
    std::span<const KeypointCovariances> covariances = {});

/// The same, and behind it a second estimate where the matches allow another rotation almost as
/// well, mostly the other motion that shows a plane in the same places. Two views cannot tell which
/// of them is right; a third one can (ChooseConsistent).
/// @return  empty where EstimateRelativeRotation has none; ascending in `excess`, at most two.
std::vector<RelativeRotationEstimate> EstimateRotationHypotheses(
    const std::vector<BearingPair>& pairs,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options,
    std::uint64_t seed,
    std::span<const KeypointCovariances> covariances = {});

}  // namespace rotslam
