#include "ba/rotation_adjustment.h"

#include <algorithm>

namespace rotslam {
namespace {

// Standard deviation of the focal length given, as a share of it, where the lens may move.
constexpr double kFocalSigma = 0.1;
// Share of the cost that another lens must take off: with the focal length free there is always one
// that fits somewhat better.
constexpr double kMinLensGain = 0.01;

}  // namespace

PureRotationResult RefinePureRotation(const Camera& camera,
                                      const RotationMap& cam_from_world,
                                      const std::vector<Track>& tracks,
                                      const BundleOptions& options) {
  PureRotationResult result;
  if (cam_from_world.empty()) {
    result.status = BundleStatus::kTooLittleData;
    return result;
  }
  BundleProblem problem;
  problem.camera = camera;
  problem.start.cam_from_world = cam_from_world;
  problem.start.tracks = tracks;
  const FrameId first = cam_from_world.begin()->first;
  for (const auto& [frame, rotation] : cam_from_world) {
    problem.start.center_in_world[frame] = Eigen::Vector3d::Zero();
    if (frame != first) problem.shared_center[frame] = first;
  }
  BundleOptions rotating = options;
  // Rotations averaged under a wrong lens are several pixels off: nothing is left out at first, and
  // the loss keeps what does not fit from carrying them away.
  rotating.fixed_rotation.refine_rotations = true;
  rotating.fixed_rotation.loss = RobustLoss::kCauchy;
  rotating.find_covariance = false;
  rotating.find_lens_covariance = true;
  // Explanations are compared at the same loss and limit.
  rotating.loss_spreads = 0.0;
  rotating.limit_spreads = 0.0;
  LensOptions& lens = rotating.lens;
  if (lens.refine_distortion || lens.refine_focal) {
    lens.refine_focal = true;
    lens.focal_sigma = std::max(lens.focal_sigma, kFocalSigma);
  }
  if (lens.given_sigmas) {
    double& sigma = (*lens.given_sigmas)[kLensFocal];
    sigma = std::max(sigma, kFocalSigma);
  }
  lens.min_gain = std::max(lens.min_gain, kMinLensGain);
  const BundleResult refined = RefineBundle(problem, rotating);
  result.status = refined.status;
  result.cam_from_world = refined.reconstruction.cam_from_world;
  result.camera = refined.camera;
  result.lens_refined = refined.summary.lens_refined;
  result.lens_sigmas = refined.summary.lens_sigmas;
  result.lens_covariance = refined.summary.lens_covariance;
  if (refined.summary.rounds.empty()) return result;
  const BundleRoundSummary& last = refined.summary.rounds.back();
  result.num_directions = last.num_directions;
  result.num_observations = last.num_observations;
  result.final_cost = last.final_cost;
  return result;
}

}  // namespace rotslam
