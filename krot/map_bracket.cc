#include "krot/map_bracket.h"

#include <algorithm>
#include <chrono>
#include <vector>

#include "krot/bracket/bisection.h"
#include "krot/named_problem.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// The tracks that have a point, as far as the programs can use them.
std::vector<Track> UsableTracksOf(const Reconstruction& map, double min_z) {
  std::vector<Track> tracks = RestrictTracks(
      map.tracks,
      [&](const Observation& observation) { return observation.bearing.z() >= min_z; },
      2);
  std::erase_if(tracks, [&](const Track& track) { return !map.point_in_world.contains(track.id); });
  return tracks;
}

}  // namespace

MapBracket BracketMap(const Reconstruction& map, const Camera& camera, const KrotOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const NamedProblem named =
      MakeProblem(map.cam_from_world, UsableTracksOf(map, KrotUnits(options, camera).min_z));
  const MinimaxProblem& problem = named.problem;
  MinimaxStructure start;
  for (const FrameId view : named.views) {
    start.center_in_world.push_back(map.center_in_world.at(view));
  }
  for (const TrackId track : named.tracks) {
    start.point_in_world.push_back(map.point_in_world.at(track));
  }
  MapBracket bracket;
  bracket.num_observations = static_cast<int>(problem.observations.size());
  bracket.num_tracks = problem.num_points;
  bracket.largest_residual = bracket.gamma_high = MaxBoxResidual(problem, start);
  if (options.use_bracket && problem.num_views() >= 2 &&
      problem.num_views() <= options.max_bracket_views) {
    BisectionOptions bisection = options.bisection;
    bisection.relative_gap = std::max(bisection.relative_gap, kMapBracketGap);
    const BisectionResult found = MinimiseMaxResidual(problem, bisection, &start);
    bracket.status = found.status;
    bracket.gamma_low = found.gamma_low;
    bracket.gamma_high = std::min(bracket.gamma_high, found.gamma_high);
    bracket.num_programs = found.num_programs;
  }
  bracket.seconds = SecondsSince(begin);
  return bracket;
}

}  // namespace rotslam
