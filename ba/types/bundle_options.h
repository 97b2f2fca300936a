#pragma once

#include <optional>
#include <string>

#include "rotodom/camera/lens_parameters.h"

namespace rotslam {

/// A track with fewer fitting observations is dropped by default. Two views always agree along the
/// epipolar line, so two say nothing about the match; three do.
inline constexpr int kMinTrackObservations = 3;
/// A frame with fewer fitting observations is left out of a round: six unknowns on a handful of
/// points follow any outlier. Twelve give four numbers for each unknown.
inline constexpr int kMinFrameObservations = 12;

/// How the cost grows with a residual.
enum class RobustLoss { kNone, kHuber, kCauchy };

/// One round of classification and minimisation.
struct BundleRound {
  // Skip the round altogether.
  bool enabled = true;
  // Whether rotations move. With rotations held, positions and points that are metres off come near
  // their places, from where everything may move.
  bool refine_rotations = true;
  // Observations farther than this from their point, as the cameras stand before the round, are
  // left out of it. For keypoints with sigma_px above 1 it grows with sigma_px. Zero: nothing is.
  double max_error_px = 0.0;
  // So are those whose residual, in sigmas, is above this; where sigma_px is below 1, in pixels.
  // Zero: no residual is.
  double max_residual = 0.0;
  RobustLoss loss = RobustLoss::kHuber;
  // Residual, in sigmas, at which the loss leaves the quadratic.
  double loss_scale = 1.0;
  // Levenberg-Marquardt steps.
  int max_iterations = 30;
  // Trust region at the start; a large one makes the first step a Gauss-Newton step.
  double initial_radius = 1e6;
  // Stop when a step changes the cost by less than this share. Rounds that only prepare the next
  // one do not need their last digits.
  double function_tolerance = 1e-4;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_error_px", max_error_px);
  }
};

/// Errors of a lens that many observations tell, over those that they would have if their errors
/// were independent: neighbouring observations err alike. On simulated walks and drives 2 to 5.
inline constexpr double kCommonErrors = 4.0;

/// How far the calibration may change. It is a measurement, too: distortion that a calibration has
/// left affects every track alike, and on a long drive becomes a drift of scale that no number of
/// observations averages out.
struct LensOptions {
  // The first two radial coefficients, or w of kFov; a pinhole becomes a radtan camera.
  bool refine_distortion = true;
  // Off: along a path the focal length trades with positions, and on EuRoC, whose calibration is
  // good, it moves by 1.2 % to make up for wrong matches.
  bool refine_focal = false;
  // Off: hardly told from a turn of the camera.
  bool refine_principal_point = false;
  // Off: the coefficients beyond the first two, which a calibration gives better than a sequence.
  bool refine_higher_terms = false;
  // Standard deviation of each radial coefficient given, and of the focal length given, as a share
  // of it. They count as one observation each among thousands that err alike, so they are tighter
  // than a calibration deserves.
  double distortion_sigma = 0.005;
  double focal_sigma = 0.003;
  // Of the principal point, in focal lengths.
  double principal_sigma = 0.003;
  // Of the tangential coefficients, as a share of that of the others: they trade with the principal
  // point, and lenses are centred to some seconds of arc.
  double tangential_share = 0.1;
  // Tangential coefficients that are zero stay so unless they take this share off the cost: they
  // also make up for what else is wrong with a lens. 0: they are refined like the others. KITTI 00
  // and the kitchen gain 0.0008 and 0.0003, a simulated drive through a lens that has 0.0014 of
  // them 0.005, a walk through it half.
  double min_tangential_gain = 0.0;
  // Expected values of the parameters; none: those of the camera that adjustment starts from.
  std::optional<Camera> expected;
  // The deviations above are those of lenses as they are: they are weighed by how large the
  // residuals turn out, and errors that neighbouring observations have in common count in
  // (kCommonErrors). The result's deviations count them in, too. Off: they count as one observation
  // of sigma_px each.
  bool weighs_by_residuals = false;
  // Standard deviations of the parameters of this very camera, in place of those above and of what
  // they free; 0: held.
  std::optional<LensParameters> given_sigmas;
  // The calibration stands unless another lens takes this share off the cost. Errors of
  // neighbouring observations are alike, so that some lens always gains a little: 0.0002 to 0.001
  // on simulated walks and drives, whose calibration is exact. Distortion of a hundredth is worth
  // 0.004 on such a drive, and costs four times the position error when left. KITTI 00 gains 0.026,
  // at half its resolution 0.0016 (position error 0.3 m instead of 0.9); EuRoC and TUM fr1 0.003,
  // where it makes no difference.
  double min_gain = 0.001;

  /// Standard deviations of the parameters given; 0: the parameter is held.
  LensParameters Sigmas(CameraModel model) const;
  /// Whether any parameter moves.
  bool RefinesAny() const { return NumBlocks() > 0; }
  /// Blocks of LensParameters that have parameters that move, from the first.
  int NumBlocks() const;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("refine_distortion", refine_distortion);
    visit("refine_focal", refine_focal);
    visit("refine_principal_point", refine_principal_point);
    visit("refine_higher_terms", refine_higher_terms);
    visit("distortion_sigma", distortion_sigma);
    visit("focal_sigma", focal_sigma);
    visit("principal_sigma", principal_sigma);
  }
};

/// Options of bundle adjustment: its rounds, the parameters that move, outlier thresholds.
struct BundleOptions {
  // Starts from known-rotation positions, which err by a few percent of the path length. A tight
  // outlier test would drop 5 to 10 % of the good observations, so there is none. Outliers keep the
  // cost changing long after the cameras have converged, hence the tolerance.
  BundleRound fixed_rotation = {
      .refine_rotations = false, .max_error_px = 0.0, .function_tolerance = 1e-3};
  // Observations within 4 px after the fixed-rotation stage, rotations free.
  BundleRound coarse = {.max_error_px = 4.0};
  // Observations within 2 px after that. Steps are Gauss-Newton's nearly from the start: damping
  // would hold back the small corrections that are left, slow bends of the path.
  BundleRound fine = {
      .max_error_px = 2.0, .max_iterations = 50, .initial_radius = 1e8, .function_tolerance = 1e-5};
  // The stages before the final one take tracks at random until every frame has so many
  // observations: enough to place the cameras, at a third of the time; the final stage takes all.
  // 0: all from the start. The longest tracks would do worse: errors of the lens and drift of the
  // tracker affect them most.
  int preparing_observations = 300;
  // Keypoints are often better than their sigma says, and those that are far out then belong to
  // tracks that drift. So from the fine round on the loss leaves the quadratic at this many spreads
  // of the residuals of the round before, and observations within so many spreads are kept, where
  // that is less than the round allows. A spread is the median residual, in sigmas, freed of what
  // points take off by fitting, in steps of a quarter octave. On simulated walks and drives errors
  // fall to 0.3 to 0.9 of those with the round's own widths; where residuals are as wide as
  // sigma_px says nothing changes. A limit alone needs 4 spreads for that, and EuRoC then loses
  // 3 %. The closer the two are, the less is left for an adjustment without a loss: COLMAP's takes
  // 1.4 % off the cost of KITTI 00, with 2 and 6 spreads 3.8 %. 0: as the round has it.
  double loss_spreads = 3.0;
  double limit_spreads = 5.0;
  // A frame that rotates while it is exposed is blurred along the motion. Its keypoints are less
  // certain along the blur than across, by hypot(1, blur), where the blur is this times the speed
  // of the image, px/s. It counts once the residuals of the coarse round clearly show it. Those of
  // TUM fr1_rpy make 0.002 the most likely value, up to a blur of 1.4. 0: keypoints are as certain
  // in all directions.
  double blur_s_per_px = 0.002;
  // The final stage is repeated at most so many times, until classification hardly changes: then
  // the result does not depend on the start. 0: cameras stay as the rounds before have left them,
  // and all tracks are triangulated once more.
  int max_final_rounds = 5;
  // false holds the rotations in every round: they come out bit by bit as they went in.
  bool refine_rotations = true;
  LensOptions lens;
  // Whether the result says how well each pose, and a refined lens, is known; a seventh of the time
  // more on KITTI 00.
  bool find_covariance = false;
  // Whether the result says how well a refined lens is known; a hundredth of the time more.
  bool find_lens_covariance = false;

  // A point needs two rays that meet at this angle, else its depth is noise. Low on purpose: a
  // shallow point holds rotations well: 1 deg instead of 0.2 costs KITTI 00 (first 200 frames) 4 %
  // of its position error, 0.05 deg gains nothing. At a focal length of 700 px, 0.2 deg is 2.4 px
  // of parallax. For clouds to look at see WithoutShallowPoints.
  double min_angle_deg = 0.2;

  // A track with fewer fitting observations is dropped. Two serve where nothing has three.
  int min_track_observations = kMinTrackObservations;

  // Up to this many frames the reduced system is factored densely (DENSE_SCHUR), above by CHOLMOD
  // (SPARSE_SCHUR).
  int max_dense_frames = 120;
  // For triangulation and classification. The solver itself runs on one thread: Ceres adds up in
  // the order in which threads finish, which changes last digits from run to run.
  int num_threads = 1;

  // The first field out of range, by name, value and limit; nullopt when all is well.
  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("coarse", coarse);
    visit("fine", fine);
    visit("preparing_observations", preparing_observations);
    visit("loss_spreads", loss_spreads);
    visit("limit_spreads", limit_spreads);
    visit("blur_s_per_px", blur_s_per_px);
    visit("max_final_rounds", max_final_rounds);
    visit("refine_rotations", refine_rotations);
    visit("lens", lens);
    visit("find_covariance", find_covariance);
    visit("min_angle_deg", min_angle_deg);
  }
};

}  // namespace rotslam
