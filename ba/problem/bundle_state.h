#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "ba/types/bundle_options.h"
#include "ba/types/bundle_problem.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/rotation.h"
#include "rotodom/types/track.h"

namespace rotslam {

// The working data of RefineBundle: poses and tracks by index, one block per centre. Not for
// callers of ba.

struct FrameState {
  FrameId id;
  Rotation cam_from_world;
  int center = 0;      // index of its centre; frames that stand at one place share it
  bool fixed = false;  // pose held by the caller
  // Of what is known of its orientation beforehand; 0: nothing.
  double prior_sigma_rad = 0.0;
  Rotation prior_cam_from_world;
  bool weak = false;  // too few observations to be in the last round
};

enum class TrackKind { kOut, kPoint, kDirection };

// An observation in a frame that has a pose.
struct ObservationState {
  const Observation* observation = nullptr;
  Eigen::Vector3d bearing;  // of the keypoint, as the lens stands
  int frame = 0;
  bool used = false;
};

struct TrackState {
  const Track* track = nullptr;
  std::vector<ObservationState> observations;
  bool one_place = false;  // all observations from one centre: a direction, no depth
  TrackKind kind = TrackKind::kOut;
  bool has_position = false;
  Eigen::Vector3d position;  // point in the world, or direction when seen from one place
};

struct BundleState {
  Camera camera;
  std::vector<FrameState> frames;
  std::vector<Eigen::Vector3d> centers;
  std::vector<TrackState> tracks;
  // Whether keypoints are less certain along their blurs.
  bool has_motion_blur = false;
  // Noise of what many observations together tell of the lens, in their sigmas. It weighs the
  // priors of the lens (LensOptions::weighs_by_residuals).
  double lens_noise = 1.0;
  // Owns the tracks that have replaced those of the problem; null: none have.
  std::shared_ptr<const std::vector<Track>> replaced;
};

/// The problem's poses and the tracks that they see, nothing classified yet. The tracks stay the
/// problem's: it must outlive the state.
/// Throws std::invalid_argument where the contract of RefineBundle is broken.
BundleState MakeBundleState(const BundleProblem& problem, const BundleOptions& options);

/// Replaces those of the state's tracks that have the ids of `tracks`. Their positions stay.
void ReplaceTracks(std::vector<Track> tracks, int num_threads, BundleState& state);

/// Sigmas per pixel: the inverse root of the keypoint's covariance.
Eigen::Matrix2d ScaleOf(const BundleState& state, const ObservationState& one);

/// Replaces the camera, and the bearings with it.
void SetCamera(const Camera& camera, int num_threads, BundleState& state);

}  // namespace rotslam
