#include "krot/initialisation/register_views.h"

#include <algorithm>
#include <map>
#include <optional>

namespace rotslam {
namespace {

class Registration {
 public:
  Registration(const RotationMap& cam_from_world,
               const std::vector<Track>& tracks,
               const RegistrationOptions& options,
               CenterMap& centers)
      : cam_from_world_(cam_from_world),
        tracks_(tracks),
        options_(options),
        centers_(centers),
        points_(tracks.size()),
        num_registered_(tracks.size(), 0) {
    for (int t = 0; t < static_cast<int>(tracks.size()); ++t) {
      for (int o = 0; o < static_cast<int>(tracks[t].observations.size()); ++o) {
        const FrameId frame = tracks[t].observations[o].frame;
        observations_of_[frame].push_back({t, o});
        if (centers_.contains(frame)) ++num_registered_[t];
      }
      if (num_registered_[t] >= 2) Intersect(t);
    }
  }

  int NumKnownPoints(FrameId view) const {
    const auto entry = observations_of_.find(view);
    if (entry == observations_of_.end()) return 0;
    int count = 0;
    for (const ObservationIndex& seen : entry->second) count += points_[seen.track].has_value();
    return count;
  }

  bool Register(FrameId view) {
    const Rotation world_from_cam = cam_from_world_.at(view).Inverse();
    // Resection of a centre is triangulation along the reversed rays from the known points.
    std::vector<PosedRay> rays;
    for (const ObservationIndex& seen : observations_of_.at(view)) {
      if (!points_[seen.track]) continue;
      const Observation& observation = tracks_[seen.track].observations[seen.observation];
      rays.push_back({Rotation(), *points_[seen.track], -(world_from_cam * observation.bearing)});
    }
    CenterResectionOptions resection_options = options_.resection;
    resection_options.seed += static_cast<std::uint64_t>(view.value) * 7919u;
    const auto resection = ResectCenter(rays, resection_options);
    if (!resection || static_cast<int>(resection->inliers.size()) < options_.min_points) {
      return false;
    }
    centers_[view] = resection->center_in_world;
    for (const ObservationIndex& seen : observations_of_.at(view)) {
      const int placed = ++num_registered_[seen.track];
      if (placed < 2) continue;
      // Known points are triangulated again after every new view up to four, then at powers of two
      // and multiples of twelve.
      if (!points_[seen.track] || placed <= 4 || (placed & (placed - 1)) == 0 || placed % 12 == 0) {
        Intersect(seen.track);
      }
    }
    return true;
  }

 private:
  void Intersect(int track) {
    const auto point =
        TriangulateRobustly(PosedRays(cam_from_world_, centers_, tracks_[track], 1.0),
                            options_.min_angle_rad,
                            options_.threshold_rad);
    if (point) points_[track] = point->point_in_world;
  }

  const RotationMap& cam_from_world_;
  const std::vector<Track>& tracks_;
  const RegistrationOptions& options_;
  CenterMap& centers_;
  std::vector<std::optional<Eigen::Vector3d>> points_;
  std::vector<int> num_registered_;
  std::map<FrameId, std::vector<ObservationIndex>> observations_of_;
};

// The first view in order with five times min_points known points, else the one with the most, at
// least min_points.
std::optional<std::size_t> NextView(const Registration& registration,
                                    const std::vector<FrameId>& remaining,
                                    const std::vector<bool>& failed,
                                    int min_points) {
  constexpr int kPlenty = 5;  // times min_points: accurate enough to keep the order
  std::optional<std::size_t> best;
  int most = min_points - 1;
  for (std::size_t k = 0; k < remaining.size(); ++k) {
    if (failed[k]) continue;
    const int known = registration.NumKnownPoints(remaining[k]);
    if (known >= kPlenty * min_points) return k;
    if (known <= most) continue;
    most = known;
    best = k;
  }
  return best;
}

}  // namespace

std::vector<PosedRay> PosedRays(const RotationMap& cam_from_world,
                                const CenterMap& centers,
                                const Track& track,
                                double focal_px,
                                std::vector<int>* observations) {
  std::vector<PosedRay> rays;
  for (std::size_t o = 0; o < track.observations.size(); ++o) {
    const Observation& observation = track.observations[o];
    const auto center = centers.find(observation.frame);
    if (center == centers.end()) continue;
    const double sigma = observation.sigma_px > 0.0 ? observation.sigma_px / focal_px : 1.0;
    rays.push_back(
        {cam_from_world.at(observation.frame), center->second, observation.bearing, sigma});
    if (observations != nullptr) observations->push_back(static_cast<int>(o));
  }
  return rays;
}

std::vector<FrameId> RegisterViews(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const std::vector<FrameId>& order,
                                   const RegistrationOptions& options,
                                   CenterMap& centers) {
  std::vector<FrameId> remaining;
  for (const FrameId view : order) {
    if (!centers.contains(view)) remaining.push_back(view);
  }
  if (remaining.empty()) return remaining;
  Registration registration(cam_from_world, tracks, options, centers);
  std::vector<bool> failed(remaining.size(), false);
  while (const auto next = NextView(registration, remaining, failed, options.min_points)) {
    if (registration.Register(remaining[*next])) {
      remaining.erase(remaining.begin() + static_cast<std::ptrdiff_t>(*next));
      failed.assign(remaining.size(), false);  // new points may help those that failed
    } else {
      failed[*next] = true;
    }
  }
  return remaining;
}

}  // namespace rotslam
