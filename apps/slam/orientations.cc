#include "apps/slam/orientations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <set>
#include <stdexcept>
#include <utility>

#include "apps/slam/frame_stream.h"
#include "apps/slam/readout_decision.h"
#include "rotodom/types/disjoint_sets.h"
#include "rotodom/types/median.h"

namespace rotslam {

void InterpolateUnknown(const Orientations& orientations,
                        const std::set<FrameId>& unknown,
                        RotationMap& rotations) {
  if (orientations.given) return;
  const auto known = [&](FrameId frame) { return !unknown.contains(frame); };
  for (auto entry = rotations.begin(); entry != rotations.end(); ++entry) {
    if (known(entry->first)) continue;
    auto before = entry;
    while (before != rotations.begin() && !known(before->first)) --before;
    auto after = entry;
    while (after != rotations.end() && !known(after->first)) ++after;
    const bool has_before = known(before->first);
    if (has_before && after != rotations.end()) {
      const double from_s = orientations.timestamps_s[before->first.value];
      const double to_s = orientations.timestamps_s[after->first.value];
      const double at_s = orientations.timestamps_s[entry->first.value];
      entry->second = Interpolate(before->second, after->second, (at_s - from_s) / (to_s - from_s));
    } else if (has_before) {
      entry->second = before->second;
    } else if (after != rotations.end()) {
      entry->second = after->second;
    }
  }
}

namespace {

// The first frame of every piece of the view-graph but the first.
std::vector<FrameId> FindBreaks(const ViewGraph& graph, const RotationMap& rotations) {
  DisjointSets pieces;
  for (const RelativeRotation& edge : graph.edges()) pieces.Join(edge.i.value, edge.j.value);
  std::vector<FrameId> breaks;
  bool is_first = true;
  for (const auto& [frame, rotation] : rotations) {
    if (graph.EdgesOf(frame).empty()) continue;
    if (pieces.Find(frame.value) == frame.value && !is_first) breaks.push_back(frame);
    is_first = false;
  }
  return breaks;
}

// The places of loops that were not accepted, and some before and behind them.
std::map<FrameId, Features> DoubtfulPlaces(std::map<FrameId, Features> places,
                                           const std::vector<LoopCheck>& loops) {
  constexpr int kAround = 3;
  std::set<FrameId> doubtful;
  const auto add_around = [&](FrameId frame) {
    const auto place = places.find(frame);
    if (place == places.end()) return;
    auto from = place;
    for (int k = 0; k < kAround && from != places.begin(); ++k) --from;
    auto to = place;
    for (int k = 0; k <= kAround && to != places.end(); ++k) ++to;
    for (; from != to; ++from) doubtful.insert(from->first);
  };
  for (const LoopCheck& loop : loops) {
    if (loop.accepted) continue;
    add_around(loop.frame);
    add_around(loop.match);
  }
  std::erase_if(places, [&](const auto& place) { return !doubtful.contains(place.first); });
  return places;
}

// Loops right round measure the scale of all turns.
void WarnOfTurnScale(const std::vector<LoopCheck>& loops, Progress& progress) {
  constexpr double kNotable = 0.02;
  std::vector<double> scales;
  for (const LoopCheck& loop : loops) {
    if (loop.accepted && loop.way.turn_scale != 1.0) scales.push_back(loop.way.turn_scale);
  }
  const double scale = Median(scales, 1.0);
  if (std::abs(scale - 1.0) < kNotable) return;
  std::array<char, 160> text = {};
  std::snprintf(text.data(),
                text.size(),
                "turns around %zu closed loops come out %.1f %% too %s: check the focal length, "
                "which seems too %s",
                scales.size(),
                100.0 * std::abs(scale - 1.0),
                scale > 1.0 ? "small" : "large",
                scale > 1.0 ? "long" : "short");
  progress.Warn(text.data());
}

// What runs past while the sequence is read.
class LiveCounters {
 public:
  explicit LiveCounters(const PureRotationOptions& held) : held_(held) {}

  std::vector<std::string> Update(const LoopedEstimate& estimate, const OdometryResult& result) {
    num_loops_ += std::count_if(estimate.loops.begin(),
                                estimate.loops.end(),
                                [](const LoopCheck& check) { return check.accepted; });
    // A look takes time in proportion to what has been read: rarer and rarer, so that all of them
    // together do, too.
    constexpr int kFramesBetweenLooks = 30;
    if (estimate.frame.value >= next_look_) {
      num_segments_ = CountSegments(result);
      next_look_ = estimate.frame.value + std::max(kFramesBetweenLooks, estimate.frame.value / 10);
    }
    return {std::to_string(estimate.report.num_inliers) + " inliers",
            Counted(num_loops_, "loop"),
            Counted(num_segments_, "segment")};
  }

 private:
  static std::string Counted(std::int64_t count, const std::string& what) {
    return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  }

  // Stretches on which the camera moves, or does not.
  std::int64_t CountSegments(const OdometryResult& result) const {
    const RotationMap& cam_from_world = result.cam_from_world;
    std::int64_t count = 0;
    int next = cam_from_world.begin()->first.value;
    for (const PureRotationSegment& stretch :
         FindPureRotationSegments(result.graph, cam_from_world, held_)) {
      count += stretch.first.value > next ? 2 : 1;
      next = stretch.last.value + 1;
    }
    return count + (cam_from_world.rbegin()->first.value >= next ? 1 : 0);
  }

  PureRotationOptions held_;
  std::int64_t num_loops_ = 0;
  std::int64_t num_segments_ = 1;
  int next_look_ = 29;
};

// What a copy has cut off is missed by nobody; the odd frame is a container's own miscount.
void WarnOfMissingFrames(int num_frames, int num_announced, Progress& progress) {
  const int num_missing = num_announced - num_frames;
  if (num_missing <= std::max(2, num_announced / 100)) return;
  progress.Warn("the video ends after " + std::to_string(num_frames) + " of the " +
                std::to_string(num_announced) + " frames it announces; is the file complete?");
}

void TellDetails(const LoopedEstimate& estimate, Progress& progress) {
  const FrameReport& report = estimate.report;
  progress.Detail("frame " + std::to_string(estimate.frame.value) + ": " +
                  std::to_string(report.num_tracked) + " points tracked, " +
                  std::to_string(report.num_inliers) + " inliers" +
                  (report.predicted_only ? ", no edge" : "") + (report.weak ? ", weak" : "") +
                  (report.searched_wide ? ", searched wide" : "") +
                  (estimate.has_averaged ? ", drift spread over all orientations" : ""));
  for (const LoopCheck& check : estimate.loops) {
    progress.Detail("frame " + std::to_string(check.frame.value) + " looks like frame " +
                    std::to_string(check.match.value) + ": " + std::to_string(check.num_inliers) +
                    " inliers, " + std::to_string(check.angle_deg) + " deg around the loop, " +
                    (check.accepted ? "accepted, " + std::to_string(check.num_edges) + " edges"
                                    : std::string("not accepted")));
  }
}

}  // namespace

Orientations FindOrientations(Input& input,
                              const PipelineOptions& options,
                              std::shared_ptr<const Vocabulary> vocabulary,
                              bool keep_features,
                              const CommonFlags& flags,
                              const Interruption& interruption,
                              Progress& progress,
                              Checkpoint* checkpoint) {
  if (checkpoint != nullptr && checkpoint->readout()) SetReadout(*checkpoint->readout(), input);
  LoopedOdometry odometry(input.camera,
                          options.rotodom,
                          options.loop,
                          vocabulary,
                          keep_features,
                          flags.seed,
                          flags.NumThreads());
  ReadoutDecision watch(input.camera, options, flags.NumThreads());
  Orientations orientations;
  LiveCounters counters(options.pure_rotation_segments);
  FrameStream frames(*input.sequence, odometry, checkpoint);
  const int num_announced = input.sequence->NumFrames();
  const auto start_over = [&] {
    const ReadoutEstimate& readout = *watch.found();
    progress.EndStage("the shutter rolls, read out in " + DescribeReadout(readout));
    progress.Warn(
        "how the sensor is read out is not known, the images tell it: starts again from the first "
        "frame with " +
        CameraLines(readout) + "; in the camera file that spares the second reading");
    if (checkpoint != nullptr) checkpoint->StartOver(readout);
    SetReadout(readout, input);
    input.sequence = OpenSequence(input.path, options.sequence);
    return FindOrientations(
        input, options, vocabulary, keep_features, flags, interruption, progress, checkpoint);
  };
  progress.StartStage("orientations", num_announced);
  while (std::optional<FrameStream::Step> step = frames.Next(watch.IsOn())) {
    auto& [frame, estimate] = *step;
    if (!frame.problem.empty()) {
      progress.Warn("frame " + std::to_string(frame.id.value) +
                    " skipped, its pose is interpolated: " + frame.problem);
      ++orientations.num_unreadable;
    }
    orientations.timestamps_s.push_back(frame.timestamp_s);
    orientations.image_names.push_back(frame.name);
    orientations.num_weak += estimate.report.weak;
    orientations.reports.push_back(estimate.report);
    TellDetails(estimate, progress);
    progress.Step(frame.id.value + 1, counters.Update(estimate, odometry.result()));
    watch.Add(frame.id, std::move(estimate.points), odometry.result());
    if (watch.found()) return start_over();
    orientations.loops.insert(
        orientations.loops.end(), estimate.loops.begin(), estimate.loops.end());
    orientations.interrupted = interruption.IsRequested();
    if (orientations.interrupted) {
      progress.Say("interrupted: putting together what there is; once more ends at once");
      break;
    }
  }
  if (!orientations.interrupted) watch.Finish(odometry.result());
  if (watch.found()) return start_over();
  const std::vector<LoopCheck> last_loops = odometry.Finish();
  orientations.loops.insert(orientations.loops.end(), last_loops.begin(), last_loops.end());
  orientations.num_places = odometry.num_places();
  if (keep_features)
    orientations.places = DoubtfulPlaces(odometry.TakePlaces(), orientations.loops);
  orientations.exposure_s = odometry.exposure_s();
  orientations.seconds = odometry.odometry_seconds();
  orientations.loop_seconds = odometry.loop_seconds();
  orientations.global_averaging_seconds = odometry.averaging_seconds();
  static_cast<OdometryResult&>(orientations) = odometry.TakeResult();

  const int num_frames = static_cast<int>(orientations.timestamps_s.size());
  if (!orientations.interrupted) WarnOfMissingFrames(num_frames, num_announced, progress);
  if (orientations.interrupted && (num_frames < 3 || orientations.graph.edges().empty())) {
    throw InterruptedError("interrupted after frame " + std::to_string(num_frames - 1) +
                           ": too early, nothing is written");
  }
  if (num_frames < 3) {
    throw std::runtime_error("only " + std::to_string(num_frames) +
                             " frames could be read; at least 3 are needed");
  }
  if (orientations.graph.edges().empty()) {
    throw std::runtime_error(
        "no two of the " + std::to_string(num_frames) +
        " frames could be matched: the images show too few corners in common; check "
        "that they are in focus, exposed and in order");
  }
  frames.Commit();
  for (const auto& [frame, rotation] : orientations.cam_from_world) {
    if (orientations.graph.EdgesOf(frame).empty()) orientations.unconnected.insert(frame);
  }
  if (input.given_rotations) {
    orientations.given = MatchGivenRotations(input.rotations_file,
                                             *input.given_rotations,
                                             orientations.timestamps_s,
                                             orientations.graph);
    orientations.cam_from_world = orientations.given->cam_from_world;
    orientations.covariance = orientations.given->covariance;
  }
  InterpolateUnknown(orientations, orientations.unconnected, orientations.cam_from_world);
  orientations.inlier_edges =
      CountInlierEdges(orientations.graph, orientations.cam_from_world, options.rotodom.averaging);
  if (!orientations.given) {
    orientations.breaks = FindBreaks(orientations.graph, orientations.cam_from_world);
  }
  progress.EndStage(std::to_string(num_frames) + " frames, " +
                    std::to_string(orientations.graph.edges().size()) + " edges");
  if (orientations.given) {
    progress.Say("orientations from " + orientations.given->file + ", " +
                 std::to_string(orientations.given->disagreement_deg) +
                 " deg from the edges (median)");
    WarnOfTurnScale(orientations.loops, progress);
    return orientations;
  }
  // The unreadable ones have had their warning.
  const int num_unconnected = static_cast<int>(orientations.unconnected.size());
  if (const int count = num_unconnected - orientations.num_unreadable; count > 0) {
    progress.Warn(std::to_string(count) +
                  (count == 1 ? " frame matches no other; its orientation is interpolated"
                              : " frames match no other; their orientations are interpolated"));
  }
  WarnOfTurnScale(orientations.loops, progress);
  for (const FrameId frame : orientations.breaks) {
    progress.Warn("frame " + std::to_string(frame.value) +
                  " matches none before it; the turn across this gap is extrapolated");
  }
  return orientations;
}

std::map<FrameId, double> OrientationSigmas(const Orientations& orientations) {
  std::map<FrameId, double> sigma_rad;
  for (const auto& [frame, covariance] : orientations.covariance) {
    sigma_rad[frame] = std::sqrt(covariance.trace() / 3.0);
  }
  return sigma_rad;
}

Trajectory RotationTrajectory(const Orientations& orientations) {
  Trajectory trajectory;
  for (const auto& [frame, cam_from_world] : orientations.cam_from_world) {
    trajectory.push_back({orientations.timestamps_s[frame.value],
                          cam_from_world.Inverse(),
                          Eigen::Vector3d::Zero()});
  }
  return trajectory;
}

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
                    check.way.turn_scale,
                    check.way.angle_deg,
                    check.num_edges});
  }
  return rows;
}

}  // namespace rotslam
