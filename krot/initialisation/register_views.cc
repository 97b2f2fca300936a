#include "krot/initialisation/register_views.h"

#include <algorithm>
#include <map>
#include <optional>

namespace rotslam {
namespace {

class Growth {
 public:
  Growth(const RotationMap& cam_from_world,
         const std::vector<Track>& tracks,
         const RegistrationOptions& options,
         CenterMap& centers)
      : cam_from_world_(cam_from_world),
        tracks_(tracks),
        options_(options),
        centers_(centers),
        points_(tracks.size()),
        num_placed_(tracks.size(), 0) {
    for (int t = 0; t < static_cast<int>(tracks.size()); ++t) {
      for (int o = 0; o < static_cast<int>(tracks[t].observations.size()); ++o) {
        const FrameId frame = tracks[t].observations[o].frame;
        sights_of_[frame].push_back({t, o});
        if (centers_.contains(frame)) ++num_placed_[t];
      }
      if (num_placed_[t] >= 2) Intersect(t);
    }
  }

  int NumKnownPoints(FrameId view) const {
    const auto entry = sights_of_.find(view);
    if (entry == sights_of_.end()) return 0;
    int count = 0;
    for (const Sight& sight : entry->second) count += points_[sight.track].has_value();
    return count;
  }

  bool Place(FrameId view) {
    const Rotation world_from_cam = cam_from_world_.at(view).Inverse();
    std::vector<RayToPoint> rays;
    for (const Sight& sight : sights_of_.at(view)) {
      if (!points_[sight.track]) continue;
      const Observation& observation = tracks_[sight.track].observations[sight.observation];
      rays.push_back({*points_[sight.track], world_from_cam * observation.bearing});
    }
    CenterResectionOptions resection_options = options_.resection;
    resection_options.seed += static_cast<std::uint64_t>(view.value) * 7919u;
    const auto resection = ResectCenter(rays, resection_options);
    if (!resection || static_cast<int>(resection->inliers.size()) < options_.min_points) {
      return false;
    }
    centers_[view] = resection->center_in_world;
    for (const Sight& sight : sights_of_.at(view)) {
      const int placed = ++num_placed_[sight.track];
      if (placed < 2) continue;
      // Known points are intersected anew when their sightings have grown by half.
      if (!points_[sight.track] || placed <= 4 || (placed & (placed - 1)) == 0 ||
          placed % 12 == 0) {
        Intersect(sight.track);
      }
    }
    return true;
  }

 private:
  struct Sight {
    int track;
    int observation;
  };

  void Intersect(int track) {
    const auto point =
        TriangulateRobustly(PlacedSightings(cam_from_world_, centers_, tracks_[track], 1.0),
                            options_.min_angle_rad,
                            options_.threshold_rad);
    if (point) points_[track] = point->point_in_world;
  }

  const RotationMap& cam_from_world_;
  const std::vector<Track>& tracks_;
  const RegistrationOptions& options_;
  CenterMap& centers_;
  std::vector<std::optional<Eigen::Vector3d>> points_;
  std::vector<int> num_placed_;
  std::map<FrameId, std::vector<Sight>> sights_of_;
};

// First view in order with points enough, else the one with most, else none.
std::optional<std::size_t> NextView(const Growth& growth,
                                    const std::vector<FrameId>& waiting,
                                    const std::vector<bool>& failed,
                                    int min_points) {
  constexpr int kPlenty = 5;  // times min_points
  std::optional<std::size_t> best;
  int most = min_points - 1;
  for (std::size_t k = 0; k < waiting.size(); ++k) {
    if (failed[k]) continue;
    const int known = growth.NumKnownPoints(waiting[k]);
    if (known >= kPlenty * min_points) return k;
    if (known <= most) continue;
    most = known;
    best = k;
  }
  return best;
}

}  // namespace

std::vector<Sighting> PlacedSightings(const RotationMap& cam_from_world,
                                      const CenterMap& centers,
                                      const Track& track,
                                      double focal_px,
                                      std::vector<int>* observations) {
  std::vector<Sighting> sightings;
  for (std::size_t o = 0; o < track.observations.size(); ++o) {
    const Observation& observation = track.observations[o];
    const auto center = centers.find(observation.frame);
    if (center == centers.end()) continue;
    const double sigma = observation.sigma_px > 0.0 ? observation.sigma_px / focal_px : 1.0;
    sightings.push_back(
        {cam_from_world.at(observation.frame), center->second, observation.bearing, sigma});
    if (observations != nullptr) observations->push_back(static_cast<int>(o));
  }
  return sightings;
}

std::vector<FrameId> RegisterViews(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const std::vector<FrameId>& order,
                                   const RegistrationOptions& options,
                                   CenterMap& centers) {
  std::vector<FrameId> waiting;
  for (const FrameId view : order) {
    if (!centers.contains(view)) waiting.push_back(view);
  }
  if (waiting.empty()) return waiting;
  Growth growth(cam_from_world, tracks, options, centers);
  std::vector<bool> failed(waiting.size(), false);
  while (const auto next = NextView(growth, waiting, failed, options.min_points)) {
    if (growth.Place(waiting[*next])) {
      waiting.erase(waiting.begin() + static_cast<std::ptrdiff_t>(*next));
      failed.assign(waiting.size(), false);  // new points may help those that failed
    } else {
      failed[*next] = true;
    }
  }
  return waiting;
}

}  // namespace rotslam
