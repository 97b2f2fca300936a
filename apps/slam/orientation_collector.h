#pragma once

#include <functional>
#include <optional>

#include "apps/slam/input/frame_stream.h"
#include "apps/slam/orientations.h"
#include "apps/slam/readout_decision.h"

namespace rotslam {

/// The first stage frame by frame: FindOrientations goes through it with the frames of a source, a
/// live session with those that a camera delivers.
class OrientationCollector {
 public:
  /// @param known    found in the images before tracking started again.
  /// @param options  must outlive the object.
  /// Throws std::invalid_argument when an option is out of range.
  OrientationCollector(const FoundInImages& known,
                       const Camera& camera,
                       const SlamOptions& options,
                       const OrientationInputs& inputs);
  OrientationCollector(const OrientationCollector&) = delete;
  OrientationCollector& operator=(const OrientationCollector&) = delete;

  /// Tracks the next frame; pass the result to Take().
  TrackedFrame Track(Frame frame);
  /// Adds a tracked frame.
  /// @return  findings for which tracking has to start again; nullopt: none.
  std::optional<FoundInImages> Take(TrackedFrame&& tracked, SlamObserver& observer);
  /// Call after the last frame: makes the decisions that need all frames.
  std::optional<FoundInImages> EndFrames();
  /// The orientations; call it last. Throws std::runtime_error as FindOrientations does.
  /// @param commit  called when the orientations are known to be usable; may be empty.
  Orientations Finish(SlamObserver& observer, const std::function<void()>& commit);

  const OdometryResult& odometry() const { return odometry_.result(); }
  /// Whether a loop is about to change orientations of older frames.
  bool is_averaging() const { return odometry_.is_averaging(); }
  const FrameMasks& masks() const { return orientations_.masks; }
  const Camera& camera() const { return orientations_.camera; }
  /// Whether Take() needs the points of a frame.
  bool NeedsPoints() const { return readout_.IsOn(); }
  /// Whether the observer has asked to stop.
  bool is_interrupted() const { return orientations_.interrupted; }
  /// For a FrameStream.
  TrackingTools tools() { return {odometry_, static_content_}; }

 private:
  const SlamOptions& options_;
  OrientationInputs inputs_;
  FoundInImages known_;
  Orientations orientations_;
  LoopedOdometry odometry_;
  ReadoutDecision readout_;
  StaticContentDecision static_content_;
};

/// Reads all frames and estimates their orientations. A frame without matches gets the orientation
/// interpolated in time between the nearest frames that have one. Where the calibration does not
/// give the readout and the images show a rolling shutter, tracking starts again from the first
/// frame; so it does where parts of the picture never move, which are then masked.
/// Throws std::runtime_error when there are fewer than three frames or no two of them match, and
/// what MatchGivenRotations throws; std::invalid_argument when an option is out of range.
/// @return  incomplete, possibly without a single edge, when the observer has stopped it
///          (IsUsable()).
Orientations FindOrientations(FrameSource& frames,
                              const Camera& camera,
                              const SlamOptions& options,
                              const OrientationInputs& inputs,
                              SlamObserver& observer);

}  // namespace rotslam
