#include "apps/cli/run_directory/run_directory.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <stdexcept>
#include <system_error>

#include <unistd.h>

#include "apps/cli/input/focal_guess.h"
#include "apps/cli/run_directory/unfinished.h"
#include "output/export/known_rotation_file.h"
#include "output/files/atomic_file.h"
#include "output/graph/g2o.h"
#include "output/map/map_keypoints.h"
#include "output/map/ply.h"
#include "output/map/run_map.h"
#include "output/tables/loops_csv.h"
#include "output/tables/pose_covariance_csv.h"
#include "output/tables/rotations_csv.h"
#include "output/tables/segments.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {
namespace {

// Camera->world poses from orientations alone, positions zero.
Trajectory RotationTrajectory(const Orientations& orientations) {
  Trajectory trajectory;
  for (const auto& [frame, cam_from_world] : orientations.cam_from_world) {
    trajectory.push_back({orientations.timestamps_s[frame.value],
                          cam_from_world.Inverse(),
                          Eigen::Vector3d::Zero()});
  }
  return trajectory;
}

// Camera->world poses of all frames of `centers`.
Trajectory MakeTrajectory(const std::vector<double>& timestamps_s,
                          const RotationMap& cam_from_world,
                          const CenterMap& centers) {
  Trajectory trajectory;
  for (const auto& [frame, center] : centers) {
    trajectory.push_back({timestamps_s[frame.value], cam_from_world.at(frame).Inverse(), center});
  }
  return trajectory;
}

// The lines of rotations.csv, see docs/formats.md.
std::vector<RotationRow> RotationRows(const Orientations& orientations) {
  std::vector<RotationRow> rows;
  rows.reserve(orientations.cam_from_world.size());
  for (const auto& [frame, cam_from_world] : orientations.cam_from_world) {
    RotationRow& row = rows.emplace_back();
    row.frame = frame.value;
    row.timestamp_s = orientations.timestamps_s[frame.value];
    row.world_from_cam = cam_from_world.Inverse();
    row.inlier_edges = orientations.inlier_edges.at(frame);
    if (const auto known = orientations.covariance.find(frame);
        known != orientations.covariance.end()) {
      row.sigma_deg = known->second.diagonal().cwiseSqrt() * kDegFromRad;
    }
    const FrameReport& report = orientations.reports[frame.value];
    if (orientations.given) {
      row.flags.emplace_back("given");
    } else if (orientations.graph.EdgesOf(frame).empty()) {
      row.flags.emplace_back("predicted");
    }
    if (report.weak) row.flags.emplace_back("weak");
    if (report.searched_wide) row.flags.emplace_back("searched_wide");
    if (std::binary_search(orientations.breaks.begin(), orientations.breaks.end(), frame)) {
      row.flags.emplace_back("break");
    }
    const auto closes_loop = [f = frame](const LoopCheck& check) {
      return check.accepted && check.frame == f;
    };
    if (std::any_of(orientations.loops.begin(), orientations.loops.end(), closes_loop)) {
      row.flags.emplace_back("loop");
    }
  }
  return rows;
}

// The lines of loops.csv.
std::vector<LoopRow> LoopRows(const Orientations& orientations) {
  std::vector<LoopRow> rows;
  rows.reserve(orientations.loops.size());
  for (const LoopCheck& check : orientations.loops) {
    rows.push_back({check.frame.value,
                    check.match.value,
                    check.score,
                    check.num_inliers,
                    check.angle_deg,
                    check.accepted,
                    check.scaled.turn_scale,
                    check.scaled.angle_deg,
                    check.num_edges});
  }
  return rows;
}

SummaryTable SummaryOf(const ReadoutEstimate& readout) {
  return {{"source", "images"}, {"readout_s", readout.readout_s}, {"sigma_s", readout.sigma_s}};
}

// The component that a frame's position belongs to: that of the keyframe at or before it.
int ComponentAt(const std::vector<MapComponent>& components, int frame) {
  int found = components.empty() ? -1 : 0;
  for (int k = 0; k < static_cast<int>(components.size()); ++k) {
    if (components[k].keyframes.begin()->value <= frame) found = k;
  }
  return found;
}

// The pure-rotation segment that holds a frame (-1: none), and how the camera moves at the frame.
struct FrameMotion {
  int pure_rotation = -1;
  const char* kind = "translating";

  bool operator==(const FrameMotion& other) const = default;
};

std::vector<FrameMotion> MotionOfFrames(const MapResult& positions) {
  std::vector<FrameMotion> motions(positions.cam_from_world.size());
  for (int k = 0; k < std::ssize(positions.segments); ++k) {
    const PureRotationSegment& segment = positions.segments[k];
    for (int n = segment.first.value; n <= segment.last.value; ++n) motions[n] = {k, "rotating"};
    for (const FrameRange& still : segment.still) {
      for (int n = still.first.value; n <= still.last.value; ++n) motions[n].kind = "still";
    }
  }
  return motions;
}

// How the scale of a segment's component is known. Behind a segment that only turns the same
// component goes on where its tracks, or a loop, reach across.
std::string ScaleOf(const MapResult& positions, int component, int first_frame) {
  if (component < 0) return "none";
  const MapComponent& part = positions.components[component];
  if (part.placed_by_default) return "continuity";
  const auto segment_before = std::find_if(
      positions.segments.rbegin(),
      positions.segments.rend(),
      [&](const PureRotationSegment& segment) { return segment.last.value < first_frame; });
  const bool is_tied = segment_before != positions.segments.rend() &&
                       *part.keyframes.begin() < segment_before->first;
  return is_tied ? "tracks" : "reference";
}

// Cut where the kind of motion changes and, outside of pure-rotation segments, where a component of
// the map begins.
std::vector<Segment> Segments(const MapResult& positions) {
  const std::vector<FrameMotion> motions = MotionOfFrames(positions);
  std::set<int> component_starts;
  for (const MapComponent& component : positions.components) {
    component_starts.insert(component.keyframes.begin()->value);
  }
  std::vector<Segment> segments;
  for (int n = 0; n < std::ssize(motions); ++n) {
    const bool begins = n == 0 || motions[n] != motions[n - 1] ||
                        (motions[n].pure_rotation < 0 && component_starts.contains(n));
    if (begins) {
      Segment& segment = segments.emplace_back();
      segment.first_frame = n;
      segment.kind = motions[n].kind;
      const int pure_rotation = motions[n].pure_rotation;
      segment.evidence = pure_rotation < 0 ? 0.0 : positions.segments[pure_rotation].evidence;
      segment.component = ComponentAt(positions.components, n);
      segment.scale = ScaleOf(positions, segment.component, n);
    }
    segments.back().last_frame = n;
  }
  return segments;
}

// What a reader of a trajectory must know: where nothing measured its scale.
std::vector<std::string> CommentsOn(const std::vector<Segment>& segments) {
  std::vector<std::string> comments;
  for (const Segment& segment : segments) {
    if (segment.scale != "continuity") continue;
    comments.push_back(
        "frames " + std::to_string(segment.first_frame) + " to " +
        std::to_string(segment.last_frame) + ": " + segment.kind + " on part " +
        std::to_string(segment.component) +
        " of the map, whose scale nothing measures; things stay as far away as before it");
  }
  return comments;
}

constexpr std::uint8_t kUnknownLevel = 255;

// Gives each sighting of `tracks` that is in the map the level of its frame's feature whose
// keypoint it is to the last bit.
void FindLevels(const std::map<FrameId, Features>& features,
                const std::vector<Track>& tracks,
                RunMap& map) {
  std::map<FrameId, std::vector<std::pair<TrackId, Eigen::Vector2d>>> sightings;
  for (const Track& track : tracks) {
    for (const Observation& seen : track.observations) {
      sightings[seen.frame].emplace_back(track.id, seen.keypoint_px);
    }
  }
  for (const auto& [frame, of_frame] : sightings) {
    const auto found = features.find(frame);
    if (found == features.end()) continue;
    std::map<std::pair<double, double>, int> level_at;
    for (int k = 0; k < found->second.size(); ++k) {
      const Eigen::Vector2d& keypoint_px = found->second.keypoints_px[k];
      level_at[{keypoint_px.x(), keypoint_px.y()}] = found->second.levels[k];
    }
    for (const auto& [id, keypoint_px] : of_frame) {
      const auto level = level_at.find({keypoint_px.x(), keypoint_px.y()});
      const auto entry = std::lower_bound(
          map.tracks.begin(), map.tracks.end(), id, [](const MapTrack& track, TrackId wanted) {
            return track.track.id < wanted;
          });
      if (level == level_at.end() || entry == map.tracks.end() || entry->track.id != id) continue;
      const std::vector<Observation>& observations = entry->track.observations;
      for (std::size_t k = 0; k < observations.size(); ++k) {
        if (observations[k].frame != frame) continue;
        entry->levels[k] = static_cast<std::uint8_t>(level->second);
      }
    }
  }
}

// Of sightings that the tracker did not make: as its nearest one shows the point, nearer or
// farther.
void GuessUnknownLevels(RunMap& map) {
  std::map<FrameId, Eigen::Vector3d> centers;
  for (const MapFrame& frame : map.frames) centers[frame.id] = frame.center_in_world;
  for (MapTrack& entry : map.tracks) {
    std::vector<std::size_t> known;
    for (std::size_t k = 0; k < entry.levels.size(); ++k) {
      if (entry.levels[k] != kUnknownLevel) known.push_back(k);
    }
    const std::vector<Observation>& observations = entry.track.observations;
    const auto distance = [&](std::size_t k) {
      return (*entry.point_in_world - centers.at(observations[k].frame)).norm();
    };
    const std::vector<std::uint8_t> levels = entry.levels;
    for (std::size_t k = 0; k < levels.size(); ++k) {
      if (levels[k] != kUnknownLevel) continue;
      entry.levels[k] = 0;
      if (known.empty()) continue;
      const auto gap = [&](std::size_t other) {
        return std::abs(observations[other].frame.value - observations[k].frame.value);
      };
      const std::size_t nearest =
          *std::min_element(known.begin(), known.end(), [&](std::size_t a, std::size_t b) {
            return gap(a) < gap(b);
          });
      entry.levels[k] = levels[nearest];
      if (!entry.point_in_world) continue;
      const double nearer = std::log(distance(nearest) / distance(k)) / std::log(map.level_scale);
      entry.levels[k] = static_cast<std::uint8_t>(
          std::lround(std::clamp(levels[nearest] + nearer, 0.0, map.num_levels - 1.0)));
    }
  }
}

// Joins tracks, and finds the level that shows each sighting.
// @param tracks  as the tracker made them.
void SetTracks(const std::map<FrameId, Features>& features,
               const std::vector<Track>& tracks,
               std::vector<MapTrack> joined,
               RunMap& map) {
  map.tracks = std::move(joined);
  for (MapTrack& entry : map.tracks) entry.levels.assign(entry.fits.size(), kUnknownLevel);
  FindLevels(features, tracks, map);
  GuessUnknownLevels(map);
}

}  // namespace

std::filesystem::path PrepareRunDirectory(const std::string& out) {
  if (out.empty()) throw std::runtime_error("--out names no folder for the results");
  std::filesystem::path directory = out;
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || !std::filesystem::is_directory(directory)) {
    throw std::runtime_error(out + ": cannot make this folder for the results: " +
                             (error ? error.message() : "a file of that name is in the way"));
  }
  if (access(directory.c_str(), W_OK) != 0) {
    throw std::runtime_error(
        out + ": cannot write into this folder: " + std::generic_category().message(errno));
  }
  const std::filesystem::path probe = directory / ".write_test";
  ReplaceFile(probe, "");
  std::filesystem::remove(probe, error);
  ClearUnfinishedOutputs(directory);
  return directory;
}

void WriteOrientations(const std::filesystem::path& directory, const Orientations& orientations) {
  WriteTumTrajectory(directory / "rotations_tum.txt", RotationTrajectory(orientations));
  WriteRotationsCsv(directory / "rotations.csv", RotationRows(orientations));
  WriteLoopsCsv(directory / "loops.csv", LoopRows(orientations));
  WriteG2o(directory / "view_graph.g2o", {orientations.graph, orientations.cam_from_world, {}});
}

void WritePositions(const std::filesystem::path& directory,
                    const Orientations& orientations,
                    const MapResult& positions,
                    const Camera& camera,
                    PlyForm form) {
  const Trajectory trajectory = MakeTrajectory(
      orientations.timestamps_s, positions.cam_from_world, positions.center_in_world);
  const std::vector<Segment> segments = Segments(positions);
  const std::vector<std::string> comments = CommentsOn(segments);
  WriteTumTrajectory(directory / "trajectory_tum.txt", trajectory, comments);
  WriteKittiTrajectory(directory / "trajectory_kitti.txt", trajectory);
  CenterMap keyframe_centers = positions.center_in_world;
  std::erase_if(keyframe_centers,
                [&](const auto& entry) { return !positions.keyframes.contains(entry.first); });
  WriteTumTrajectory(
      directory / "keyframes_tum.txt",
      MakeTrajectory(orientations.timestamps_s, positions.cam_from_world, keyframe_centers),
      comments);
  WritePly(directory / "cloud.ply", MakeCloud(positions.cloud, camera), form);
  std::vector<Frustum> frusta;
  frusta.reserve(keyframe_centers.size());
  const double size = FrustumSize(keyframe_centers);
  for (const auto& [frame, center] : keyframe_centers) {
    frusta.push_back({positions.cam_from_world.at(frame), center, size});
  }
  WriteFrustaPly(directory / "cameras.ply", frusta, camera, form);
  WriteSegments(directory / "segments.csv", segments);
  if (positions.pose_covariance.empty()) return;
  std::vector<PoseCovarianceRow> rows;
  rows.reserve(positions.pose_covariance.size());
  for (const auto& [frame, covariance] : positions.pose_covariance) {
    rows.push_back({frame.value, orientations.timestamps_s[frame.value], covariance});
  }
  WritePoseCovarianceCsv(directory / "pose_covariance.csv", rows);
}

void WriteKnownRotationInput(const std::filesystem::path& directory,
                             const Orientations& orientations,
                             const MapResult& positions,
                             const Camera& camera) {
  KnownRotationInput input;
  input.camera = camera;
  for (const FrameId frame : positions.keyframes) {
    input.cam_from_world[frame] = orientations.cam_from_world.at(frame);
    input.timestamp_s[frame] = orientations.timestamps_s[frame.value];
  }
  input.sigma_rad = OrientationSigmas(orientations);
  input.tracks = positions.keyframe_tracks;
  WriteKnownRotation(directory / "known_rotation.txt", input);
}

void WriteMaps(const std::filesystem::path& directory,
               const Sequence& sequence,
               const Orientations& orientations,
               const MapResult& positions,
               const FeatureOptions& features) {
  RunMap map;
  map.level_scale = features.scale_factor;
  map.num_levels = features.num_levels;
  map.camera = positions.camera;
  map.image_folder = std::filesystem::absolute(sequence.image_folder()).lexically_normal().string();
  map.is_video = sequence.is_video();
  for (const auto& [frame, cam_from_world] : positions.cam_from_world) {
    map.frames.push_back({frame,
                          orientations.timestamps_s[frame.value],
                          // Frames of a video have numbers; whoever extracts them adds the ending.
                          orientations.image_names[frame.value] + (map.is_video ? ".png" : ""),
                          positions.keyframes.contains(frame),
                          cam_from_world,
                          positions.center_in_world.at(frame)});
  }
  for (const RelativeRotation& edge : orientations.graph.edges()) {
    map.edges.push_back({edge.i, edge.j, edge.num_inliers, edge.rotation_only});
  }
  SetTracks(orientations.features,
            positions.keyframe_tracks,
            JoinTracks(positions.keyframe_tracks, positions.map),
            map);
  WriteRunMap(directory / "map.bin", map);
  SetTracks(orientations.features, positions.cloud.tracks, JoinTracks({}, positions.cloud), map);
  WriteRunMap(directory / "map_all_frames.bin", map);
}

std::string DescribeInterrupted(const std::filesystem::path& directory,
                                const Orientations& orientations,
                                const Checkpoint& checkpoint) {
  return "interrupted after " + std::to_string(orientations.timestamps_s.size()) +
         " frames; their orientations are in " + directory.string() +
         ": rotations_tum.txt, rotations.csv, loops.csv, view_graph.g2o, summary.json" +
         (checkpoint.IsOn() ? "; --resume goes on from here" : "");
}

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
  const auto count = [](std::size_t value) { return static_cast<std::int64_t>(value); };
  summary.sequence = {{"description", input.sequence().Describe()},
                      {"path", input.path},
                      {"camera_file", input.camera_file},
                      {"first_timestamp_s", orientations.timestamps_s.front()},
                      {"last_timestamp_s", orientations.timestamps_s.back()}};
  summary.counts = {
      {"frames", count(orientations.timestamps_s.size())},
      {"unreadable_frames", std::int64_t{orientations.num_unreadable}},
      {"frames_without_edge", count(orientations.unconnected.size())},
      {"frames_with_weak_edge", std::int64_t{orientations.num_weak}},
      {"frames_searched_wide",
       count(std::count_if(orientations.reports.begin(),
                           orientations.reports.end(),
                           [](const FrameReport& report) { return report.searched_wide; }))},
      {"breaks", count(orientations.breaks.size())},
      {"edges", count(orientations.graph.edges().size())}};
  double inliers = 0.0;
  std::int64_t rotation_only = 0;
  for (const RelativeRotation& edge : orientations.graph.edges()) {
    inliers += edge.num_inliers;
    rotation_only += edge.rotation_only;
  }
  summary.rotodom = SummaryTable{
      {"mean_inliers_per_edge", inliers / static_cast<double>(orientations.graph.edges().size())},
      {"rotation_only_edges", rotation_only},
      {"exposure_s", orientations.exposure_s}};
  if (orientations.given) {
    summary.sequence.emplace_back("rotations_file", orientations.given->file);
    summary.rotodom->emplace_back("given_disagreement_deg", orientations.given->disagreement_deg);
  }
  const OdometrySeconds& seconds = orientations.seconds;
  summary.seconds = {{"pyramid", seconds.pyramid},
                     {"tracking", seconds.tracking},
                     {"detection", seconds.detection},
                     {"edges", seconds.edges},
                     {"averaging", seconds.averaging},
                     {"covariance", seconds.covariance},
                     {"loop_description", orientations.loop_seconds.description},
                     {"loop_candidates", orientations.loop_seconds.candidates},
                     {"loop_verification", orientations.loop_seconds.verification},
                     {"global_averaging", orientations.global_averaging_seconds}};
  summary.loops =
      SummaryTable{{"places", std::int64_t{orientations.num_places}},
                   {"candidates", count(orientations.loops.size())},
                   {"accepted",
                    count(std::count_if(orientations.loops.begin(),
                                        orientations.loops.end(),
                                        [](const LoopCheck& check) { return check.accepted; }))}};
  return summary;
}

void AddPositions(const MapResult& positions, const Camera& camera, RunSummary& summary) {
  const auto count = [](std::size_t value) { return static_cast<std::int64_t>(value); };
  summary.counts.push_back({"keyframes", count(positions.keyframes.size())});
  summary.counts.push_back({"map_points", count(positions.map.point_in_world.size())});
  summary.counts.push_back({"points", count(positions.cloud.point_in_world.size())});
  summary.counts.push_back({"shallow_points", std::int64_t{positions.num_shallow_points}});
  summary.counts.push_back({"cloud_outliers", std::int64_t{positions.num_cloud_outliers}});
  summary.counts.push_back({"components", count(positions.components.size())});
  summary.counts.push_back(
      {"relocalised_keyframes", static_cast<std::int64_t>(positions.relocalised.size())});
  summary.counts.push_back({"resected_frames", std::int64_t{positions.num_resected}});
  summary.counts.push_back({"interpolated_frames", std::int64_t{positions.num_interpolated}});
  summary.segments = Segments(positions);
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
  krot.removed = static_cast<std::int64_t>(solution.removed.size());
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
                            {"has_motion_blur", largest.has_motion_blur},
                            {"lens.gain", largest.lens_gain},
                            {"lens.refined", largest.lens_refined},
                            {"lens.fx", camera.fx},
                            {"lens.fy", camera.fy}};
  const bool is_fov = camera.model == CameraModel::kFov;
  if (is_fov) {
    summary.ba->push_back({"lens.w", camera.distortion[0]});
  } else {
    summary.ba->push_back({"lens.k1", camera.distortion[0]});
    summary.ba->push_back({"lens.k2", camera.distortion[1]});
  }
  if (largest.lens_sigmas) {
    const LensSigmas& sigmas = *largest.lens_sigmas;
    summary.ba->insert(summary.ba->end(),
                       {{"lens.cx", camera.cx},
                        {"lens.cy", camera.cy},
                        {"lens.sigma_focal_px", sigmas.focal_px},
                        {"lens.sigma_cx_px", sigmas.cx_px},
                        {"lens.sigma_cy_px", sigmas.cy_px},
                        {is_fov ? "lens.sigma_w" : "lens.sigma_k1", sigmas.k1}});
    if (!is_fov) summary.ba->push_back({"lens.sigma_k2", sigmas.k2});
  }
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
    summary.ba->push_back({"iterations_of." + name, number});
    summary.seconds.push_back({"bundle_" + name, seconds_of[name]});
  }
  summary.seconds.push_back({"bundle_solver", solver_seconds});
  summary.seconds.push_back({"bundle_adjustment", bundle_seconds});
}

}  // namespace rotslam
