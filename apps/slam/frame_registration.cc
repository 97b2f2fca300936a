#include "apps/slam/frame_registration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "apps/slam/map/frame_states.h"
#include "apps/slam/map/odometry_agreement.h"
#include "apps/slam/map/resect_frames.h"
#include "rotodom/averaging/anchors.h"
#include "rotodom/averaging/closure.h"

namespace rotslam {
namespace {

constexpr const char* kHeldToOdometry = "orientation held to the odometry: the map's is ";
constexpr const char* kLeavesOdometry = "orientation leaves the odometry: by ";

std::string Degrees(double angle_deg) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.1f deg", angle_deg);
  return text.data();
}

// The steps of RegisterFrames. Each adds to `registration_` and to the result.
class FrameRegistration {
 public:
  FrameRegistration(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const SlamOptions& options,
                    MapResult& result)
      : orientations_(orientations),
        all_tracks_(all_tracks),
        options_(options),
        result_(result),
        anchors_(result.map.center_in_world),
        resection_(options.resection) {
    resection_.has_motion_blur =
        std::any_of(result.bundles.begin(), result.bundles.end(), [](const BundleSummary& bundle) {
          return bundle.has_motion_blur;
        });
  }

  void Run() {
    result_.center_in_world = anchors_;
    ShareCenters();
    Resect();
    HoldToOdometry();
    TakeMeasured();
    InterpolateRemaining();
    FindKeyframeCovariances();
    FindDepartingSteps();
    FindStates();
  }

 private:
  // Within a segment the position equals that of the segment's end exactly.
  void ShareCenters() {
    for (const auto& [frame, rotation] : result_.cam_from_world) {
      if (anchors_.contains(frame)) continue;
      const PureRotationSegment* segment = SegmentAt(result_.segments, frame);
      if (segment != nullptr &&
          (anchors_.contains(segment->first) || anchors_.contains(segment->last))) {
        const FrameId end = anchors_.contains(segment->first) ? segment->first : segment->last;
        result_.center_in_world[frame] = anchors_.at(end);
        registration_.shared_center[frame] = end;
      } else {
        remaining_.push_back(frame);
      }
    }
  }

  std::map<FrameId, ResectedPose> ResectFrom(const std::map<FrameId, ResectionStart>& starts,
                                             const ResectionOptions& resection) const {
    return ResectFrames(starts,
                        {result_.map.point_in_world, all_tracks_},
                        result_.camera,
                        resection,
                        options_.num_threads);
  }

  void Resect() {
    std::set<FrameId> refined;
    for (const auto& [frame, rotation] : result_.map.cam_from_world) refined.insert(frame);
    const std::map<FrameId, Eigen::Matrix3d> rotation_covariance = AnchorCovariances(
        orientations_.graph, result_.cam_from_world, refined, options_.rotodom.averaging);
    for (const FrameId frame : remaining_) {
      ResectionStart& start = starts_[frame];
      start.cam_from_world = result_.cam_from_world.at(frame);
      start.center_in_world = InterpolatedCenter(anchors_, orientations_.timestamps_s, frame);
      const auto covariance = rotation_covariance.find(frame);
      if (covariance != rotation_covariance.end()) start.rotation_covariance = covariance->second;
      UseGiven(frame, start);
    }
    registration_.measured = ResectFrom(starts_, resection_);
  }

  // The odometry's orientation of a frame, turned as bundle adjustment has turned the keyframes
  // around it: what the two disagree about between two keyframes is spread evenly.
  Rotation OdometryOrientation(FrameId frame) const {
    const RotationMap& odometry = orientations_.cam_from_world;
    const RotationMap& refined = result_.map.cam_from_world;
    const auto turn = [&](RotationMap::const_iterator keyframe) {
      return odometry.at(keyframe->first).Inverse() * keyframe->second;
    };
    const auto after = refined.lower_bound(frame);
    if (after == refined.begin()) return odometry.at(frame) * turn(after);
    const auto before = std::prev(after);
    if (after == refined.end()) return odometry.at(frame) * turn(before);
    const double weight = static_cast<double>(frame.value - before->first.value) /
                          (after->first.value - before->first.value);
    return odometry.at(frame) * Interpolate(turn(before), turn(after), weight);
  }

  // Starts from the orientation that a sensor has corrected, where that is the better one.
  void UseGiven(FrameId frame, ResectionStart& start) {
    if (!orientations_.given || !orientations_.given->CountsFor(frame)) return;
    const SensorFusion& fusion = orientations_.given->fusion;
    if (!fusion.drifts_less) return;
    const double variance = fusion.variance[frame.value] + fusion.sigma_rad * fusion.sigma_rad;
    if (start.rotation_covariance && start.rotation_covariance->trace() < 3.0 * variance) return;
    start.rotation_covariance = variance * Eigen::Matrix3d::Identity();
    start.cam_from_world = OdometryOrientation(frame);
    result_.cam_from_world[frame] = start.cam_from_world;
  }

  // Of a keyframe or a remaining frame; nullopt of those in a pure rotation.
  std::optional<OrientationInMap> OrientationOf(FrameId frame) const {
    const auto measured = registration_.measured.find(frame);
    if (measured != registration_.measured.end()) {
      return OrientationInMap{measured->second.cam_from_world,
                              measured->second.covariance.topLeftCorner<3, 3>()};
    }
    if (!starts_.contains(frame) && !anchors_.contains(frame)) return std::nullopt;
    return OrientationInMap{result_.cam_from_world.at(frame)};
  }

  // The remaining frames that turn against the frame before or after by another angle than the
  // odometry.
  std::map<FrameId, OdometryDeparture> FindFlips() const {
    std::map<FrameId, OdometryDeparture> flips;
    for (const RelativeRotation& edge : orientations_.graph.edges()) {
      if (edge.j.value != edge.i.value + 1) continue;
      const auto before = OrientationOf(edge.i);
      const auto after = OrientationOf(edge.j);
      if (!before || !after) continue;
      const OdometryDeparture departure =
          DepartureOf(edge, *before, *after, options_.rotodom.averaging);
      if (!departure.IsTooFar()) continue;
      for (const FrameId frame : {edge.i, edge.j}) {
        if (!starts_.contains(frame)) continue;
        OdometryDeparture& largest = flips[frame];
        if (departure.angle_deg > largest.angle_deg) largest = departure;
      }
    }
    return flips;
  }

  // The remaining frames between the keyframes around `frames`, with the odometry's orientation.
  std::map<FrameId, ResectionStart> StartsAround(
      const std::map<FrameId, OdometryDeparture>& frames) const {
    std::map<FrameId, ResectionStart> starts;
    const RotationMap& refined = result_.map.cam_from_world;
    for (const auto& [frame, departure] : frames) {
      const auto after = refined.lower_bound(frame);
      const auto from =
          after == refined.begin() ? starts_.begin() : starts_.lower_bound(std::prev(after)->first);
      const auto to = after == refined.end() ? starts_.end() : starts_.lower_bound(after->first);
      for (auto entry = from; entry != to; ++entry) {
        ResectionStart& start = starts[entry->first];
        start.cam_from_world = OdometryOrientation(entry->first);
        start.center_in_world = entry->second.center_in_world;
      }
    }
    return starts;
  }

  // Where a frame flips, it and its neighbours up to the next keyframes get the odometry's
  // orientation and are resected again for their positions, unless their points allow no other
  // orientation than the one found first.
  void HoldToOdometry() {
    // Of the inliers with the orientation free, so many must stay inliers.
    constexpr double kMinShare = 0.9;
    const std::map<FrameId, OdometryDeparture> flips = FindFlips();
    const std::map<FrameId, ResectionStart> starts = StartsAround(flips);
    ResectionOptions options = resection_;
    options.refine_rotation = false;
    const std::map<FrameId, ResectedPose> poses = ResectFrom(starts, options);
    for (const auto& [frame, start] : starts) {
      const auto held = poses.find(frame);
      const auto measured = registration_.measured.find(frame);
      const bool is_measured = measured != registration_.measured.end();
      if (is_measured && (held == poses.end() ||
                          held->second.num_inliers < kMinShare * measured->second.num_inliers)) {
        continue;
      }
      const Rotation before =
          is_measured ? measured->second.cam_from_world : result_.cam_from_world.at(frame);
      registration_.notes[frame] =
          kHeldToOdometry + Degrees((start.cam_from_world * before.Inverse()).AngleDeg()) + " away";
      registration_.held_orientations.insert(frame);
      result_.cam_from_world[frame] = start.cam_from_world;
      if (held != poses.end()) registration_.measured[frame] = held->second;
    }
    for (const auto& [frame, departure] : flips) {
      if (registration_.held_orientations.contains(frame)) continue;
      registration_.notes[frame] =
          kLeavesOdometry + Degrees(departure.angle_deg) + " from frame to frame";
    }
  }

  void TakeMeasured() {
    for (const auto& [frame, pose] : registration_.measured) {
      result_.cam_from_world[frame] = pose.cam_from_world;
      result_.center_in_world[frame] = pose.center_in_world;
    }
    result_.num_resected = static_cast<int>(registration_.measured.size());
  }

  void InterpolateRemaining() {
    const CenterMap known = result_.center_in_world;
    for (const FrameId frame : remaining_) {
      if (registration_.measured.contains(frame)) continue;
      result_.center_in_world[frame] = InterpolatedCenter(known, orientations_.timestamps_s, frame);
      ++result_.num_interpolated;
    }
  }

  // The poses of keyframes are bundle adjustment's and stay.
  void FindKeyframeCovariances() {
    std::map<FrameId, ResectionStart> poses;
    for (const auto& [frame, center] : anchors_) {
      poses[frame] = {result_.cam_from_world.at(frame), center, std::nullopt};
    }
    registration_.measured.merge(AssessFrames(poses,
                                              {result_.map.point_in_world, all_tracks_},
                                              result_.camera,
                                              resection_,
                                              options_.num_threads));
  }

  void FindDepartingSteps() {
    std::vector<std::set<FrameId>> keyframes;
    for (const MapComponent& component : result_.components) {
      keyframes.push_back(component.keyframes);
    }
    for (const DepartingStep& step : DepartingSteps(orientations_.graph,
                                                    orientations_.cam_from_world,
                                                    result_.map.cam_from_world,
                                                    keyframes,
                                                    options_.rotodom.averaging)) {
      // Map correction has compared images before it moved a keyframe.
      if (result_.relocalised.contains(step.first) || result_.relocalised.contains(step.last)) {
        continue;
      }
      registration_.notes[step.last] = kLeavesOdometry + Degrees(step.departure.angle_deg) +
                                       " since keyframe " + std::to_string(step.first.value);
    }
  }

  void FindStates() {
    const double edge_error = options_.rotodom.averaging.edge_error_factor;
    const double closure_variance = ClosureVariance(orientations_.graph);
    std::map<FrameId, double> orientation_sigma = OrientationSigmas(orientations_);
    if (!orientations_.given) {
      for (auto& [frame, sigma] : orientation_sigma) {
        sigma *= std::sqrt(closure_variance);
      }
    }
    result_.frame_poses = FindFramePoses({result_.map,
                                          result_.components,
                                          all_tracks_,
                                          orientations_.graph,
                                          orientations_.timestamps_s,
                                          result_.center_in_world,
                                          edge_error * edge_error * closure_variance,
                                          orientation_sigma},
                                         registration_);
  }

  const Orientations& orientations_;
  const std::vector<Track>& all_tracks_;
  const SlamOptions& options_;
  MapResult& result_;
  const CenterMap anchors_;
  ResectionOptions resection_;
  std::vector<FrameId> remaining_;            // neither keyframes nor in a pure rotation
  std::map<FrameId, ResectionStart> starts_;  // of the remaining frames
  Registration registration_;
};

}  // namespace

void RegisterFrames(const Orientations& orientations,
                    const std::vector<Track>& all_tracks,
                    const SlamOptions& options,
                    MapResult& result) {
  FrameRegistration(orientations, all_tracks, options, result).Run();
}

}  // namespace rotslam
