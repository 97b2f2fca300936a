#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/cli/input/input.h"
#include "apps/cli/input/pipeline.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/given_rotations.h"
#include "output/tables/loops_csv.h"
#include "output/tables/rotations_csv.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// What the first stage knows once the sequence has been read.
struct Orientations : OdometryResult {
  bool interrupted = false;              // before the sequence's end
  std::vector<double> timestamps_s;      // by frame id
  std::vector<std::string> image_names;  // by frame id
  // Set: `cam_from_world` and `covariance` are these, and only the edges are the images'.
  std::optional<GivenRotations> given;
  int num_unreadable = 0;
  std::set<FrameId> unconnected;  // without an edge; their orientations are interpolated, or given
  int num_weak = 0;
  // Frames that match later frames but none before them: a new piece of the view-graph, whose turn
  // against the piece before is extrapolated.
  std::vector<FrameId> breaks;
  std::vector<LoopCheck> loops;  // places that looked like older ones
  int num_places = 0;            // that were remembered
  // With features kept: described corners of the places that looked like others but are not known
  // to be the same, and of those around them.
  std::map<FrameId, Features> places;
  double exposure_s = 0.0;  // what blur tells of it at the end; 0: nothing
  OdometrySeconds seconds;
  LoopSeconds loop_seconds;
  double global_averaging_seconds = 0.0;
  std::vector<FrameReport> reports;     // by frame id
  std::map<FrameId, int> inlier_edges;  // edges that agree with the frame's orientation
};

/// Reads the sequence to its end and finds every frame's orientation. Frames that could not be
/// matched get theirs by interpolation in time between the nearest frames that could. Throws
/// std::runtime_error when there are fewer than three frames or no two of them match;
/// InterruptedError where that is so because `interruption` came first. It stops after the frame at
/// hand.
/// @param input       with `given_rotations`, these replace what the images say (see
///                    MatchGivenRotations, which says what it throws).
/// @param vocabulary  null for the one that comes with the program.
/// @param checkpoint  what it has is not found anew, and what is found it gets; may be null.
Orientations FindOrientations(Input& input,
                              const PipelineOptions& options,
                              std::shared_ptr<const Vocabulary> vocabulary,
                              bool keep_features,
                              const CommonFlags& flags,
                              const Interruption& interruption,
                              Progress& progress,
                              Checkpoint* checkpoint = nullptr);

/// Gives frames whose orientation is not known that between those of the nearest frames in time
/// that have one; again once these have been refined. Given orientations stay.
void InterpolateUnknown(const Orientations& orientations,
                        const std::set<FrameId>& unknown,
                        RotationMap& cam_from_world);

/// Standard deviation of every orientation whose covariance is known, rad: the root of the mean
/// variance about its three axes, against the first frame.
std::map<FrameId, double> OrientationSigmas(const Orientations& orientations);

/// Camera->world poses from orientations alone, positions zero.
Trajectory RotationTrajectory(const Orientations& orientations);

/// The lines of rotations.csv. Flags: `predicted` (matches no other frame, interpolated), `weak`
/// (its best edge has fewer inliers than asked for), `given` (from elsewhere), `searched_wide` (the
/// prediction did not guide the matching), `break` (matches none before it), `loop` (sees a place
/// that was seen before).
std::vector<RotationRow> RotationRows(const Orientations& orientations);

/// The lines of loops.csv.
std::vector<LoopRow> LoopRows(const Orientations& orientations);

}  // namespace rotslam
