#include "krot/known_rotation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "krot/components.h"
#include "krot/epipolar_filter.h"
#include "krot/growth.h"
#include "krot/minimax_problem.h"
#include "krot/robust_triangulation.h"
#include "krot/selection.h"
#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Options in the units the stages use.
struct Units {
  double focal_px;
  double gamma;            // threshold_px, normalised
  double still_rad;        // still_parallax_px
  double lp_parallax_rad;  // min_lp_parallax_deg
  double point_angle_rad;  // min_point_angle_deg
  double loose_rad;        // loose_factor * threshold_px
};

Units InUnits(const KrotOptions& options, const Camera& camera) {
  const double focal_px = camera.MeanFocal();
  return {focal_px,
          options.threshold_px / focal_px,
          options.still_parallax_px / focal_px,
          options.min_lp_parallax_deg * kRadFromDeg,
          options.min_point_angle_deg * kRadFromDeg,
          options.loose_factor * options.threshold_px / focal_px};
}

// The linear programs have one bound for all: that of the median track.
double MedianOf(std::vector<double> values, double if_none) {
  if (values.empty()) return if_none;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Units WithThreshold(Units units, double gamma, const KrotOptions& options) {
  units.gamma = gamma;
  units.loose_rad = options.loose_factor * gamma;
  return units;
}

// Largest image error of a right observation, normalised, by track position: threshold_px, or more
// where the orientations ask for it.
std::vector<double> TrackThresholds(const std::vector<Track>& tracks,
                                    const std::map<FrameId, double>& sigma_rad,
                                    const KrotOptions& options,
                                    const Units& units) {
  std::vector<double> thresholds;
  thresholds.reserve(tracks.size());
  for (const Track& track : tracks) {
    double least = kInfinity;
    double most = 0.0;
    double keypoint = 0.0;
    for (const Observation& observation : track.observations) {
      keypoint = std::max(keypoint, observation.sigma_px / units.focal_px);
      const auto sigma = sigma_rad.find(observation.frame);
      if (sigma == sigma_rad.end()) continue;
      least = std::min(least, sigma->second * sigma->second);
      most = std::max(most, sigma->second * sigma->second);
    }
    const double turn = std::max(0.0, most - least);
    // Keypoints alone are in threshold_px already, whatever their sigma is called.
    const double grown =
        turn > 0.0 ? options.threshold_sigmas * std::sqrt(keypoint * keypoint + turn) : 0.0;
    thresholds.push_back(std::max(units.gamma, grown));
  }
  return thresholds;
}

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

// Tracks without unusable observations, frames ascending; same order as the input, short ones kept.
std::vector<Track> CleanTracks(const std::vector<Track>& tracks, KrotSolution& solution) {
  std::vector<Track> clean;
  clean.reserve(tracks.size());
  for (const Track& track : tracks) {
    Track copy = track;
    copy.observations.clear();
    std::set<FrameId> seen;
    for (const Observation& observation : track.observations) {
      if (!observation.bearing.allFinite() || std::abs(observation.bearing.norm() - 1.0) > 1e-3) {
        solution.removed.push_back({track.id, observation.frame, RemovalReason::kNotFinite});
      } else if (!seen.insert(observation.frame).second) {
        solution.removed.push_back({track.id, observation.frame, RemovalReason::kDuplicate});
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

void RemoveEpipolarOutliers(const RotationMap& cam_from_world,
                            const KrotOptions& options,
                            const Units& units,
                            std::vector<Track>& tracks,
                            KrotSolution& solution) {
  EpipolarFilterOptions filter;
  filter.threshold_rad = units.gamma;
  filter.seed = options.seed;
  std::vector<ObservationIndex> outliers = FindEpipolarOutliers(cam_from_world, tracks, filter);
  // From the back, so that positions in front stay right.
  std::sort(outliers.rbegin(), outliers.rend());
  for (const ObservationIndex& index : outliers) {
    auto& observations = tracks[index.track].observations;
    solution.removed.push_back(
        {tracks[index.track].id, observations[index.observation].frame, RemovalReason::kEpipolar});
    observations.erase(observations.begin() + index.observation);
  }
}

// Tracks cut to the observations that fulfil `keep`; those left with fewer than two are dropped.
template <class Keep>
std::vector<Track> Restricted(const std::vector<Track>& tracks, const Keep& keep) {
  std::vector<Track> result;
  for (const Track& track : tracks) {
    Track part;
    part.id = track.id;
    for (const Observation& observation : track.observations) {
      if (keep(observation)) part.observations.push_back(observation);
    }
    if (part.observations.size() >= 2) result.push_back(std::move(part));
  }
  return result;
}

// A MinimaxProblem with the names of its views and points.
struct NamedProblem {
  MinimaxProblem problem;
  std::vector<FrameId> views;
  std::vector<int> tracks;  // positions in the list it was made of
};

NamedProblem MakeProblem(const RotationMap& cam_from_world,
                         const std::vector<Track>& tracks,
                         const std::vector<int>& selection) {
  NamedProblem named;
  std::map<FrameId, int> view_of;
  for (const int t : selection) {
    for (const Observation& observation : tracks[t].observations) view_of[observation.frame] = 0;
  }
  for (auto& [frame, view] : view_of) {
    view = named.problem.num_views();
    named.views.push_back(frame);
    named.problem.R_c_w.push_back(cam_from_world.at(frame).Matrix());
  }
  for (const int t : selection) {
    for (const Observation& observation : tracks[t].observations) {
      named.problem.observations.push_back(
          {view_of.at(observation.frame),
           named.problem.num_points,
           observation.bearing.head<2>() / observation.bearing.z()});
    }
    ++named.problem.num_points;
    named.tracks.push_back(t);
  }
  return named;
}

// The observations of `problem` with residual at most `limit`, without points then seen once, and
// the structure cut alike. Every view stays, so the gauge does.
std::pair<MinimaxProblem, MinimaxStructure> Survivors(const MinimaxProblem& problem,
                                                      const RobustStart& start,
                                                      double limit) {
  std::vector<int> count(problem.num_points, 0);
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    if (start.residuals[o] <= limit) ++count[problem.observations[o].point];
  }
  MinimaxProblem survivors;
  survivors.R_c_w = problem.R_c_w;
  MinimaxStructure structure;
  structure.center_in_world = start.structure.center_in_world;
  std::vector<int> new_point(problem.num_points, -1);
  for (int i = 0; i < problem.num_points; ++i) {
    if (count[i] < 2) continue;
    new_point[i] = survivors.num_points++;
    structure.point_in_world.push_back(start.structure.point_in_world[i]);
  }
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    ImageObservation observation = problem.observations[o];
    if (start.residuals[o] > limit || new_point[observation.point] < 0) continue;
    observation.point = new_point[observation.point];
    survivors.observations.push_back(observation);
  }
  return {std::move(survivors), std::move(structure)};
}

// What one component's linear programs gave.
struct ComponentStart {
  bool solved = false;
  bool bracket_converged = false;
  CenterMap centers;
};

ComponentStart SolvePrograms(const RotationMap& cam_from_world,
                             const std::vector<Track>& lp_tracks,
                             const KrotOptions& options,
                             const Units& units,
                             KrotSolution& solution) {
  SelectionOptions selection;
  selection.observations_per_view = options.observations_per_view;
  selection.min_parallax_rad = units.lp_parallax_rad;
  const NamedProblem named =
      MakeProblem(cam_from_world, lp_tracks, SelectTracks(cam_from_world, lp_tracks, selection));
  ComponentStart result;
  if (named.problem.num_views() < 2) return result;
  const RobustStart start = SolveRobustStart(named.problem, units.gamma, options.robust_start);
  solution.num_programs += start.num_programs;
  if (start.call != LpCallStatus::kCompleted) return result;
  auto [survivors, structure] = Survivors(named.problem, start, 1.001 * units.gamma);
  if (survivors.observations.empty()) return result;

  double low = 0.0;
  double high = MaxBoxResidual(survivors, structure);
  if (options.use_bracket && named.problem.num_views() <= options.max_bracket_views) {
    BisectionResult bracket = MinimiseMaxResidual(survivors, options.bisection, &structure);
    solution.num_programs += bracket.num_programs;
    low = bracket.gamma_low;
    high = bracket.gamma_high;
    result.bracket_converged = bracket.status == BisectionStatus::kConverged;
    if (options.start == "bisection") structure = std::move(bracket.structure);
  }
  solution.gamma_low = std::max(solution.gamma_low, low);
  solution.gamma_high =
      solution.gamma_high == kInfinity ? high : std::max(solution.gamma_high, high);
  solution.num_bracket_observations += static_cast<int>(survivors.observations.size());
  solution.num_bracket_tracks += survivors.num_points;
  if (options.start == "linear") {
    auto linear = SolveLinearStart(survivors, options.linear_start);
    if (!linear) return result;
    structure = *std::move(linear);
  }
  for (int view = 0; view < named.problem.num_views(); ++view) {
    result.centers[named.views[view]] = structure.center_in_world[view];
  }
  result.solved = true;
  return result;
}

// Points of all tracks from a component's centres, by track position; what disagrees is reported.
struct TrackPoint {
  Eigen::Vector3d point_in_world;
  std::vector<FrameId> outliers;
};

std::vector<std::optional<TrackPoint>> TriangulateAll(const RotationMap& cam_from_world,
                                                      const CenterMap& centers,
                                                      const std::vector<Track>& tracks,
                                                      const std::vector<double>& thresholds,
                                                      const KrotOptions& options,
                                                      const Units& units) {
  std::vector<std::optional<TrackPoint>> points(tracks.size());
  ParallelFor(static_cast<int>(tracks.size()), options.num_threads, [&](int t) {
    std::vector<int> observations;
    const std::vector<Sighting> sightings =
        PlacedSightings(cam_from_world, centers, tracks[t], units.focal_px, &observations);
    const auto robust =
        TriangulateRobustly(sightings, units.point_angle_rad, options.loose_factor * thresholds[t]);
    if (!robust) return;
    TrackPoint point{robust->point_in_world, {}};
    std::size_t next = 0;
    for (int k = 0; k < static_cast<int>(sightings.size()); ++k) {
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

// Moves a component to its gauge: first centre at the origin, median depth one.
void Normalise(CenterMap& centers,
               const std::vector<Track>& tracks,
               std::vector<std::optional<TrackPoint>>& points) {
  std::vector<double> depths;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    if (!points[t]) continue;
    for (const Observation& observation : tracks[t].observations) {
      const auto center = centers.find(observation.frame);
      if (center != centers.end()) {
        depths.push_back((points[t]->point_in_world - center->second).norm());
      }
    }
  }
  double scale = 1.0;
  if (!depths.empty()) {
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
    std::nth_element(depths.begin(), middle, depths.end());
    if (*middle > 0.0 && std::isfinite(*middle)) scale = 1.0 / *middle;
  }
  const Eigen::Vector3d origin = centers.begin()->second;
  for (auto& [frame, center] : centers) center = scale * (center - origin);
  for (auto& point : points) {
    if (point) point->point_in_world = scale * (point->point_in_world - origin);
  }
}

// Solves one component and enters it into the solution under its number. Returns whether its
// bracket converged; nullopt when its programs failed.
std::optional<bool> SolveComponent(const RotationMap& cam_from_world,
                                   const std::vector<Track>& tracks,
                                   const std::vector<double>& thresholds,
                                   const ViewComponent& component,
                                   const KrotOptions& options,
                                   const Units& units,
                                   KrotSolution& solution) {
  const std::set<FrameId> members(component.views.begin(), component.views.end());
  const std::size_t num_lp_views =
      std::min(component.views.size(), static_cast<std::size_t>(options.max_lp_views));
  const std::set<FrameId> lp_views(
      component.views.begin(), component.views.begin() + static_cast<std::ptrdiff_t>(num_lp_views));
  const double min_z = std::cos(options.max_off_axis_deg * kRadFromDeg);
  const auto lp_tracks = Restricted(tracks, [&](const Observation& observation) {
    return lp_views.contains(observation.frame) && observation.bearing.z() >= min_z;
  });
  ComponentStart start = SolvePrograms(cam_from_world, lp_tracks, options, units, solution);
  if (!start.solved) return std::nullopt;

  GrowthOptions growth;
  growth.resection.threshold_rad = units.loose_rad;
  growth.resection.seed = options.seed;
  growth.min_angle_rad = units.lp_parallax_rad;
  growth.threshold_rad = units.loose_rad;
  const std::size_t before = start.centers.size();
  if (before < members.size()) {
    const auto member_tracks = Restricted(tracks, [&](const Observation& observation) {
      return members.contains(observation.frame);
    });
    PlaceViews(cam_from_world, member_tracks, component.views, growth, start.centers);
  }
  solution.num_grown_views += static_cast<int>(start.centers.size() - before);

  auto points = TriangulateAll(cam_from_world, start.centers, tracks, thresholds, options, units);
  Normalise(start.centers, tracks, points);
  const int number =
      solution.component.empty()
          ? 0
          : 1 + std::max_element(solution.component.begin(),
                                 solution.component.end(),
                                 [](const auto& a, const auto& b) { return a.second < b.second; })
                    ->second;
  for (const auto& [frame, center] : start.centers) {
    solution.center_in_world[frame] = center;
    solution.component[frame] = number;
  }
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    // A track seen by two components has its point in the larger one.
    if (!points[t] || solution.point_in_world.contains(tracks[t].id)) continue;
    solution.point_in_world[tracks[t].id] = points[t]->point_in_world;
    for (const FrameId frame : points[t]->outliers) {
      solution.removed.push_back({tracks[t].id, frame, RemovalReason::kReprojection});
    }
    for (const Observation& observation : tracks[t].observations) {
      if (members.contains(observation.frame)) continue;
      solution.removed.push_back({tracks[t].id, observation.frame, RemovalReason::kOtherComponent});
    }
  }
  return start.bracket_converged;
}

void Describe(int num_views, int num_failed, const Units& units, KrotSolution& solution) {
  const int num_placed = static_cast<int>(solution.center_in_world.size());
  int num_components = 0;
  for (const auto& [frame, number] : solution.component) {
    num_components = std::max(num_components, number + 1);
  }
  const auto px = [&](double gamma) {
    const std::string text = std::to_string(gamma * units.focal_px);
    return text.substr(0, text.find('.') + 4);
  };
  solution.message =
      std::to_string(num_placed) + " of " + std::to_string(num_views) + " views placed in " +
      std::to_string(num_components) + " component" + (num_components == 1 ? "" : "s") + ", " +
      std::to_string(solution.point_in_world.size()) + " points, largest residual in [" +
      px(solution.gamma_low) + ", " + px(solution.gamma_high) + "] px over " +
      std::to_string(solution.num_bracket_observations) + " observations";
  if (num_failed > 0) {
    solution.message += "; " + std::to_string(num_failed) + " components gave no positions";
  }
}

void Solve(const RotationMap& cam_from_world,
           const std::vector<Track>& input,
           const std::map<FrameId, double>& sigma_rad,
           const KrotOptions& options,
           Units units,
           KrotSolution& solution) {
  std::vector<Track> tracks = CleanTracks(input, solution);
  const std::vector<double> thresholds = TrackThresholds(tracks, sigma_rad, options, units);
  units = WithThreshold(units, MedianOf(thresholds, units.gamma), options);
  std::set<FrameId> views;
  int num_usable = 0;
  int num_moving = 0;
  if (options.use_epipolar_filter) {
    RemoveEpipolarOutliers(cam_from_world, options, units, tracks, solution);
  }
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) views.insert(observation.frame);
    if (track.observations.size() < 2) continue;
    ++num_usable;
    num_moving += TrackParallax(cam_from_world, track) >= units.still_rad;
  }
  solution.status = KrotStatus::kInfeasible;
  if (num_usable == 0) {
    solution.message = "no track has two usable observations";
    return;
  }
  if (num_moving < options.min_shared_points) {
    solution.message = "no parallax: " + std::to_string(num_moving) + " of " +
                       std::to_string(num_usable) + " tracks move beyond what rotation explains";
    return;
  }
  ComponentOptions component_options;
  component_options.min_shared_points = options.min_shared_points;
  component_options.min_parallax_rad = units.still_rad;
  const auto components = FindComponents(cam_from_world, tracks, component_options);
  if (components.empty()) {
    solution.message =
        "no two views share " + std::to_string(options.min_shared_points) + " tracks with parallax";
    return;
  }
  int num_failed = 0;
  bool all_converged = true;
  for (const ViewComponent& component : components) {
    const auto converged =
        SolveComponent(cam_from_world, tracks, thresholds, component, options, units, solution);
    if (!converged) ++num_failed;
    all_converged = all_converged && converged.value_or(false);
  }
  if (solution.center_in_world.empty()) {
    solution.status = KrotStatus::kSolverFailed;
    solution.message = "the linear programs gave no structure";
    return;
  }
  solution.status = all_converged ? KrotStatus::kConverged : KrotStatus::kIterationLimit;
  Describe(static_cast<int>(views.size()), num_failed, units, solution);
}

}  // namespace

std::optional<std::string> KrotOptions::Problem() const {
  if (start != "l1" && start != "bisection" && start != "linear") {
    return "start is '" + start + "', must be l1, bisection or linear";
  }
  if (start == "bisection" && !use_bracket) {
    return "start is 'bisection', which needs use_bracket";
  }
  if (!(threshold_px > 0.0)) return OutOfRange("threshold_px", threshold_px, "above 0");
  if (!(threshold_sigmas >= 0.0)) {
    return OutOfRange("threshold_sigmas", threshold_sigmas, "at least 0");
  }
  if (!(loose_factor >= 1.0)) return OutOfRange("loose_factor", loose_factor, "at least 1");
  if (max_lp_views < 2) return OutOfRange("max_lp_views", max_lp_views, "at least 2");
  if (max_bracket_views < 0)
    return OutOfRange("max_bracket_views", max_bracket_views, "at least 0");
  if (observations_per_view < 4) {
    return OutOfRange("observations_per_view", observations_per_view, "at least 4");
  }
  if (!(min_lp_parallax_deg >= 0.0)) {
    return OutOfRange("min_lp_parallax_deg", min_lp_parallax_deg, "at least 0");
  }
  if (!(min_point_angle_deg >= 0.0)) {
    return OutOfRange("min_point_angle_deg", min_point_angle_deg, "at least 0");
  }
  if (!(still_parallax_px >= 0.0)) {
    return OutOfRange("still_parallax_px", still_parallax_px, "at least 0");
  }
  if (min_shared_points < 3) {
    return OutOfRange("min_shared_points", min_shared_points, "at least 3");
  }
  if (!(max_off_axis_deg > 0.0 && max_off_axis_deg < 90.0)) {
    return OutOfRange("max_off_axis_deg", max_off_axis_deg, "between 0 and 90");
  }
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "at least 1");
  if (const auto trouble = robust_start.Problem()) return "robust_start." + *trouble;
  if (const auto trouble = linear_start.Problem()) return "linear_start." + *trouble;
  if (const auto trouble = bisection.Problem()) return "bisection." + *trouble;
  return std::nullopt;
}

KrotSolution SolveKnownRotation(const RotationMap& cam_from_world,
                                const std::vector<Track>& tracks,
                                const Camera& camera,
                                const KrotOptions& options,
                                const std::map<FrameId, double>& sigma_rad) {
  const auto begin = std::chrono::steady_clock::now();
  RequireContract(cam_from_world, tracks, camera, options);
  KrotSolution solution;
  Solve(cam_from_world, tracks, sigma_rad, options, InUnits(options, camera), solution);
  std::sort(solution.removed.begin(),
            solution.removed.end(),
            [](const RemovedObservation& a, const RemovedObservation& b) {
              return std::tie(a.track, a.frame, a.reason) < std::tie(b.track, b.frame, b.reason);
            });
  solution.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return solution;
}

std::string ToString(KrotStatus status) {
  switch (status) {
    case KrotStatus::kNotRun:
      return "not_run";
    case KrotStatus::kConverged:
      return "converged";
    case KrotStatus::kIterationLimit:
      return "iteration_limit";
    case KrotStatus::kInfeasible:
      return "infeasible";
    case KrotStatus::kSolverFailed:
      return "solver_failed";
  }
  return "unknown";
}

std::string ToString(RemovalReason reason) {
  switch (reason) {
    case RemovalReason::kNotFinite:
      return "not_finite";
    case RemovalReason::kDuplicate:
      return "duplicate";
    case RemovalReason::kEpipolar:
      return "epipolar";
    case RemovalReason::kReprojection:
      return "reprojection";
    case RemovalReason::kOtherComponent:
      return "other_component";
  }
  return "unknown";
}

}  // namespace rotslam
