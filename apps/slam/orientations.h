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

/// The result of the first stage.
struct Orientations : OdometryResult {
  bool interrupted = false;                // the observer asked to stop before the sequence's end
  Camera camera;                           // as given, with the readout estimated from the images
  std::optional<ReadoutEstimate> readout;  // set: it was estimated from the images
  std::vector<double> timestamps_s;        // by frame id
  std::vector<std::string> image_names;    // by frame id
  // Set: `cam_from_world` and `covariance` are the given ones, and the images yield only the edges.
  std::optional<GivenRotations> given;
  int num_unreadable = 0;
  std::set<FrameId> unconnected;  // without an edge; their orientations are interpolated, or given
  int num_weak = 0;
  // Frames that match later frames but none before them: each begins a new piece of the
  // view-graph, whose rotation against the piece before is extrapolated.
  std::vector<FrameId> breaks;
  std::vector<LoopCheck> loops;  // places that looked like older ones
  int num_places = 0;            // frames stored for loop closure
  // With features kept: described corners of the places that looked like others without being
  // verified as the same, and of the places around them. Map correction compares them again.
  std::map<FrameId, Features> places;
  double exposure_s = 0.0;  // estimated from motion blur, at the end; 0: unknown
  OdometrySeconds seconds;
  LoopSeconds loop_seconds;
  double global_averaging_seconds = 0.0;
  std::vector<FrameReport> reports;     // by frame id
  std::map<FrameId, int> inlier_edges;  // edges that agree with the frame's orientation

  /// Whether there are enough frames and edges for orientations; false only when interrupted.
  bool IsUsable() const { return timestamps_s.size() >= 3 && !graph.edges().empty(); }
};

/// Inputs of the first stage beside the frames.
struct OrientationInputs {
  std::shared_ptr<const Vocabulary> vocabulary;  // null: the one that comes with the library
  bool keep_features = true;                     // for the map
  // Set: these replace the orientations estimated from the images.
  std::optional<OrientationsFromElsewhere> given;
  FrameLog* log = nullptr;  // null: nothing is recorded
};

/// Reads all frames and estimates their orientations. A frame without matches gets the orientation
/// interpolated in time between the nearest frames that have one. Where the calibration does not
/// give the readout and the images show a rolling shutter, tracking starts again from the first
/// frame.
/// Throws std::runtime_error when there are fewer than three frames or no two of them match, and
/// what MatchGivenRotations throws; std::invalid_argument when an option is out of range.
/// @return  incomplete, possibly without a single edge, when the observer has stopped it
///          (IsUsable()).
Orientations FindOrientations(FrameSource& frames,
                              const Camera& camera,
                              const SlamOptions& options,
                              const OrientationInputs& inputs,
                              SlamObserver& observer);

/// Interpolates the orientation of the frames in `unknown` in time between the nearest other
/// frames. Call it again once those have been refined. Given orientations are not changed.
void InterpolateUnknown(const Orientations& orientations,
                        const std::set<FrameId>& unknown,
                        RotationMap& cam_from_world);

/// Standard deviation of every orientation whose covariance is known, rad, relative to the first
/// frame: the root of the mean variance about the three axes.
std::map<FrameId, double> OrientationSigmas(const Orientations& orientations);

/// Scale error of all rotations, from loops along which the camera turned right round: the median
/// of true angle over measured angle. 1 where there is no such loop.
struct RotationScale {
  double factor = 1.0;
  int num_loops = 0;
};
RotationScale RotationScaleOf(const std::vector<LoopCheck>& loops);

}  // namespace rotslam
