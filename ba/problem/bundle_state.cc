#include "ba/problem/bundle_state.h"

#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

[[noreturn]] void Refuse(const std::string& reason) {
  throw std::invalid_argument("RefineBundle: " + reason);
}

void CheckTrack(const Track& track) {
  const std::string name = "track " + std::to_string(track.id.value);
  std::set<FrameId> seen;
  for (const Observation& observation : track.observations) {
    const std::string where = name + ", frame " + std::to_string(observation.frame.value);
    if (!seen.insert(observation.frame).second) Refuse(where + " is observed twice");
    if (!observation.keypoint_px.allFinite() || !observation.bearing.allFinite()) {
      Refuse(where + ": the observation is not finite");
    }
    if (!(observation.sigma_px > 0.0) || !std::isfinite(observation.sigma_px)) {
      Refuse(where + ": sigma_px is " + std::to_string(observation.sigma_px) +
             ", must be positive");
    }
  }
}

void CheckContract(const BundleProblem& problem, const BundleOptions& options) {
  if (const auto text = options.Problem()) Refuse("option " + *text);
  if (const auto text = problem.camera.Problem()) Refuse("camera " + *text);
  const Reconstruction& start = problem.start;
  const auto has_pose = [&](FrameId frame) {
    return start.cam_from_world.contains(frame) && start.center_in_world.contains(frame);
  };
  for (const auto& [frame, center] : start.center_in_world) {
    if (!center.allFinite()) {
      Refuse("the centre of frame " + std::to_string(frame.value) + " is not finite");
    }
  }
  for (const auto& [track, point] : start.point_in_world) {
    if (!point.allFinite()) {
      Refuse("the point of track " + std::to_string(track.value) + " is not finite");
    }
  }
  for (const FrameId frame : problem.fixed_frames) {
    if (!has_pose(frame)) {
      Refuse("fixed frame " + std::to_string(frame.value) + " has no pose");
    }
  }
  for (const auto& [frame, sigma_rad] : problem.rotation_sigma_rad) {
    if (!(sigma_rad > 0.0) || !std::isfinite(sigma_rad)) {
      Refuse("the orientation's sigma of frame " + std::to_string(frame.value) +
             " must be positive");
    }
  }
  for (const auto& [frame, other] : problem.shared_center) {
    if (!has_pose(frame) || !has_pose(other)) {
      Refuse("frame " + std::to_string((has_pose(frame) ? other : frame).value) +
             " shares a centre but has no pose");
    }
  }
  std::set<TrackId> seen;
  for (const Track& track : start.tracks) {
    if (!seen.insert(track.id).second) {
      Refuse("track " + std::to_string(track.id.value) + " is there twice");
    }
    CheckTrack(track);
  }
}

// The frame whose centre `frame` uses.
FrameId CenterOwner(const std::map<FrameId, FrameId>& shared_center, FrameId frame) {
  FrameId owner = frame;
  for (std::size_t step = 0; step <= shared_center.size(); ++step) {
    const auto next = shared_center.find(owner);
    if (next == shared_center.end() || next->second == owner) return owner;
    owner = next->second;
  }
  Refuse("shared_center of frame " + std::to_string(frame.value) + " runs in a circle");
}

}  // namespace

namespace {

using FrameIndex = std::map<FrameId, int>;

FrameIndex IndexFrames(const BundleState& state) {
  FrameIndex index;
  for (std::size_t k = 0; k < state.frames.size(); ++k) {
    index[state.frames[k].id] = static_cast<int>(k);
  }
  return index;
}

// The track's observations in frames that have a pose.
void SetTrack(const Track& track,
              const FrameIndex& frame_index,
              const BundleState& state,
              TrackState& entry) {
  entry.track = &track;
  entry.observations.clear();
  std::set<int> places;
  for (const Observation& observation : track.observations) {
    const auto frame = frame_index.find(observation.frame);
    if (frame == frame_index.end()) continue;
    entry.observations.push_back({&observation, observation.bearing, frame->second, false});
    places.insert(state.frames[frame->second].center);
  }
  entry.one_place = places.size() <= 1;
}

}  // namespace

BundleState MakeBundleState(const BundleProblem& problem, const BundleOptions& options) {
  CheckContract(problem, options);
  BundleState state;
  state.camera = problem.camera;
  const Reconstruction& start = problem.start;
  std::map<FrameId, int> center_index;
  for (const auto& [id, cam_from_world] : start.cam_from_world) {
    if (!start.center_in_world.contains(id)) continue;
    const FrameId owner = CenterOwner(problem.shared_center, id);
    const auto [center, is_new] = center_index.try_emplace(owner, state.centers.size());
    if (is_new) state.centers.push_back(start.center_in_world.at(owner));
    FrameState frame;
    frame.id = id;
    frame.cam_from_world = cam_from_world;
    frame.center = center->second;
    frame.fixed = problem.fixed_frames.contains(id);
    const auto prior = problem.rotation_sigma_rad.find(id);
    if (prior != problem.rotation_sigma_rad.end()) {
      frame.prior_sigma_rad = prior->second;
      frame.prior_cam_from_world = cam_from_world;
    }
    state.frames.push_back(frame);
  }
  const FrameIndex frame_index = IndexFrames(state);
  for (const Track& track : start.tracks) {
    TrackState entry;
    SetTrack(track, frame_index, state, entry);
    state.tracks.push_back(std::move(entry));
  }
  SetCamera(state.camera, options.num_threads, state);
  return state;
}

void ReplaceTracks(std::vector<Track> tracks, int num_threads, BundleState& state) {
  const auto replaced = std::make_shared<const std::vector<Track>>(std::move(tracks));
  std::map<TrackId, const Track*> by_id;
  for (const Track& track : *replaced) by_id[track.id] = &track;
  const FrameIndex frame_index = IndexFrames(state);
  for (TrackState& entry : state.tracks) {
    const auto track = by_id.find(entry.track->id);
    if (track != by_id.end()) SetTrack(*track->second, frame_index, state, entry);
  }
  state.replaced = replaced;
  SetCamera(state.camera, num_threads, state);
}

Eigen::Matrix2d ScaleOf(const BundleState& state, const ObservationState& one) {
  const Observation& observation = *one.observation;
  if (!state.has_motion_blur) return Eigen::Matrix2d::Identity() / observation.sigma_px;
  return Deblurring(observation.blur) / observation.sigma_px;
}

void SetCamera(const Camera& camera, int num_threads, BundleState& state) {
  state.camera = camera;
  ParallelFor(static_cast<int>(state.tracks.size()), num_threads, [&](int k) {
    for (ObservationState& one : state.tracks[k].observations) {
      const auto bearing = camera.Unproject(one.observation->keypoint_px);
      if (bearing) one.bearing = *bearing;
    }
  });
}

}  // namespace rotslam
