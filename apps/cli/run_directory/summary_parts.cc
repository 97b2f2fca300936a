#include "apps/cli/run_directory/summary_parts.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "apps/cli/input/lens_guess.h"
#include "apps/cli/run_directory/map_segments.h"
#include "apps/slam/connected_frames.h"
#include "apps/slam/zoom/follow_zooms.h"
#include "output/tables/lens_curve.h"
#include "output/tables/poses_csv.h"

namespace rotslam {
namespace {

SummaryTable SummaryOf(const ReadoutEstimate& readout) {
  return {{"source", "images"}, {"readout_s", readout.readout_s}, {"sigma_s", readout.sigma_s}};
}

const char* NameOf(StaticContentKind kind) {
  switch (kind) {
    case StaticContentKind::kNone:
      return "none";
    case StaticContentKind::kOnPicture:
      return "on_picture";
    case StaticContentKind::kStanding:
      return "standing_camera";
    case StaticContentKind::kUndecided:
      return "undecided";
  }
  return "";
}

std::optional<SummaryTable> MasksOf(const Orientations& orientations) {
  const StaticContent& found = orientations.static_content;
  const FrameMasks& masks = orientations.masks;
  if (masks.IsEmpty() && found.kind == StaticContentKind::kNone) return std::nullopt;
  SummaryTable table = {{"share", masks.common().Share()},
                        {"static_content", std::string(NameOf(found.kind))},
                        {"static_share", found.mask.Share()}};
  if (!masks.common().IsEmpty()) table.emplace_back("file", std::string("mask.png"));
  if (!masks.folder().empty()) {
    table.emplace_back("folder", std::filesystem::absolute(masks.folder()).string());
  }
  return table;
}

// What the images say against the calibration; nullopt: nothing.
std::optional<SummaryTable> LensChecksOf(const Orientations& orientations) {
  const std::vector<Zoom>& zooms = orientations.zooms;
  if (zooms.empty() && !orientations.fisheye.IsFisheye()) return std::nullopt;
  SummaryTable table = {{"is_fisheye", orientations.fisheye.IsFisheye()},
                        {"zooms", static_cast<std::int64_t>(zooms.size())}};
  if (!zooms.empty()) {
    table.emplace_back("zooms_followed",
                       std::all_of(zooms.begin(), zooms.end(), [&](const Zoom& zoom) {
                         return IsFollowed(zoom, orientations.focal_scales);
                       }));
  }
  if (!zooms.empty()) {
    double factor = 1.0;
    for (const Zoom& zoom : zooms) factor *= zoom.factor;
    table.insert(table.end(),
                 {{"zoom.first_frame", std::int64_t{zooms.front().first.value}},
                  {"zoom.last_frame", std::int64_t{zooms.back().last.value}},
                  {"zoom.factor", factor}});
  }
  return table;
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
          {"weak_ties", Count(FindWeakTies(orientations))},
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
void AddLens(const BundleSummary& bundle, const MapResult& positions, SummaryTable& table) {
  const Camera& camera = positions.camera;
  const LensSigmas& sigmas = positions.lens_sigmas;
  table.insert(table.end(),
               {{"lens.gain", bundle.lens_gain},
                {"lens.refined", bundle.lens_refined},
                {"lens.tangential_gain", bundle.tangential_gain},
                {"lens.model", Name(camera.model)},
                {"lens.fx", camera.fx},
                {"lens.fy", camera.fy},
                {"lens.cx", camera.cx},
                {"lens.cy", camera.cy}});
  const auto names = DistortionNames(camera.model);
  for (std::size_t k = 0; k < names.size(); ++k) {
    table.emplace_back(std::string("lens.") + names[k], camera.distortion[k]);
  }
  table.insert(table.end(),
               {{"lens.sigma_focal_px", sigmas.focal_px},
                {"lens.sigma_cx_px", sigmas.cx_px},
                {"lens.sigma_cy_px", sigmas.cy_px}});
  for (std::size_t k = 0; k < std::min(names.size(), sigmas.distortion.size()); ++k) {
    table.emplace_back(std::string("lens.sigma_") + names[k], sigmas.distortion[k]);
  }
  if (!positions.lens_covariance) return;
  int step = 0;
  for (const LensCurvePoint& point :
       LensCurve(camera, *positions.lens_covariance, kLensCurveSteps)) {
    table.emplace_back("lens.sigma_radius_px." + std::to_string(++step), point.sigma_px);
  }
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

void Set(const std::string& key, SummaryValue value, SummaryTable& table) {
  const auto entry = std::find_if(
      table.begin(), table.end(), [&](const auto& other) { return other.first == key; });
  if (entry == table.end()) {
    table.emplace_back(key, std::move(value));
  } else {
    entry->second = std::move(value);
  }
}

// How a sensor lies in time and on the camera; in place of what the table says of it.
void SetAlignment(const SensorAlignment& alignment, SummaryTable& table) {
  const Eigen::Vector3d mounting_deg = alignment.cam_from_sensor.Log() * kDegFromRad;
  const Eigen::Vector3d sigma_deg =
      alignment.mounting_covariance.diagonal().cwiseSqrt() * kDegFromRad;
  Set("given.offset_s", alignment.offset_s, table);
  Set("given.offset_sigma_s", alignment.offset_sigma_s, table);
  Set("given.has_offset", alignment.has_offset, table);
  constexpr std::array kAxes = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name = kAxes[axis];
    Set("given.mounting_" + name + "_deg", mounting_deg[axis], table);
    Set("given.mounting_sigma_" + name + "_deg", sigma_deg[axis], table);
  }
  Set("given.has_mounting", alignment.has_mounting, table);
}

// What the images tell of given orientations.
void AddGiven(const GivenRotations& given, SummaryTable& table) {
  const SensorFusion& fusion = given.fusion;
  std::map<OrientationSource, std::int64_t> num_frames;
  for (const OrientationSource source : fusion.source) ++num_frames[source];
  Set("given.aligned", given.is_aligned, table);
  SetAlignment(fusion.alignment, table);
  table.insert(table.end(),
               {{"given.disagreement_deg", fusion.disagreement_rad * kDegFromRad},
                {"given.aligned_disagreement_deg", fusion.aligned_disagreement_rad * kDegFromRad},
                {"given.sigma_deg", fusion.sigma_rad * kDegFromRad},
                {"given.drift_deg", fusion.drift_rad * kDegFromRad},
                {"given.outliers", std::int64_t{fusion.num_outliers}},
                {"given.frames_of_images", num_frames[OrientationSource::kImages]},
                {"given.frames_of_both", num_frames[OrientationSource::kBoth]},
                {"given.frames_given_only", num_frames[OrientationSource::kSensor]},
                {"given.frames_interpolated", num_frames[OrientationSource::kNothing]}});
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
  summary.masks = MasksOf(orientations);
  summary.lens_checks = LensChecksOf(orientations);
  summary.sequence = {{"description", input.sequence().Describe()},
                      {"path", input.path},
                      {"working_scale", orientations.working_scale},
                      {"camera_file", input.camera_file},
                      {"first_timestamp_s", orientations.timestamps_s.front()},
                      {"last_timestamp_s", orientations.timestamps_s.back()}};
  summary.counts = CountsOf(orientations);
  summary.rotodom = OdometryOf(orientations);
  if (orientations.given) {
    summary.sequence.emplace_back("rotations_file", orientations.given->file);
    AddGiven(*orientations.given, *summary.rotodom);
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
  std::map<PoseState, std::int64_t> num_poses;
  for (const auto& [frame, pose] : positions.frame_poses) ++num_poses[pose.state];
  for (const auto& [state, number] : num_poses) {
    summary.counts.emplace_back(std::string("poses.") + Name(state), number);
  }
  if (positions.sensor_alignment) SetAlignment(*positions.sensor_alignment, *summary.rotodom);
  summary.segments = SegmentsOf(positions);
  if (const CalibrationCheck& check = positions.calibration_check; check.is_known) {
    if (!summary.lens_checks) summary.lens_checks.emplace();
    summary.lens_checks->insert(summary.lens_checks->end(),
                                {{"focal.by_images_px", check.share * camera.fx},
                                 {"focal.calibrated_px", camera.fx},
                                 {"focal.sigma_px", check.sigma * camera.fx},
                                 {"focal.contradicts", check.Contradicts()}});
  }
  AddKnownRotation(positions.krot, camera, summary);
  AddFinalBracket(positions.final_bracket, positions.camera, summary);
  AddBundles(positions, summary);
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

void AddFinalBracket(const MapBracket& bracket, const Camera& camera, RunSummary& summary) {
  if (bracket.num_observations == 0) return;
  const double focal_px = camera.MeanFocal();
  summary.krot->more.insert(summary.krot->more.end(),
                            {{"final.gamma_low_px", bracket.gamma_low * focal_px},
                             {"final.gamma_high_px", bracket.gamma_high * focal_px},
                             {"final.largest_residual_px", bracket.largest_residual * focal_px},
                             {"final.observations", std::int64_t{bracket.num_observations}},
                             {"final.tracks", std::int64_t{bracket.num_tracks}},
                             {"final.programs", std::int64_t{bracket.num_programs}}});
  summary.seconds.push_back({"final_bracket", bracket.seconds});
}

void AddBundles(const MapResult& positions, RunSummary& summary) {
  const std::vector<BundleSummary>& bundles = positions.bundles;
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
  AddLens(largest, positions, *summary.ba);
  AddStages(bundles, *summary.ba, summary.seconds);
}

}  // namespace rotslam
