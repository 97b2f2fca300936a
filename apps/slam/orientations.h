#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/frame_log.h"
#include "apps/slam/frame_source.h"
#include "apps/slam/given_rotations.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "rotodom/loop/looped_odometry.h"

namespace rotslam {

/// What the first stage knows once the sequence has been read.
struct Orientations : OdometryResult {
  bool interrupted = false;                // the observer asked to stop before the sequence's end
  Camera camera;                           // as given, with the readout that the images tell
  std::optional<ReadoutEstimate> readout;  // set: the images told it
  std::vector<double> timestamps_s;        // by frame id
  std::vector<std::string> image_names;    // by frame id
  // Set: `cam_from_world` and `covariance` are these, and only the edges are the images'.
  std::optional<GivenRotations> given;
  int num_unreadable = 0;
  std::set<FrameId> unconnected;  // without an edge; their orientations are interpolated, or given
  int num_weak = 0;
  // Frames that match later frames but none before them: each begins a new piece of the
  // view-graph, whose rotation against the piece before is extrapolated.
  std::vector<FrameId> breaks;
  std::vector<LoopCheck> loops;  // places that looked like older ones
  int num_places = 0;            // that were remembered
  // With features kept: described corners of the places that looked like others but are not known
  // to be the same, and of those around them.
  std::map<FrameId, Features> places;
  double exposure_s = 0.0;  // by motion blur, at the end; 0: unknown
  OdometrySeconds seconds;
  LoopSeconds loop_seconds;
  double global_averaging_seconds = 0.0;
  std::vector<FrameReport> reports;     // by frame id
  std::map<FrameId, int> inlier_edges;  // edges that agree with the frame's orientation

  /// Whether there are enough frames and edges for orientations; false only when interrupted.
  bool IsUsable() const { return timestamps_s.size() >= 3 && !graph.edges().empty(); }
};

/// What the first stage takes beside the frames.
struct OrientationInputs {
  std::shared_ptr<const Vocabulary> vocabulary;  // null: the one that comes with the library
  bool keep_features = true;                     // for the map
  // Set: these replace the orientations that the images tell.
  std::optional<OrientationsFromElsewhere> given;
  FrameLog* log = nullptr;  // null: nothing is recorded
};

/// Reads the frames to their end and finds every frame's orientation. Frames that could not be
/// matched get theirs by interpolation in time between the nearest frames that could. Where the
/// camera does not know its readout and the images tell that the shutter rolls, the frames are read
/// once more from the first one.
/// Throws std::runtime_error when there are fewer than three frames or no two of them match, and
/// what MatchGivenRotations throws; std::invalid_argument when an option is out of range.
/// @return  when the observer has stopped it early, possibly without a single edge, see IsUsable().
Orientations FindOrientations(FrameSource& frames,
                              const Camera& camera,
                              const SlamOptions& options,
                              const OrientationInputs& inputs,
                              SlamObserver& observer);

/// Gives frames whose orientation is not known that between those of the nearest frames in time
/// that have one; again once these have been refined. Given orientations stay.
void InterpolateUnknown(const Orientations& orientations,
                        const std::set<FrameId>& unknown,
                        RotationMap& cam_from_world);

/// Standard deviation of every orientation whose covariance is known, rad: the root of the mean
/// variance about its three axes, against the first frame.
std::map<FrameId, double> OrientationSigmas(const Orientations& orientations);

/// Median of the factors by which closed loops right round say that all rotations are too large
/// (above one) or too small; one where no loop says.
struct RotationScale {
  double factor = 1.0;
  int num_loops = 0;
};
RotationScale RotationScaleOf(const std::vector<LoopCheck>& loops);

}  // namespace rotslam
