#include "apps/turning.h"

#include <algorithm>
#include <cmath>

namespace rotslam {
namespace {

// Tracks that tell whether it is worth while to look at all of them.
constexpr std::size_t kSampledTracks = 2000;
// Smallest mean square of residuals, in sigmas, that tells anything: 0.01 of a sigma.
constexpr double kLeastVariance = 1e-4;
// Of all measurements, what a believable explanation passes.
constexpr double kMinShare = 0.25;
// Of all observations, what a model explains whose residuals tell how good it is: positions and
// points explain 0.80 and more of what a moving camera sees, 0.4 to 0.6 of a tripod's turn.
constexpr double kMostObservations = 2.0 / 3.0;
// A sample may explain this much less than is asked for: it has fewer observations to find the
// lens with.
constexpr double kSampleShare = 0.8;
// No calibration, guessed or not, is wrong by more than this factor.
constexpr double kMaxFocalFactor = 2.0;

bool IsLensCredible(const Camera& given, const Camera& refined) {
  const double factor = refined.MeanFocal() / given.MeanFocal();
  return factor <= kMaxFocalFactor && factor >= 1.0 / kMaxFocalFactor;
}

std::vector<Track> SampleOf(const std::vector<Track>& tracks) {
  const std::size_t stride = (tracks.size() + kSampledTracks - 1) / kSampledTracks;
  std::vector<Track> sample;
  for (std::size_t k = 0; k < tracks.size(); k += stride) sample.push_back(tracks[k]);
  return sample;
}

}  // namespace

Explanation ExplanationBy(const std::vector<BundleSummary>& bundles) {
  Explanation sum;
  for (const BundleSummary& bundle : bundles) {
    const BundleSupport& support = bundle.support;
    sum.num_observations += support.num_observations;
    sum.num_tracks += support.num_points;
    sum.redundancy +=
        2 * support.num_observations - 3 * support.num_points - 6 * support.num_frames;
    sum.cost += support.cost;
  }
  return sum;
}

Explanation ExplanationBy(const TurningResult& turning) {
  const int num_free =
      2 * turning.num_directions + 3 * static_cast<int>(turning.cam_from_world.size());
  return {.num_observations = turning.num_observations,
          .num_tracks = turning.num_directions,
          .redundancy = 2 * turning.num_observations - num_free,
          .cost = turning.final_cost};
}

double Evidence(const Explanation& explanation, double limit) {
  if (explanation.redundancy <= 0) return 0.0;
  if (limit == 0.0) {
    const int num_matches = explanation.num_observations - explanation.num_tracks;
    return std::max(0, explanation.redundancy - num_matches);
  }
  const double variance = std::max(kLeastVariance, 2.0 * explanation.cost / explanation.redundancy);
  return explanation.redundancy * std::max(0.0, 0.5 * std::log(limit * limit / variance));
}

std::optional<TurningResult> FindTurning(const Camera& camera,
                                         const RotationMap& cam_from_world,
                                         const std::vector<Track>& tracks,
                                         const Explanation& moving,
                                         const BundleOptions& options) {
  const int num_given = NumObservations(tracks);
  const bool residuals_tell = moving.num_observations >= kMostObservations * num_given;
  const double limit = residuals_tell ? options.fine.max_error_px : 0.0;
  const double evidence_of_moving = Evidence(moving, limit);
  // Whether a turn of `share` of all observations passes enough checks, and more than movement.
  const auto is_believable = [&](const TurningResult& turning, double share) {
    const Explanation explanation = ExplanationBy(turning);
    return turning.Usable() && IsLensCredible(camera, turning.camera) &&
           explanation.redundancy > share * kMinShare * 2 * num_given &&
           Evidence(explanation, limit) > share * evidence_of_moving;
  };
  const std::vector<Track> sample = SampleOf(tracks);
  if (sample.size() < tracks.size()) {
    const double share = static_cast<double>(NumObservations(sample)) / num_given;
    const TurningResult sampled = RefineTurning(camera, cam_from_world, sample, options);
    if (!is_believable(sampled, kSampleShare * share)) return std::nullopt;
  }
  TurningResult turning = RefineTurning(camera, cam_from_world, tracks, options);
  if (!turning.lens_refined || !is_believable(turning, 1.0)) return std::nullopt;
  return turning;
}

}  // namespace rotslam
