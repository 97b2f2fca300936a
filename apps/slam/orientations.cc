#include "apps/slam/orientations.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rotodom/averaging/global_averaging.h"
#include "rotodom/self_calibration/through_lens.h"
#include "rotodom/types/median.h"

namespace rotslam {

void InterpolateUnknown(const Orientations& orientations,
                        const std::set<FrameId>& unknown,
                        RotationMap& rotations) {
  const RotationMap& before_refinement = orientations.cam_from_world;
  const auto known = [&](FrameId frame) { return !unknown.contains(frame); };
  using Entry = RotationMap::iterator;
  const auto is_given = [&](Entry entry) {
    return orientations.given && orientations.given->CountsFor(entry->first);
  };
  // How a frame was rotated since, in the world, and an orientation rotated likewise.
  const auto turn_of = [&](Entry entry) {
    return before_refinement.at(entry->first).Inverse() * entry->second;
  };
  const auto given_at = [&](Entry entry, const Rotation& turn) {
    return before_refinement.at(entry->first) * turn;
  };
  for (auto entry = rotations.begin(); entry != rotations.end(); ++entry) {
    if (known(entry->first)) continue;
    auto before = entry;
    while (before != rotations.begin() && !known(before->first)) --before;
    auto after = entry;
    while (after != rotations.end() && !known(after->first)) ++after;
    const bool has_before = known(before->first);
    if (has_before && after != rotations.end()) {
      const double from_s = orientations.timestamps_s[before->first.value];
      const double to_s = orientations.timestamps_s[after->first.value];
      const double at_s = orientations.timestamps_s[entry->first.value];
      const double weight = (at_s - from_s) / (to_s - from_s);
      entry->second = is_given(entry)
                          ? given_at(entry, Interpolate(turn_of(before), turn_of(after), weight))
                          : Interpolate(before->second, after->second, weight);
    } else if (has_before) {
      entry->second = is_given(entry) ? given_at(entry, turn_of(before)) : before->second;
    } else if (after != rotations.end()) {
      entry->second = is_given(entry) ? given_at(entry, turn_of(after)) : after->second;
    }
  }
}

std::optional<Orientations> ThroughFoundLens(const Orientations& orientations,
                                             const Camera& found,
                                             const SlamOptions& options) {
  if (!options.ba.lens.expected || orientations.given) return std::nullopt;
  Orientations seen;
  seen.camera = found;
  seen.timestamps_s = orientations.timestamps_s;
  seen.unconnected = orientations.unconnected;
  seen.covariance = orientations.covariance;
  seen.cam_from_world = orientations.cam_from_world;
  seen.graph = TurnedThroughLens(orientations.graph, orientations.camera, found);
  for (const auto& [frame, rotation] : CloseLoops(seen.graph.edges(),
                                                  orientations.cam_from_world,
                                                  options.rotodom.averaging,
                                                  options.num_threads)
                                           .cam_from_world) {
    seen.cam_from_world[frame] = rotation;
  }
  return seen;
}

RotationRates RatesOf(const Orientations& orientations) {
  return RatesOf(orientations.cam_from_world,
                 [&](FrameId frame) { return orientations.timestamps_s[frame.value]; });
}

std::map<FrameId, double> OrientationSigmas(const Orientations& orientations) {
  std::map<FrameId, double> sigma_rad;
  for (const auto& [frame, covariance] : orientations.covariance) {
    sigma_rad[frame] = std::sqrt(covariance.trace() / 3.0);
  }
  return sigma_rad;
}

std::map<FrameId, double> SensorPriors(const Orientations& orientations,
                                       const std::set<FrameId>& keyframes) {
  std::map<FrameId, double> sigma_rad;
  if (!orientations.given || !orientations.given->fusion.drifts_less) return sigma_rad;
  const SensorFusion& fusion = orientations.given->fusion;
  for (const FrameId frame : keyframes) {
    if (orientations.given->CountsFor(frame)) sigma_rad[frame] = 0.0;
  }
  // Keypoints count with a deviation of one pixel, whatever theirs is.
  std::vector<double> noise_px;
  noise_px.reserve(orientations.graph.edges().size());
  for (const RelativeRotation& edge : orientations.graph.edges()) noise_px.push_back(edge.noise_px);
  const double scale = 1.0 / std::clamp(Median(std::move(noise_px), 1.0), 0.01, 1.0);
  // Priors count as independent: an error that all share weighs as if there were one of them.
  const auto number = static_cast<double>(sigma_rad.size());
  for (auto& [frame, sigma] : sigma_rad) {
    sigma = scale *
            std::sqrt(fusion.sigma_rad * fusion.sigma_rad + number * fusion.variance[frame.value]);
  }
  return sigma_rad;
}

RotationScale RotationScaleOf(const std::vector<LoopCheck>& loops) {
  std::vector<double> factors;
  for (const LoopCheck& loop : loops) {
    if (loop.accepted && loop.scaled.turn_scale != 1.0) factors.push_back(loop.scaled.turn_scale);
  }
  const int num_loops = static_cast<int>(factors.size());
  return {Median(std::move(factors), 1.0), num_loops};
}

}  // namespace rotslam
