#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/relative_rotation/normal_epipolar.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

struct RelativeRotationOptions {
  // A match counts for a hypothesis while its Sampson distance is below this; larger values let
  // wrong matches vote.
  double inlier_px = 1.5;
  // Scale of the redescending (Geman-McClure) loss in the final refinement, in standard deviations
  // of the noise that the matches show.
  double loss_sigmas = 3.0;
  // No match is believed to be better than this, however well the matches agree.
  double min_noise_px = 0.02;
  // Part of a match's error that its neighbours share, so that the scatter does not show it:
  // patches deform as the view turns. A baseline must show more flow than this to count as
  // evidence.
  double shared_error_px = 0.1;
  // Finest scale at which hypotheses are told apart; well-refined matches scatter by 0.03 to 0.2
  // px.
  double finest_px = 0.1;
  // Matches per sample of the normal epipolar solver: fewer fail at small baselines, more meet an
  // outlier. Every other sample is a small one.
  int sample_size = 10;
  // Sampling stops when a better hypothesis is less likely than 1 - confidence, and at max_samples
  // in any case.
  double confidence = 0.999;
  int min_samples = 20;
  int max_samples = 400;
  // Gauss-Newton steps on all matches at the end.
  int refine_iterations = 12;
  // Fewer inliers than this are no measurement. The paper's theta_matches is 100; see
  // `ViewGraphOptions` for the threshold on edges.
  int min_inliers = 15;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("inlier_px", inlier_px);
    visit("loss_sigmas", loss_sigmas);
    visit("min_noise_px", min_noise_px);
    visit("shared_error_px", shared_error_px);
    visit("finest_px", finest_px);
    visit("sample_size", sample_size);
    visit("confidence", confidence);
    visit("min_samples", min_samples);
    visit("max_samples", max_samples);
    visit("refine_iterations", refine_iterations);
    visit("min_inliers", min_inliers);
  }
};

/// What two views' matches say about the rotation between them.
struct RelativeRotationEstimate {
  Rotation j_from_i;
  Eigen::Matrix3d covariance;  // of delta in Exp(delta) * j_from_i, rad^2
  Eigen::Vector3d
      translation_direction;   // x_j = R x_i + s t, s > 0; unit, or zero when rotation_only
  bool rotation_only = false;  // rotation alone explains the matches: no evidence of a baseline
  double noise_px = 0.0;       // robust standard deviation of the inliers' Sampson distance
  double parallax_px = 0.0;  // root mean square of the inliers' flow that rotation does not explain
  std::vector<int> inliers;  // positions in `pairs`, ascending
  int num_samples = 0;
};

/// Estimates the rotation between two views from matched bearings, whatever the baseline, zero
/// included.
///
/// Hypotheses come from small samples (two-point rotations and the normal epipolar solver) and are
/// scored by the truncated Sampson distance, which stays valid as the baseline vanishes. The best
/// is refined on all matches: once as (rotation, translation direction) on the Sampson distance and
/// once as rotation alone, both with a redescending loss; the model is chosen by the geometric
/// information criterion with the noise the first one measures.
/// @param pairs                matched bearings, wrong ones among them.
/// @param predicted_j_from_i   where to start; may be far off.
/// @param focal_px             pixels per radian, for the thresholds.
/// @param seed                 same seed, same answer.
/// @return  nullopt when fewer than options.min_inliers matches agree.
/// Source:  Kneip & Lynen, ICCV 2013 (constraint); Torr, Geometric motion segmentation and model
/// selection, 1998
///          (criterion).
std::optional<RelativeRotationEstimate> EstimateRelativeRotation(
    const std::vector<BearingPair>& pairs,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options,
    std::uint64_t seed);

}  // namespace rotslam
