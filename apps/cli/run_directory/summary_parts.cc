#include "apps/cli/run_directory/summary_parts.h"

#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include "apps/cli/input/focal_guess.h"
#include "apps/cli/run_directory/map_segments.h"

namespace rotslam {
namespace {

SummaryTable SummaryOf(const ReadoutEstimate& readout) {
  return {{"source", "images"}, {"readout_s", readout.readout_s}, {"sigma_s", readout.sigma_s}};
}

template <class Container>
std::int64_t Count(const Container& container) {
  return static_cast<std::int64_t>(container.size());
}

template <class Element>
std::int64_t CountIf(const std::vector<Element>& elements, bool Element::*property) {
  return std::count_if(elements.begin(), elements.end(), std::mem_fn(property));
}

SummaryTable CountsOf(const Orientations& orientations) {
  return {{"frames", Count(orientations.timestamps_s)},
          {"unreadable_frames", std::int64_t{orientations.num_unreadable}},
          {"frames_without_edge", Count(orientations.unconnected)},
          {"frames_with_weak_edge", std::int64_t{orientations.num_weak}},
          {"frames_searched_wide", CountIf(orientations.reports, &FrameReport::searched_wide)},
          {"breaks", Count(orientations.breaks)},
          {"edges", Count(orientations.graph.edges())}};
}

SummaryTable OdometryOf(const Orientations& orientations) {
  double inliers = 0.0;
  std::int64_t rotation_only = 0;
  for (const RelativeRotation& edge : orientations.graph.edges()) {
    inliers += edge.num_inliers;
    rotation_only += edge.rotation_only;
  }
  return {
      {"mean_inliers_per_edge", inliers / static_cast<double>(orientations.graph.edges().size())},
      {"rotation_only_edges", rotation_only},
      {"exposure_s", orientations.exposure_s}};
}

SummaryTable SecondsOf(const Orientations& orientations) {
  const OdometrySeconds& seconds = orientations.seconds;
  return {{"pyramid", seconds.pyramid},
          {"tracking", seconds.tracking},
          {"detection", seconds.detection},
          {"edges", seconds.edges},
          {"averaging", seconds.averaging},
          {"covariance", seconds.covariance},
          {"loop_description", orientations.loop_seconds.description},
          {"loop_candidates", orientations.loop_seconds.candidates},
          {"loop_verification", orientations.loop_seconds.verification},
          {"global_averaging", orientations.global_averaging_seconds}};
}

// The lens as bundle adjustment has refined it, and how certain it is.
void AddLens(const BundleSummary& bundle, const Camera& camera, SummaryTable& table) {
  const bool is_fov = camera.model == CameraModel::kFov;
  table.insert(table.end(),
               {{"lens.gain", bundle.lens_gain},
                {"lens.refined", bundle.lens_refined},
                {"lens.fx", camera.fx},
                {"lens.fy", camera.fy},
                {is_fov ? "lens.w" : "lens.k1", camera.distortion[0]}});
  if (!is_fov) table.emplace_back("lens.k2", camera.distortion[1]);
  if (!bundle.lens_sigmas) return;
  const LensSigmas& sigmas = *bundle.lens_sigmas;
  table.insert(table.end(),
               {{"lens.cx", camera.cx},
                {"lens.cy", camera.cy},
                {"lens.sigma_focal_px", sigmas.focal_px},
                {"lens.sigma_cx_px", sigmas.cx_px},
                {"lens.sigma_cy_px", sigmas.cy_px},
                {is_fov ? "lens.sigma_w" : "lens.sigma_k1", sigmas.k1}});
  if (!is_fov) table.emplace_back("lens.sigma_k2", sigmas.k2);
}

// Iterations of every stage to `table`, their times to `seconds`.
void AddStages(const std::vector<BundleSummary>& bundles,
               SummaryTable& table,
               SummaryTable& seconds) {
  double bundle_seconds = 0.0;
  double solver_seconds = 0.0;
  std::map<std::string, std::int64_t> iterations_of;
  std::map<std::string, double> seconds_of;
  for (const BundleSummary& bundle : bundles) {
    bundle_seconds += bundle.seconds;
    for (const BundleRoundSummary& round : bundle.rounds) {
      iterations_of[round.name] += round.iterations;
      seconds_of[round.name] += round.seconds;
      solver_seconds += round.solver_seconds;
    }
  }
  for (const auto& [name, number] : iterations_of) {
    table.emplace_back("iterations_of." + name, number);
    seconds.emplace_back("bundle_" + name, seconds_of[name]);
  }
  seconds.emplace_back("bundle_solver", solver_seconds);
  seconds.emplace_back("bundle_adjustment", bundle_seconds);
}

}  // namespace

RunSummary StartSummary(const std::string& command,
                        const Input& input,
                        const Orientations& orientations,
                        std::vector<OptionEntry> options) {
  RunSummary summary;
  summary.command = command;
  summary.interrupted = orientations.interrupted;
  summary.options = std::move(options);
  summary.camera = input.camera;
  if (input.guess) summary.calibration = SummaryOf(*input.guess, input.camera);
  if (input.readout) summary.readout = SummaryOf(*input.readout);
  summary.sequence = {{"description", input.sequence().Describe()},
                      {"path", input.path},
                      {"camera_file", input.camera_file},
                      {"first_timestamp_s", orientations.timestamps_s.front()},
                      {"last_timestamp_s", orientations.timestamps_s.back()}};
  summary.counts = CountsOf(orientations);
  summary.rotodom = OdometryOf(orientations);
  if (orientations.given) {
    summary.sequence.emplace_back("rotations_file", orientations.given->file);
    summary.rotodom->emplace_back("given_disagreement_deg", orientations.given->disagreement_deg);
  }
  summary.seconds = SecondsOf(orientations);
  summary.loops = SummaryTable{{"places", std::int64_t{orientations.num_places}},
                               {"candidates", Count(orientations.loops)},
                               {"accepted", CountIf(orientations.loops, &LoopCheck::accepted)}};
  return summary;
}

void AddPositions(const MapResult& positions, const Camera& camera, RunSummary& summary) {
  summary.counts.insert(summary.counts.end(),
                        {{"keyframes", Count(positions.keyframes)},
                         {"map_points", Count(positions.map.point_in_world)},
                         {"points", Count(positions.cloud.point_in_world)},
                         {"shallow_points", std::int64_t{positions.num_shallow_points}},
                         {"cloud_outliers", std::int64_t{positions.num_cloud_outliers}},
                         {"components", Count(positions.components)},
                         {"relocalised_keyframes", Count(positions.relocalised)},
                         {"resected_frames", std::int64_t{positions.num_resected}},
                         {"interpolated_frames", std::int64_t{positions.num_interpolated}}});
  summary.segments = SegmentsOf(positions);
  AddKnownRotation(positions.krot, camera, summary);
  AddBundles(positions.bundles, positions.camera, summary);
}

void AddKnownRotation(const KrotSolution& solution, const Camera& camera, RunSummary& summary) {
  SummaryKrot krot;
  krot.status = ToString(solution.status);
  krot.gamma_low = solution.gamma_low;
  krot.gamma_high = solution.gamma_high;
  krot.gamma_low_px = solution.gamma_low * camera.MeanFocal();
  krot.gamma_high_px = solution.gamma_high * camera.MeanFocal();
  krot.removed = Count(solution.removed);
  krot.more = {{"message", solution.message},
               {"bracket_observations", std::int64_t{solution.num_bracket_observations}},
               {"bracket_tracks", std::int64_t{solution.num_bracket_tracks}},
               {"programs", std::int64_t{solution.num_programs}}};
  std::map<RemovalReason, std::int64_t> removed;
  for (const RemovedObservation& observation : solution.removed) ++removed[observation.reason];
  for (const auto& [reason, number] : removed) {
    krot.more.push_back({"removed_for." + ToString(reason), number});
  }
  summary.krot = krot;
  summary.seconds.push_back({"known_rotation", solution.seconds});
}

void AddBundles(const std::vector<BundleSummary>& bundles,
                const Camera& camera,
                RunSummary& summary) {
  if (bundles.empty()) return;

  // Sums over the components.
  std::int64_t observations = 0;
  std::int64_t completed = 0;
  std::int64_t dropped = 0;
  std::int64_t iterations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  for (const BundleSummary& bundle : bundles) {
    observations += bundle.num_observations;
    completed += bundle.num_completed;
    dropped += bundle.num_dropped_observations;
    iterations += bundle.iterations;
    initial_cost += bundle.initial_cost;
    final_cost += bundle.final_cost;
  }
  const BundleSummary& largest = *std::max_element(
      bundles.begin(), bundles.end(), [](const BundleSummary& a, const BundleSummary& b) {
        return a.num_observations < b.num_observations;
      });
  summary.ba = SummaryTable{{"observations", observations},
                            {"completed_observations", completed},
                            {"dropped_observations", dropped},
                            {"iterations", iterations},
                            {"initial_cost", initial_cost},
                            {"final_cost", final_cost},
                            {"mean_error_px", MeanErrorPx(bundles)},
                            {"median_error_px", largest.after.median_px},
                            {"p90_error_px", largest.after.p90_px},
                            {"has_motion_blur", largest.has_motion_blur}};
  AddLens(largest, camera, *summary.ba);
  AddStages(bundles, *summary.ba, summary.seconds);
}

}  // namespace rotslam
