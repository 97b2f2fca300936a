#include "krot/track_points.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "krot/initialisation/register_views.h"
#include "krot/initialisation/robust_triangulation.h"
#include "rotodom/types/parallel.h"

namespace rotslam {

void RequireContract(const RotationMap& cam_from_world,
                     const std::vector<Track>& tracks,
                     const Camera& camera,
                     const KrotOptions& options) {
  if (const auto trouble = options.Problem()) {
    throw std::invalid_argument("KrotOptions: " + *trouble);
  }
  if (!(camera.MeanFocal() > 0.0) || !std::isfinite(camera.MeanFocal())) {
    throw std::invalid_argument("SolveKnownRotation: the camera has no focal length");
  }
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) {
      if (cam_from_world.contains(observation.frame)) continue;
      throw std::invalid_argument("SolveKnownRotation: track " + std::to_string(track.id.value) +
                                  " names view " + std::to_string(observation.frame.value) +
                                  ", which has no rotation");
    }
  }
}

std::vector<Track> CleanTracks(const std::vector<Track>& tracks,
                               std::vector<RemovedObservation>& removed) {
  std::vector<Track> clean;
  clean.reserve(tracks.size());
  for (const Track& track : tracks) {
    Track copy = track;
    copy.observations.clear();
    std::set<FrameId> seen;
    for (const Observation& observation : track.observations) {
      if (!observation.bearing.allFinite() || std::abs(observation.bearing.norm() - 1.0) > 1e-3) {
        removed.push_back({track.id, observation.frame, RemovalReason::kNotFinite});
      } else if (!seen.insert(observation.frame).second) {
        removed.push_back({track.id, observation.frame, RemovalReason::kDuplicate});
      } else {
        copy.observations.push_back(observation);
      }
    }
    std::sort(copy.observations.begin(),
              copy.observations.end(),
              [](const Observation& a, const Observation& b) { return a.frame < b.frame; });
    clean.push_back(std::move(copy));
  }
  return clean;
}

TriangulatedTracks TriangulateAll(const KrotProblem& problem,
                                  const CenterMap& centers,
                                  const std::vector<double>& thresholds) {
  const std::vector<Track>& tracks = problem.tracks;
  const KrotUnits& units = problem.units;
  TriangulatedTracks points(tracks.size());
  ParallelFor(static_cast<int>(tracks.size()), problem.options.num_threads, [&](int t) {
    std::vector<int> observations;
    const std::vector<PosedRay> rays =
        PosedRays(problem.cam_from_world, centers, tracks[t], units.focal_px, &observations);
    const auto robust = TriangulateRobustly(
        rays, units.point_angle_rad, problem.options.loose_factor * thresholds[t]);
    if (!robust) return;
    TriangulatedTrack point{robust->point_in_world, {}};
    std::size_t next = 0;
    for (int k = 0; k < static_cast<int>(rays.size()); ++k) {
      if (next < robust->inliers.size() && robust->inliers[next] == k) {
        ++next;
      } else {
        point.outliers.push_back(tracks[t].observations[observations[k]].frame);
      }
    }
    points[t] = std::move(point);
  });
  return points;
}

}  // namespace rotslam
