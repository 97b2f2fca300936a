#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/lens_sigmas.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Of (delta, centre): delta in rad as in Exp(delta) * cam_from_world, centre in world units.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

/// Of LensParameters.
using LensCovariance = Eigen::Matrix<double, kLensSize, kLensSize>;

/// How bundle adjustment ended.
enum class BundleStatus {
  kNotRun,
  kConverged,
  kIterationLimit,  // the last round stopped early; the result is better than the start
  kTooLittleData,   // no round had a moving pose with enough observations of enough points
  kSolverFailed,
};

/// A status in words.
const char* Name(BundleStatus status);

/// Sizes of reprojection errors |projected - keypoint|, in pixels (not in sigmas).
struct ResidualStatistics {
  int num_observations = 0;
  double mean_px = 0.0;
  double rms_px = 0.0;
  double median_px = 0.0;
  double p90_px = 0.0;
};

/// One round: classify observations, then solve.
struct BundleRoundSummary {
  std::string name;
  int num_frames = 0;  // frames with observations, fixed ones included
  int num_points = 0;
  int num_directions = 0;  // tracks seen from one place only: no depth, but they tell rotations
  int num_observations = 0;
  double initial_cost = 0.0;  // half the sum of robust squared residuals, in sigmas
  double final_cost = 0.0;
  int iterations = 0;
  std::string termination;      // Ceres' own words
  double seconds = 0.0;         // whole round
  double solver_seconds = 0.0;  // Ceres alone, on the problem as it has been built
};

/// The observations that points explain within the fine round's threshold, whatever that of the
/// last round was. It counts the observations given, not those that completion has added, so that
/// two models of a sequence can be compared.
struct BundleSupport {
  int num_frames = 0;
  int num_points = 0;
  int num_observations = 0;
  double cost = 0.0;  // half the sum of robust squared residuals, in sigmas
};

/// All rounds together. Costs are half the sum of robust squared residuals, in sigmas.
struct BundleSummary {
  double initial_cost = 0.0;  // of the first round that takes all tracks
  double final_cost = 0.0;    // of the last, whose loss and limit may be narrower
  int iterations = 0;         // of all rounds
  ResidualStatistics before;  // observations of the first round, before its solve
  ResidualStatistics after;   // observations that are in the result
  BundleSupport support;
  int num_frames = 0;
  int num_points = 0;
  int num_observations = 0;
  int num_completed = 0;             // observations that completion has added
  int num_dropped_tracks = 0;        // of the tracks given
  int num_dropped_observations = 0;  // of those given or added, dropped tracks' included
  // Whether keypoints were found less certain along their blurs, and were weighted so.
  bool has_motion_blur = false;
  double lens_gain = 0.0;        // share of the cost that another lens took off, see LensOptions
  bool lens_refined = false;     // whether that was enough
  double tangential_gain = 0.0;  // share of the cost that tangential coefficients took off then
  // Of a refined lens, where asked for: the calibration's own counted in. As pose_covariance, they
  // count every observation's error as independent, but for LensOptions::weighs_by_residuals.
  std::optional<LensSigmas> lens_sigmas;
  // The same with what their errors have in common; relative to the camera given. Parameters that
  // were held have next to none.
  std::optional<LensCovariance> lens_covariance;
  double seconds = 0.0;
  std::vector<BundleRoundSummary> rounds;
};

/// The result of bundle adjustment, usable or not.
struct BundleResult {
  BundleStatus status = BundleStatus::kNotRun;
  std::string message;  // one sentence for a person
  /// Poses, points, and tracks with only the observations that fit them. Every track in it has a
  /// point. A frame that is left without observations has neither rotation nor centre, since those
  /// that placed it do not fit: resect or interpolate it. A frame that sees directions alone has a
  /// rotation. The start, unchanged, when not usable.
  Reconstruction reconstruction;
  /// The camera with its lens refined; the bearings in `reconstruction` are its.
  Camera camera;
  /// Frames with a pose at the start but too few good observations to refine it.
  std::vector<FrameId> weak_frames;
  /// With `options.find_covariance`, of the frames that see points: in the result's gauge (see
  /// RefineBundle), so that they grow with the distance from the first frame. They count every
  /// observation's error as independent and as large as its sigma_px says; neighbouring
  /// observations err alike, so on real images they are too small. Zero for what was held. Empty
  /// where the observations leave a camera open.
  std::map<FrameId, PoseCovariance> pose_covariance;
  BundleSummary summary;
  /// Whether `reconstruction` may be used in place of the start.
  [[nodiscard]] bool Usable() const {
    return status == BundleStatus::kConverged || status == BundleStatus::kIterationLimit;
  }
};

}  // namespace rotslam
