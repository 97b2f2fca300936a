#include "krot/known_rotation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iomanip>
#include <set>
#include <sstream>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "krot/bracket/bisection.h"
#include "krot/component_start.h"
#include "krot/initialisation/epipolar_filter.h"
#include "krot/named_problem.h"
#include "krot/structure/components.h"
#include "krot/structure/minimax_problem.h"
#include "krot/track_points.h"
#include "rotodom/types/median.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

KrotUnits WithThreshold(KrotUnits units, double gamma, const KrotOptions& options) {
  units.gamma = gamma;
  units.loose_rad = options.loose_factor * gamma;
  return units;
}

// Where orientations are less certain than threshold_px, the bound is this many standard deviations
// of a track's keypoints and of its views' orientations together: 3 in 1,000 right ones exceed it.
constexpr double kThresholdSigmas = 3.0;

// Largest image error of a right observation, normalised, by track position: threshold_px, or more
// where the orientations ask for it.
std::vector<double> TrackThresholds(const std::vector<Track>& tracks,
                                    const std::map<FrameId, double>& sigma_rad,
                                    const KrotUnits& units) {
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
        turn > 0.0 ? kThresholdSigmas * std::sqrt(keypoint * keypoint + turn) : 0.0;
    thresholds.push_back(std::max(units.gamma, grown));
  }
  return thresholds;
}

// Takes out what contradicts the rotations pair by pair. Returns the views' noise, rad.
std::map<FrameId, double> RemoveEpipolarOutliers(const RotationMap& cam_from_world,
                                                 const KrotOptions& options,
                                                 const KrotUnits& units,
                                                 std::vector<Track>& tracks,
                                                 KrotSolution& solution) {
  EpipolarFilterOptions filter;
  filter.threshold_rad = units.gamma;
  filter.seed = options.seed;
  EpipolarVerdict verdict = TestEpipolarPlanes(cam_from_world, tracks, filter);
  // From the back, so that positions in front stay right.
  std::sort(verdict.outliers.rbegin(), verdict.outliers.rend());
  for (const ObservationIndex& index : verdict.outliers) {
    auto& observations = tracks[index.track].observations;
    solution.removed.push_back(
        {tracks[index.track].id, observations[index.observation].frame, RemovalReason::kEpipolar});
    observations.erase(observations.begin() + index.observation);
  }
  return std::move(verdict.noise_rad);
}

// What the triangulation kept, as the minimax problem and its structure.
struct KeptProblem {
  NamedProblem named;
  MinimaxStructure structure;
};

KeptProblem TakeKept(const RotationMap& cam_from_world,
                     const CenterMap& centers,
                     const std::vector<Track>& tracks,
                     const TriangulatedTracks& points,
                     double min_z) {
  KeptProblem kept;
  std::vector<Track> kept_tracks;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    if (!points[t]) continue;
    const std::vector<FrameId>& outliers = points[t]->outliers;
    Track track;
    track.id = tracks[t].id;
    for (const Observation& observation : tracks[t].observations) {
      if (!centers.contains(observation.frame) || observation.bearing.z() < min_z) continue;
      if (std::find(outliers.begin(), outliers.end(), observation.frame) != outliers.end())
        continue;
      track.observations.push_back(observation);
    }
    if (track.observations.size() < 2) continue;
    kept_tracks.push_back(std::move(track));
    kept.structure.point_in_world.push_back(points[t]->point_in_world);
  }
  kept.named = MakeProblem(cam_from_world, kept_tracks);
  for (const FrameId view : kept.named.views) {
    kept.structure.center_in_world.push_back(centers.at(view));
  }
  return kept;
}

// Where a structure's points come to lie.
struct Placing {
  double scale = 0.0;  // 0: nothing was taken
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& position) const {
    return to + scale * (position - from);
  }
};

// `centers` replaced by `better` where there are such, moved and scaled to lie on them best.
Placing TakeCenters(const std::vector<FrameId>& views,
                    const std::vector<Eigen::Vector3d>& better,
                    CenterMap& centers) {
  Eigen::Vector3d mean_from = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_to = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < views.size(); ++k) {
    mean_from += better[k] / static_cast<double>(views.size());
    mean_to += centers.at(views[k]) / static_cast<double>(views.size());
  }
  double common = 0.0;
  double squared = 0.0;
  for (std::size_t k = 0; k < views.size(); ++k) {
    common += (better[k] - mean_from).dot(centers.at(views[k]) - mean_to);
    squared += (better[k] - mean_from).squaredNorm();
  }
  if (!(common > 0.0 && squared > 0.0)) return {};
  Placing placing{common / squared, mean_from, mean_to};
  for (std::size_t k = 0; k < views.size(); ++k) centers[views[k]] = placing(better[k]);
  return placing;
}

// The points of a structure, and those of the other tracks triangulated anew. Seven parameters: the
// structure with its names and placing, the arguments of TriangulateAll, and the result.
void TakePoints(const KrotProblem& problem,
                const std::vector<double>& thresholds,
                const NamedProblem& named,
                const MinimaxStructure& structure,
                const Placing& placing,
                const CenterMap& centers,
                TriangulatedTracks& points) {
  std::map<TrackId, std::size_t> place;
  for (std::size_t k = 0; k < named.tracks.size(); ++k) place[named.tracks[k]] = k;
  TriangulatedTracks anew = TriangulateAll(problem, centers, thresholds);
  for (std::size_t t = 0; t < points.size(); ++t) {
    const auto found = place.find(problem.tracks[t].id);
    if (found == place.end()) {
      points[t] = std::move(anew[t]);
    } else {
      points[t]->point_in_world = placing(structure.point_in_world[found->second]);
    }
  }
}

// Enters what a component's observations say about the least possible largest residual; the best
// structure's centres and points become the component's where they are asked for. Returns how the
// search ended.
BisectionStatus BoundResidual(const KrotProblem& problem,
                              const std::vector<double>& thresholds,
                              CenterMap& centers,
                              TriangulatedTracks& points,
                              KrotSolution& solution) {
  const auto& [cam_from_world, tracks, options, units] = problem;
  const KeptProblem kept = TakeKept(cam_from_world, centers, tracks, points, units.min_z);
  const MinimaxProblem& minimax = kept.named.problem;
  BisectionResult bracket;
  bracket.status = BisectionStatus::kIterationLimit;
  bracket.gamma_high = MaxBoxResidual(minimax, kept.structure);
  const bool decides = options.start == KrotStart::kBisection;
  if (options.use_bracket && (decides || minimax.num_views() <= options.max_bracket_views)) {
    bracket = MinimiseMaxResidual(minimax, options.bisection, &kept.structure);
    if (decides && bracket.gamma_high < kInfinity) {
      const Placing placing =
          TakeCenters(kept.named.views, bracket.structure.center_in_world, centers);
      if (placing.scale > 0.0) {
        TakePoints(problem, thresholds, kept.named, bracket.structure, placing, centers, points);
      }
    }
  }
  if (solution.gamma_high == kInfinity || bracket.gamma_high > solution.gamma_high) {
    solution.gamma_high = bracket.gamma_high;
    solution.active.clear();
    for (const int o : bracket.active) {
      const ImageObservation& observation = minimax.observations[o];
      solution.active.push_back(
          {kept.named.tracks[observation.point], kept.named.views[observation.view]});
    }
  }
  solution.gamma_low = std::max(solution.gamma_low, bracket.gamma_low);
  solution.num_programs += bracket.num_programs;
  solution.num_bracket_observations += static_cast<int>(minimax.observations.size());
  solution.num_bracket_tracks += minimax.num_points;
  return bracket.status;
}

// Moves a component to its gauge: first centre at the origin, median depth one.
void Normalise(CenterMap& centers, const std::vector<Track>& tracks, TriangulatedTracks& points) {
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
  const double median = Median(std::move(depths));
  const double scale = median > 0.0 && std::isfinite(median) ? 1.0 / median : 1.0;
  const Eigen::Vector3d origin = centers.begin()->second;
  for (auto& [frame, center] : centers) center = scale * (center - origin);
  for (auto& point : points) {
    if (point) point->point_in_world = scale * (point->point_in_world - origin);
  }
}

// Enters the positions and points of one more component into the solution.
void EnterComponent(const std::vector<Track>& tracks,
                    const CenterMap& centers,
                    const TriangulatedTracks& points,
                    const std::set<FrameId>& members,
                    KrotSolution& solution) {
  int number = 0;
  for (const auto& [frame, other] : solution.component) number = std::max(number, other + 1);
  for (const auto& [frame, center] : centers) {
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
}

// Solves one component and enters it into the solution. Returns how the search for its bracket
// ended; nullopt when its programs failed.
std::optional<BisectionStatus> SolveComponent(const KrotProblem& problem,
                                              const std::vector<double>& thresholds,
                                              const ViewComponent& component,
                                              const ComponentOptions& component_options,
                                              KrotSolution& solution) {
  std::optional<ComponentStart> start = StartComponent(problem, component, component_options);
  if (!start) return std::nullopt;
  CenterMap& centers = start->centers;
  solution.num_programs += start->num_programs;
  solution.num_grown_views += start->num_grown_views;
  TriangulatedTracks points = TriangulateAll(problem, centers, thresholds);
  const BisectionStatus bracket = BoundResidual(problem, thresholds, centers, points, solution);
  Normalise(centers, problem.tracks, points);
  const std::set<FrameId> members(component.views.begin(), component.views.end());
  EnterComponent(problem.tracks, centers, points, members, solution);
  return bracket;
}

// What hangs together among the component's views that got no position. A few chance matches can
// have tied two places into one component: the one behind the bridge stands for itself then.
std::vector<ViewComponent> LeftBehind(const KrotProblem& problem,
                                      const ViewComponent& component,
                                      const ComponentOptions& options,
                                      const KrotSolution& solution) {
  // Fewer are views of the same place that their own matches leave open.
  constexpr std::size_t kMinViews = 10;
  std::set<FrameId> left;
  for (const FrameId view : component.views) {
    if (!solution.center_in_world.contains(view)) left.insert(view);
  }
  if (left.size() < kMinViews) return {};
  const auto their_tracks = RestrictTracks(problem.tracks, left, 2);
  std::vector<ViewComponent> parts = FindComponents(problem.cam_from_world, their_tracks, options);
  std::erase_if(parts, [](const ViewComponent& part) { return part.views.size() < kMinViews; });
  return parts;
}

void Describe(const KrotProblem& problem, int num_failed, KrotSolution& solution) {
  std::set<FrameId> views;
  for (const Track& track : problem.tracks) {
    for (const Observation& observation : track.observations) views.insert(observation.frame);
  }
  const int num_placed = static_cast<int>(solution.center_in_world.size());
  int num_components = 0;
  for (const auto& [frame, number] : solution.component) {
    num_components = std::max(num_components, number + 1);
  }
  // Outwards, so that what is printed is a bracket, too.
  const auto px = [&](double gamma, double (*round)(double)) {
    std::ostringstream text;
    text << std::fixed << std::setprecision(3) << round(1e3 * gamma * problem.units.focal_px) / 1e3;
    return text.str();
  };
  const auto floor = [](double value) { return std::floor(value); };
  const auto ceil = [](double value) { return std::ceil(value); };
  solution.message =
      std::to_string(num_placed) + " of " + std::to_string(views.size()) + " views placed in " +
      std::to_string(num_components) + " component" + (num_components == 1 ? "" : "s") + ", " +
      std::to_string(solution.point_in_world.size()) + " points, largest residual in [" +
      px(solution.gamma_low, floor) + ", " + px(solution.gamma_high, ceil) + "] px over " +
      std::to_string(solution.num_bracket_observations) + " observations";
  if (num_failed > 0) {
    solution.message += "; " + std::to_string(num_failed) + " components gave no positions";
  }
}

// Why the tracks say nothing of positions; nullopt where they do.
std::optional<std::string> LacksParallax(const KrotProblem& problem) {
  int num_usable = 0;
  int num_moving = 0;
  for (const Track& track : problem.tracks) {
    if (track.observations.size() < 2) continue;
    ++num_usable;
    num_moving += TrackParallax(problem.cam_from_world, track) >= problem.units.still_rad;
  }
  if (num_usable == 0) return "no track has two usable observations";
  if (num_moving >= kMinSharedPoints) return std::nullopt;
  return "no parallax: " + std::to_string(num_moving) + " of " + std::to_string(num_usable) +
         " tracks move beyond what rotation explains";
}

// Where the rotations are those of other axes or inverted, positions are found that a small part of
// the observations allows.
void FindContradiction(const KrotProblem& problem,
                       const std::vector<Track>& tracks,
                       KrotSolution& solution) {
  constexpr double kMaxContradictingShare = 0.5;
  // Tracks with less parallax than this many times what a point needs may have none.
  constexpr double kClearParallax = 2.0;
  if (!solution.Usable()) return;
  std::set<std::pair<TrackId, FrameId>> removed;
  for (const RemovedObservation& one : solution.removed) removed.insert({one.track, one.frame});
  std::size_t num_all = 0;
  std::size_t num_contradicting = 0;
  for (const Track& track : RestrictTracks(
           tracks,
           [&](const Observation& observation) {
             return solution.center_in_world.contains(observation.frame) &&
                    observation.bearing.allFinite();
           },
           2)) {
    if (TrackParallax(problem.cam_from_world, track) <
        kClearParallax * problem.units.point_angle_rad) {
      continue;
    }
    const bool has_point = solution.point_in_world.contains(track.id);
    for (const Observation& observation : track.observations) {
      ++num_all;
      num_contradicting += !has_point || removed.contains({track.id, observation.frame}) ? 1 : 0;
    }
  }
  if (static_cast<double>(num_contradicting) <=
      kMaxContradictingShare * static_cast<double>(num_all)) {
    return;
  }
  solution.status = KrotStatus::kContradiction;
  solution.message += "; " + std::to_string(num_contradicting) + " of " + std::to_string(num_all) +
                      " observations with parallax contradict the rotations";
}

// Solves the components one after the other, and those that come apart from them.
void SolveComponents(const KrotProblem& problem,
                     const std::vector<double>& thresholds,
                     const ComponentOptions& component_options,
                     std::vector<ViewComponent> components,
                     KrotSolution& solution) {
  int num_failed = 0;
  bool all_converged = true;
  bool cancelled = false;
  for (std::size_t k = 0; k < components.size(); ++k) {
    const ViewComponent component = components[k];
    const auto bracket =
        SolveComponent(problem, thresholds, component, component_options, solution);
    all_converged = all_converged && bracket == BisectionStatus::kConverged;
    cancelled = cancelled || bracket == BisectionStatus::kCancelled;
    if (!bracket) {
      ++num_failed;
      continue;
    }
    const auto left = LeftBehind(problem, component, component_options, solution);
    components.insert(components.end(), left.begin(), left.end());
  }
  if (solution.center_in_world.empty()) {
    solution.status = KrotStatus::kSolverFailed;
    solution.message = "the linear programs gave no structure";
    return;
  }
  solution.status = cancelled       ? KrotStatus::kCancelled
                    : all_converged ? KrotStatus::kConverged
                                    : KrotStatus::kIterationLimit;
  Describe(problem, num_failed, solution);
}

void Solve(const KrotProblem& problem,
           const std::vector<double>& thresholds,
           const ComponentOptions& component_options,
           KrotSolution& solution) {
  solution.status = KrotStatus::kInfeasible;
  if (auto reason = LacksParallax(problem)) {
    solution.message = *std::move(reason);
    return;
  }
  std::vector<ViewComponent> components =
      FindComponents(problem.cam_from_world, problem.tracks, component_options);
  if (components.empty()) {
    solution.message =
        "no two views share " + std::to_string(kMinSharedPoints) + " tracks with parallax";
    return;
  }
  SolveComponents(problem, thresholds, component_options, std::move(components), solution);
}

}  // namespace

KrotSolution SolveKnownRotation(const RotationMap& cam_from_world,
                                const std::vector<Track>& input,
                                const Camera& camera,
                                const KrotOptions& options,
                                const std::map<FrameId, double>& sigma_rad) {
  const auto begin = std::chrono::steady_clock::now();
  RequireContract(cam_from_world, input, camera, options);
  KrotSolution solution;
  KrotUnits units(options, camera);
  std::vector<Track> tracks = CleanTracks(input, solution.removed);
  const std::vector<double> thresholds = TrackThresholds(tracks, sigma_rad, units);
  // The linear programs have one bound for all: that of the median track.
  units = WithThreshold(units, Median(thresholds, units.gamma), options);
  ComponentOptions component_options;
  component_options.min_parallax_rad = units.still_rad;
  if (options.use_epipolar_filter) {
    component_options.noise_rad =
        RemoveEpipolarOutliers(cam_from_world, options, units, tracks, solution);
  }
  const KrotProblem problem{cam_from_world, tracks, options, units};
  Solve(problem, thresholds, component_options, solution);
  FindContradiction(problem, input, solution);
  std::sort(solution.removed.begin(),
            solution.removed.end(),
            [](const RemovedObservation& a, const RemovedObservation& b) {
              return std::tie(a.track, a.frame, a.reason) < std::tie(b.track, b.frame, b.reason);
            });
  solution.seconds = SecondsSince(begin);
  return solution;
}

}  // namespace rotslam
