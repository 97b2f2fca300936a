#include "apps/slam/orientations.h"

#include <algorithm>
#include <cmath>
#include <iterator>
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

// The first frame of every connected component of the view-graph except the first one.
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

// The places of loops that were rejected, and some places before and after them.
std::map<FrameId, Features> PlacesOfRejectedLoops(std::map<FrameId, Features> places,
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

// Tracks all frames, or those until the observer stops.
// @return  the readout, where the images show a rolling shutter; the orientations are then
//          unfinished.
std::optional<ReadoutEstimate> TrackFrames(FrameStream& stream,
                                           LoopedOdometry& odometry,
                                           ReadoutDecision& decision,
                                           SlamObserver& observer,
                                           Orientations& orientations) {
  while (std::optional<FrameStream::Step> step = stream.Next(decision.IsOn())) {
    auto& [frame, estimate] = *step;
    orientations.num_unreadable += frame.problem.empty() ? 0 : 1;
    orientations.timestamps_s.push_back(frame.timestamp_s);
    orientations.image_names.push_back(frame.name);
    orientations.num_weak += estimate.report.weak;
    orientations.reports.push_back(estimate.report);
    observer.OnFrame({frame, estimate, odometry.result()});
    decision.Add(frame.id, std::move(estimate.points), odometry.result());
    if (decision.found()) return decision.found();
    orientations.loops.insert(
        orientations.loops.end(), estimate.loops.begin(), estimate.loops.end());
    orientations.interrupted = observer.ShouldStop();
    if (orientations.interrupted) return std::nullopt;
  }
  decision.Finish(odometry.result());
  return decision.found();
}

void TakeResults(LoopedOdometry& odometry, bool keep_features, Orientations& orientations) {
  const std::vector<LoopCheck> last_loops = odometry.Finish();
  orientations.loops.insert(orientations.loops.end(), last_loops.begin(), last_loops.end());
  orientations.num_places = odometry.num_places();
  if (keep_features)
    orientations.places = PlacesOfRejectedLoops(odometry.TakePlaces(), orientations.loops);
  orientations.exposure_s = odometry.exposure_s();
  orientations.seconds = odometry.odometry_seconds();
  orientations.loop_seconds = odometry.loop_seconds();
  orientations.global_averaging_seconds = odometry.averaging_seconds();
  static_cast<OdometryResult&>(orientations) = odometry.TakeResult();
}

void RequireFramesAndEdges(const Orientations& orientations) {
  const std::size_t num_frames = orientations.timestamps_s.size();
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
}

// Sets what follows from all edges together: frames without edges, interpolated frames, breaks.
void ClassifyFrames(const OrientationInputs& inputs,
                    const AveragingOptions& options,
                    Orientations& orientations) {
  for (const auto& [frame, rotation] : orientations.cam_from_world) {
    if (orientations.graph.EdgesOf(frame).empty()) orientations.unconnected.insert(frame);
  }
  if (inputs.given) {
    orientations.given =
        MatchGivenRotations(*inputs.given, orientations.timestamps_s, orientations.graph);
    orientations.cam_from_world = orientations.given->cam_from_world;
    orientations.covariance = orientations.given->covariance;
  }
  InterpolateUnknown(orientations, orientations.unconnected, orientations.cam_from_world);
  orientations.inlier_edges =
      CountInlierEdges(orientations.graph, orientations.cam_from_world, options);
  if (!orientations.given) {
    orientations.breaks = FindBreaks(orientations.graph, orientations.cam_from_world);
  }
}

}  // namespace

Orientations FindOrientations(FrameSource& frames,
                              const Camera& camera,
                              const SlamOptions& options,
                              const OrientationInputs& inputs,
                              SlamObserver& observer) {
  // From the calibration, from the interrupted run or, in a second pass, from the images.
  std::optional<ReadoutEstimate> readout;
  if (inputs.log != nullptr) readout = inputs.log->readout();
  while (true) {
    Orientations orientations;
    orientations.readout = readout;
    orientations.camera = readout ? WithReadout(camera, *readout) : camera;
    LoopedOdometry odometry(orientations.camera,
                            {options.rotodom,
                             options.loop,
                             inputs.vocabulary,
                             inputs.keep_features,
                             options.seed,
                             options.num_threads});
    ReadoutDecision decision(orientations.camera, options);
    FrameStream stream(frames, odometry, inputs.log);
    observer.OnBegin(SlamStage::kOrientations, frames.NumFrames());
    readout = TrackFrames(stream, odometry, decision, observer, orientations);
    if (readout) {
      observer.OnReadoutFound(*readout);
      if (inputs.log != nullptr) inputs.log->StartOver(*readout);
      frames.Rewind();
      continue;
    }
    TakeResults(odometry, inputs.keep_features, orientations);
    if (orientations.interrupted && !orientations.IsUsable()) return orientations;
    RequireFramesAndEdges(orientations);
    stream.Commit();
    ClassifyFrames(inputs, options.rotodom.averaging, orientations);
    observer.OnEnd(SlamStage::kOrientations, orientations);
    return orientations;
  }
}

std::map<FrameId, double> OrientationSigmas(const Orientations& orientations) {
  std::map<FrameId, double> sigma_rad;
  for (const auto& [frame, covariance] : orientations.covariance) {
    sigma_rad[frame] = std::sqrt(covariance.trace() / 3.0);
  }
  return sigma_rad;
}

RotationScale RotationScaleOf(const std::vector<LoopCheck>& loops) {
  std::vector<double> factors;
  for (const LoopCheck& loop : loops) {
    if (loop.accepted && loop.scaled.turn_scale != 1.0) factors.push_back(loop.scaled.turn_scale);
  }
  const int num_loops = static_cast<int>(factors.size());
  return {Median(std::move(factors), 1.0), num_loops};
}

}  // namespace rotslam
