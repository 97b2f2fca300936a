#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "ba/bundle_options.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// What to refine. All frames share one camera.
struct BundleProblem {
  Camera camera;
  /// Poses in any gauge, and tracks with observations in pixels; bearings are the camera's of
  /// these. Its points are not looked at: all are triangulated. Observations in frames without a
  /// pose are left out.
  Reconstruction start;
  /// Frame -> frame at whose place it stands. Through a pure rotation there is one centre, so there
  /// is one parameter block: positions come out equal to the last bit. Chains are followed.
  std::map<FrameId, FrameId> shared_center;
  /// Frames whose pose does not move: the older side of a window. When empty, the first frame is
  /// held and the scale stays.
  std::set<FrameId> fixed_frames;
};

/// Of (delta, centre): delta in rad as in Exp(delta) * cam_from_world, centre in world units.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

/// Standard deviations of a refined lens, the calibration's own counted in; zero for what was held.
/// As pose_covariance, they count every observation's error as independent.
struct LensSigmas {
  double focal_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  double k1 = 0.0;  // of kFov, w
  double k2 = 0.0;
};

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

/// What points explain within the fine round's limit, however narrow the last round was, of the
/// observations given, not those that completion has found: of two models of a sequence both are
/// asked the same.
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
  // Whether keypoints turned out less certain along their blurs, and counted so.
  bool has_motion_blur = false;
  double lens_gain = 0.0;     // share of the cost that another lens took off, see LensOptions
  bool lens_refined = false;  // whether that was enough
  std::optional<LensSigmas> lens_sigmas;  // where it was, with `options.find_covariance`
  double seconds = 0.0;
  std::vector<BundleRoundSummary> rounds;
};

/// What bundle adjustment gives, usable or not.
struct BundleResult {
  BundleStatus status = BundleStatus::kNotRun;
  std::string message;  // one sentence for a person
  /// Poses, points, and tracks with only the observations that fit them. Every track in it has a
  /// point. A frame that is left without observations has neither rotation nor centre, for what led
  /// it to where it is does not fit: resect or interpolate it. One that sees directions alone has
  /// its rotation. The start, unchanged, when not usable.
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

/// Finds more of what the points' images show, once they are known to a few pixels.
/// @param map     poses, points and tracks, with the observations that fit.
/// @param camera  as it is refined; the observations' bearings are its.
/// @return  tracks of the map with other observations.
using TrackCompletion =
    std::function<std::vector<Track>(const Reconstruction& map, const Camera& camera)>;

/// Minimises the robust reprojection error over rotations, centres and points, in rounds that start
/// with the rotations held (`options.bridge`), then let them go on what fits (`options.coarse`,
/// `options.fine`). Before every round all tracks are triangulated anew against the cameras of that
/// moment and all observations are classified anew, so a good observation that a poor start threw
/// out comes back.
/// @param problem  as documented there. Throws std::invalid_argument on numbers that are
/// not finite, sigmas that are not positive, doubled track ids or frames within a track, frames in
/// `shared_center` or `fixed_frames` without a pose, cycles in `shared_center`.
/// @param complete  when given, called after the preparing rounds; the tracks it returns take the
/// place of those with their ids.
/// @return  status kTooLittleData for an empty problem or one without parallax; else the gauge of
/// the start: the first well-observed frame keeps its pose to the last bit and the farthest centre
/// its distance along the line between them. With `fixed_frames` these keep theirs. Same bytes at
/// any `options.num_threads`.
/// Error:   truth to 1e-6 of the path length on clean scenes (ba tests).
/// Cost:    per iteration linear in observations plus a Cholesky of 6 unknowns per camera; three
/// rounds of 67 cameras, 13,000 points and 84,000 observations take 2 to 3 s.
/// Source:  Triggs et al., Bundle Adjustment - A Modern Synthesis, 1999; the chain of rounds is
/// ours.
BundleResult RefineBundle(const BundleProblem& problem,
                          const BundleOptions& options,
                          const TrackCompletion& complete = nullptr);

/// Triangulates all tracks of `problem` against its cameras, which stay as they are, and keeps the
/// observations within `options.fine.max_error_px`: more points, seen from more frames, for a
/// cloud.
/// @return  the poses of the start with those points and tracks; the same contract as RefineBundle.
Reconstruction TriangulateTracks(const BundleProblem& problem, const BundleOptions& options);

/// The reconstruction without the points (and their tracks) whose rays nowhere meet at
/// `min_angle_deg`. Shallow points help rotations but spread along the line of sight, which is not
/// what one wants to look at.
Reconstruction WithoutShallowPoints(const Reconstruction& reconstruction, double min_angle_deg);

}  // namespace rotslam
