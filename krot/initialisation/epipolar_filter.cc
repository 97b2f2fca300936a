#include "krot/initialisation/epipolar_filter.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Dense>

#include "rotodom/types/median.h"
#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

struct SharedTrack {
  ObservationIndex first;
  ObservationIndex second;
  Eigen::Vector3d ray_a;  // world frame
  Eigen::Vector3d ray_b;
  Eigen::Vector3d normal;  // ray_a x ray_b; its length is the sine of the parallax
};

// Distance of two rays from a common plane with a direction: the smaller of two measures, so that
// it stays bounded near the epipole.
struct Miss {
  double squared_volume;
  double squared_sine;  // of the ray's angle to the direction

  bool IsWithin(double threshold) const {
    return squared_volume <= threshold * threshold * squared_sine;
  }
  double SquaredAngle() const {
    return squared_volume == 0.0 ? 0.0 : squared_volume / squared_sine;
  }
};

// @param direction  unit.
Miss MissOf(const SharedTrack& shared, const Eigen::Vector3d& direction) {
  const double volume = shared.normal.dot(direction);
  const double cosine_a = direction.dot(shared.ray_a);
  const double cosine_b = direction.dot(shared.ray_b);
  return {volume * volume, 1.0 - std::min(cosine_a * cosine_a, cosine_b * cosine_b)};
}

bool ShareAPlane(const SharedTrack& shared, const Eigen::Vector3d& direction, double threshold) {
  return MissOf(shared, direction).IsWithin(threshold);
}

int CountInliers(const std::vector<SharedTrack>& shared,
                 const Eigen::Vector3d& direction,
                 double threshold) {
  int count = 0;
  for (const SharedTrack& track : shared) count += ShareAPlane(track, direction, threshold);
  return count;
}

Eigen::Vector3d VoteDirection(const std::vector<SharedTrack>& shared,
                              const EpipolarFilterOptions& options,
                              std::uint64_t seed) {
  SplitMix64 random(seed);
  const int count = static_cast<int>(shared.size());
  Eigen::Vector3d best = Eigen::Vector3d::UnitZ();
  int most = -1;
  for (int sample = 0; sample < options.max_samples; ++sample) {
    const SharedTrack& a = shared[random.Index(count)];
    const SharedTrack& b = shared[random.Index(count)];
    const Eigen::Vector3d direction = a.normal.cross(b.normal);
    if (!(direction.norm() > 1e-12)) continue;
    const int inliers = CountInliers(shared, direction.normalized(), options.threshold_rad);
    if (inliers <= most) continue;
    most = inliers;
    best = direction.normalized();
  }
  return best;
}

using PairMap = std::map<std::pair<FrameId, FrameId>, std::vector<SharedTrack>>;

// Pairs to test: for each view the later views with the most common tracks.
std::vector<std::pair<FrameId, FrameId>> ChoosePairs(const std::vector<Track>& tracks,
                                                     const EpipolarFilterOptions& options) {
  std::map<std::pair<FrameId, FrameId>, int> shared;
  for (const Track& track : tracks) {
    for (std::size_t a = 0; a < track.observations.size(); ++a) {
      const std::size_t end = std::min(track.observations.size(), a + 9);
      for (std::size_t b = a + 1; b < end; ++b) {
        ++shared[{track.observations[a].frame, track.observations[b].frame}];
      }
    }
  }
  std::map<FrameId, std::vector<std::pair<int, FrameId>>> partners;
  for (const auto& [pair, count] : shared) {
    if (count >= options.min_shared_tracks) partners[pair.first].emplace_back(-count, pair.second);
  }
  std::vector<std::pair<FrameId, FrameId>> pairs;
  for (auto& [view, others] : partners) {
    std::sort(others.begin(), others.end());
    const std::size_t keep =
        std::min<std::size_t>(others.size(), static_cast<std::size_t>(options.partners_per_view));
    for (std::size_t k = 0; k < keep; ++k) pairs.emplace_back(view, others[k].second);
  }
  return pairs;
}

PairMap CollectShared(const RotationMap& cam_from_world,
                      const std::vector<Track>& tracks,
                      const EpipolarFilterOptions& options) {
  PairMap pairs;
  for (const auto& pair : ChoosePairs(tracks, options)) pairs[pair];
  for (int t = 0; t < static_cast<int>(tracks.size()); ++t) {
    const auto& observations = tracks[t].observations;
    std::vector<Eigen::Vector3d> rays;
    rays.reserve(observations.size());
    for (const Observation& observation : observations) {
      rays.push_back(cam_from_world.at(observation.frame).Inverse() * observation.bearing);
    }
    for (int a = 0; a < static_cast<int>(observations.size()); ++a) {
      const int end = std::min(static_cast<int>(observations.size()), a + 9);
      for (int b = a + 1; b < end; ++b) {
        const auto entry = pairs.find({observations[a].frame, observations[b].frame});
        if (entry == pairs.end()) continue;
        entry->second.push_back({{t, a}, {t, b}, rays[a], rays[b], rays[a].cross(rays[b])});
      }
    }
  }
  return pairs;
}

// Robust standard deviation of the distances of the rays from the planes, from their median. The
// direction is first refined with a decreasing threshold.
double NoiseOf(const std::vector<SharedTrack>& shared,
               Eigen::Vector3d direction,
               double threshold) {
  constexpr int kRounds = 3;
  constexpr double kInlierSigmas = 2.5;
  double noise = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
    for (const SharedTrack& track : shared) {
      if (!ShareAPlane(track, direction, threshold)) continue;
      normals += track.normal * track.normal.transpose();
    }
    direction = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(normals).eigenvectors().col(0);
    std::vector<double> squared;
    squared.reserve(shared.size());
    for (const SharedTrack& track : shared)
      squared.push_back(MissOf(track, direction).SquaredAngle());
    noise = kSigmasPerMedianDeviation * std::sqrt(Median(std::move(squared)));
    threshold = std::min(threshold, kInlierSigmas * noise);
  }
  return noise;
}

}  // namespace

EpipolarVerdict TestEpipolarPlanes(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const EpipolarFilterOptions& options) {
  std::map<ObservationIndex, int> balance;  // pairs failed minus pairs passed
  std::map<FrameId, std::vector<double>> noises;
  std::uint64_t pair_number = 0;
  for (const auto& [pair, shared] : CollectShared(cam_from_world, tracks, options)) {
    const std::uint64_t seed = options.seed * 1000003u + pair_number++;
    if (static_cast<int>(shared.size()) < options.min_shared_tracks) continue;
    const Eigen::Vector3d direction = VoteDirection(shared, options, seed);
    // Pairs in which most tracks disagree are ignored.
    const int agreeing = CountInliers(shared, direction, options.threshold_rad);
    if (2 * agreeing < static_cast<int>(shared.size())) continue;
    for (const SharedTrack& track : shared) {
      const int vote = ShareAPlane(track, direction, options.threshold_rad) ? -1 : 1;
      balance[track.first] += vote;
      balance[track.second] += vote;
    }
    const double noise = NoiseOf(shared, direction, options.threshold_rad);
    noises[pair.first].push_back(noise);
    noises[pair.second].push_back(noise);
  }
  EpipolarVerdict verdict;
  for (const auto& [index, votes] : balance) {
    if (votes > 0) verdict.outliers.push_back(index);
  }
  for (auto& [view, of_pairs] : noises) verdict.noise_rad[view] = Median(std::move(of_pairs));
  return verdict;
}

}  // namespace rotslam
