#pragma once

#include <string>

#include "rotodom/camera/camera.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/masks/static_content.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

struct MapResult;
struct Orientations;

/// The stages of the system, in their order.
enum class SlamStage {
  kOrientations,       // of every frame
  kTracks,             // pure-rotation segments, keyframes, and what they see
  kKnownRotation,      // positions of the keyframes, their orientations being known
  kBundleAdjustment,   // of the keyframes, with the map corrected and its components aligned
  kPureRotation,       // whether the camera only rotates throughout
  kFrameRegistration,  // poses of the frames between the keyframes
  kCloud,              // points as all frames see them
};

/// The name of a stage in messages: "known rotation".
const char* ToString(SlamStage stage);

/// One frame of the first stage.
struct FrameProgress {
  const Frame& frame;  // without its image
  const LoopedEstimate& estimate;
  const OdometryResult& odometry;  // so far, this frame included
};

/// Receives the progress of the system and may stop it. Calls come from the thread that runs the
/// system; arguments are valid during the call only. The default of every method does nothing.
class SlamObserver {
 public:
  virtual ~SlamObserver() = default;

  /// @param num_steps  frames that the stage will take one by one; negative where it has no steps
  ///                   or their number is not known.
  virtual void OnBegin(SlamStage /*stage*/, int /*num_steps*/) {}
  virtual void OnFrame(const FrameProgress& /*progress*/) {}
  /// The readout was estimated from the images. The first stage starts again with it.
  virtual void OnReadoutFound(const ReadoutEstimate& /*readout*/) {}
  /// Static content was found. On the picture it is masked and the first stage starts again; a
  /// camera that stands is reported after the last frame.
  virtual void OnStaticContent(const StaticContent& /*content*/) {}
  /// The image of a frame of the map cannot be read again; no points are looked for in it.
  virtual void OnMissingImage(const std::string& /*problem*/) {}
  /// Round `round` of the estimate of an unknown lens starts from `camera`. Round 0 tracks the
  /// beginning of the sequence, the others adjust its map.
  virtual void OnLensRound(int /*round*/, const Camera& /*camera*/) {}

  /// The first stage has ended; some fields of `orientations` are the results of later stages.
  virtual void OnEnd(SlamStage /*stage*/, const Orientations& /*orientations*/) {}
  /// A later stage has ended; `map` has what is known by then.
  virtual void OnEnd(SlamStage /*stage*/, const MapResult& /*map*/) {}

  /// Called after every frame of the first stage; true ends the stage with the frames so far.
  virtual bool ShouldStop() { return false; }
};

}  // namespace rotslam
