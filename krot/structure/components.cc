#include "krot/structure/components.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include <Eigen/Geometry>

namespace rotslam {
namespace {

double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

using RaysOfViews = std::map<FrameId, std::vector<TrackRay>>;

// The pair of remaining views with the most common tracks with parallax between the two; the
// earliest of equal ones.
std::optional<std::pair<FrameId, FrameId>> BestPair(const std::vector<Track>& tracks,
                                                    const RotationMap& cam_from_world,
                                                    const std::set<FrameId>& free_views,
                                                    const ComponentOptions& options) {
  std::map<std::pair<FrameId, FrameId>, int> shared;
  for (const Track& track : tracks) {
    for (std::size_t a = 0; a < track.observations.size(); ++a) {
      const Observation& first = track.observations[a];
      if (!free_views.contains(first.frame)) continue;
      const Eigen::Vector3d ray = cam_from_world.at(first.frame).Inverse() * first.bearing;
      // A long track has many pairs of views; those within the next dozen suffice as seeds.
      const std::size_t end = std::min(track.observations.size(), a + 13);
      for (std::size_t b = a + 1; b < end; ++b) {
        const Observation& second = track.observations[b];
        if (!free_views.contains(second.frame)) continue;
        const Eigen::Vector3d other = cam_from_world.at(second.frame).Inverse() * second.bearing;
        if (Angle(ray, other) < options.min_parallax_rad) continue;
        ++shared[{first.frame, second.frame}];
      }
    }
  }
  std::optional<std::pair<FrameId, FrameId>> best;
  int most = kMinSharedPoints - 1;
  for (const auto& [pair, count] : shared) {
    if (count <= most) continue;
    most = count;
    best = pair;
  }
  return best;
}

class Grower {
 public:
  Grower(const std::vector<Track>& tracks,
         const RaysOfViews& rays,
         const std::set<FrameId>& free_views,
         const ComponentOptions& options)
      : tracks_(tracks),
        rays_(rays),
        free_views_(free_views),
        options_(options),
        first_ray_(tracks.size()),
        known_(tracks.size(), 0.0) {}

  void Add(FrameId view) {
    component_.views.push_back(view);
    placed_.insert(view);
    num_known_.erase(view);
    for (const TrackRay& ray : rays_.at(view)) {
      std::optional<FirstRay>& first = first_ray_[ray.track];
      if (!first) {
        first = {view, ray.ray_in_world};
        continue;
      }
      const double known = Knowledge(*first, view, ray.ray_in_world);
      if (known <= known_[ray.track]) continue;
      for (const Observation& observation : tracks_[ray.track].observations) {
        if (placed_.contains(observation.frame) || !free_views_.contains(observation.frame)) {
          continue;
        }
        num_known_[observation.frame] += known - known_[ray.track];
      }
      known_[ray.track] = known;
    }
  }

  // The view nearest in time to the last one that sees enough known points.
  std::optional<FrameId> Next() const {
    std::optional<FrameId> best;
    int nearest = 0;
    const int last = component_.views.back().value;
    for (const auto& [view, count] : num_known_) {
      if (count < kMinSharedPoints) continue;
      const int distance = std::abs(view.value - last);
      if (best && distance >= nearest) continue;
      best = view;
      nearest = distance;
    }
    return best;
  }

  const ViewComponent& component() const { return component_; }

 private:
  struct FirstRay {
    FrameId view;
    Eigen::Vector3d ray_in_world;
  };

  // Weight of a point seen by two views, 0 (unknown depth) to 1 (known).
  double Knowledge(const FirstRay& first, FrameId view, const Eigen::Vector3d& ray) const {
    const double parallax = Angle(first.ray_in_world, ray);
    if (parallax >= options_.min_parallax_rad) return 1.0;
    const double noise = std::max(NoiseOf(first.view), NoiseOf(view));
    if (parallax < options_.min_noise_ratio * noise) return 0.0;
    const double share = parallax / options_.min_parallax_rad;
    return share * share;
  }

  double NoiseOf(FrameId view) const {
    const auto noise = options_.noise_rad.find(view);
    return noise == options_.noise_rad.end() ? std::numeric_limits<double>::infinity()
                                             : noise->second;
  }

  const std::vector<Track>& tracks_;
  const RaysOfViews& rays_;
  const std::set<FrameId>& free_views_;
  const ComponentOptions& options_;
  std::vector<std::optional<FirstRay>> first_ray_;
  std::vector<double> known_;            // weight of each track as a known point
  std::map<FrameId, double> num_known_;  // known points seen by each remaining view
  std::set<FrameId> placed_;
  ViewComponent component_;
};

}  // namespace

double TrackParallax(const RotationMap& cam_from_world, const Track& track) {
  double largest = 0.0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < track.observations.size(); ++k) {
    const Observation& observation = track.observations[k];
    const Eigen::Vector3d ray =
        cam_from_world.at(observation.frame).Inverse() * observation.bearing;
    if (k == 0) {
      first = ray;
    } else {
      largest = std::max(largest, Angle(first, ray));
    }
  }
  return largest;
}

std::vector<ViewComponent> FindComponents(const RotationMap& cam_from_world,
                                          const std::vector<Track>& tracks,
                                          const ComponentOptions& options) {
  const RaysOfViews rays = RaysByFrame(cam_from_world, tracks);
  std::set<FrameId> free_views;
  for (const auto& [view, of_view] : rays) free_views.insert(view);
  std::vector<ViewComponent> components;
  while (const auto seed = BestPair(tracks, cam_from_world, free_views, options)) {
    Grower grower(tracks, rays, free_views, options);
    grower.Add(seed->first);
    grower.Add(seed->second);
    while (const auto next = grower.Next()) grower.Add(*next);
    for (const FrameId view : grower.component().views) free_views.erase(view);
    components.push_back(grower.component());
  }
  std::stable_sort(components.begin(), components.end(), [](const auto& a, const auto& b) {
    return a.views.size() > b.views.size();
  });
  return components;
}

}  // namespace rotslam
