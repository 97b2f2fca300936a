#include "apps/turning.h"

#include <algorithm>

namespace rotslam {
namespace {

// Tracks that tell whether it is worth while to look at all of them.
constexpr std::size_t kSampledTracks = 2000;
// Of all measurements, what a believable explanation passes.
constexpr double kMinShare = 0.25;
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

int NumObservations(const std::vector<Track>& tracks) {
  std::size_t sum = 0;
  for (const Track& track : tracks) sum += track.observations.size();
  return static_cast<int>(sum);
}

int Redundancy(const std::vector<BundleSummary>& bundles) {
  int sum = 0;
  for (const BundleSummary& bundle : bundles) {
    sum += 2 * bundle.num_observations - 3 * bundle.num_points - 6 * bundle.num_frames;
  }
  return sum;
}

int Redundancy(const TurningResult& turning) {
  return 2 * turning.num_observations - 2 * turning.num_directions -
         3 * static_cast<int>(turning.cam_from_world.size());
}

std::optional<TurningResult> FindTurning(const Camera& camera,
                                         const RotationMap& cam_from_world,
                                         const std::vector<Track>& tracks,
                                         int redundancy,
                                         const BundleOptions& options) {
  const int num_given = NumObservations(tracks);
  const double needed = std::max(static_cast<double>(redundancy), kMinShare * 2 * num_given);
  const std::vector<Track> sample = SampleOf(tracks);
  if (sample.size() < tracks.size()) {
    const TurningResult sampled = RefineTurning(camera, cam_from_world, sample, options);
    const double share = static_cast<double>(NumObservations(sample)) / num_given;
    if (!sampled.Usable() || !IsLensCredible(camera, sampled.camera) ||
        Redundancy(sampled) < kSampleShare * share * needed) {
      return std::nullopt;
    }
  }
  TurningResult turning = RefineTurning(camera, cam_from_world, tracks, options);
  if (!turning.Usable() || !turning.lens_refined || !IsLensCredible(camera, turning.camera) ||
      Redundancy(turning) <= needed) {
    return std::nullopt;
  }
  return turning;
}

}  // namespace rotslam
