#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/input/frame_log.h"
#include "apps/slam/input/frame_source.h"
#include "apps/slam/input/given_rotations.h"
#include "apps/slam/masks/frame_masks.h"
#include "apps/slam/observer.h"
#include "apps/slam/options.h"
#include "rotodom/camera/focal_scale.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/masks/static_content.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/sequence/frame_thumbnail.h"
#include "rotodom/view_graph/fisheye_check.h"
#include "rotodom/view_graph/zoom_check.h"

namespace rotslam {

/// The result of the first stage.
struct Orientations : OdometryResult {
  bool interrupted = false;                // the observer asked to stop before the sequence's end
  Camera camera;                           // as given, with the readout estimated from the images
  std::optional<ReadoutEstimate> readout;  // set: it was estimated from the images
  FrameMasks masks;                        // as given, with the static content found
  StaticContent static_content;            // parts of the picture that never move
  std::vector<double> timestamps_s;        // by frame id
  std::vector<std::string> image_names;    // by frame id
  std::vector<FrameThumbnail> thumbnails;  // by frame id
  FisheyeCheck fisheye;                    // whether the lens is another one than the calibration's
  std::vector<Zoom> zooms;                 // where the focal length changes
  // Not empty: the zooms are followed. Features, relative rotations and orientations are those that
  // `camera` would have shown without them.
  FocalScales focal_scales;
  // Set: `cam_from_world` and `covariance` are those of images and given orientations together.
  std::optional<GivenRotations> given;
  // Pixels of the images that were worked with per pixel of the original ones, see WorkingSize.
  double working_scale = 1.0;
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

  /// Whether the camera stands from the first frame to the last while things move in front of it:
  /// the orientations are all the same, and there are no matches.
  bool CameraStands() const { return static_content.kind == StaticContentKind::kStanding; }

  /// Whether there are enough frames and edges for orientations; false only when interrupted.
  bool IsUsable() const { return timestamps_s.size() >= 3 && !graph.edges().empty(); }
};

/// Inputs of the first stage beside the frames.
struct OrientationInputs {
  std::shared_ptr<const Vocabulary> vocabulary;  // null: the one that comes with the library
  bool keep_features = true;                     // for the map
  // Set: these are put together with the orientations estimated from the images.
  std::optional<OrientationsFromElsewhere> given;
  FrameLog* log = nullptr;  // null: nothing is recorded
  FrameMasks masks;         // what is to be ignored
  // Off: static content on the picture is tracked like the scene.
  bool find_static_content = true;
  StaticContent static_content;  // found before
  // Check whether the calibration fits the images (Orientations::fisheye, zooms).
  bool check_lens = true;
  // Follow zooms (Orientations::focal_scales).
  bool follow_zooms = true;
};

/// Interpolates the orientation of the frames in `unknown` in time between the nearest other
/// frames. Call it again once those have been refined. Frames with given orientations keep these,
/// rotated as the frames beside them were.
void InterpolateUnknown(const Orientations& orientations,
                        const std::set<FrameId>& unknown,
                        RotationMap& cam_from_world);

/// Relative and absolute orientations as another lens would have shown them: the one that bundle
/// adjustment has found. The result has only what frames between keyframes are registered with.
/// @return  nullopt where they stay as they are: the lens of a calibration changes by less than
///          orientations err, and given orientations do not depend on it.
std::optional<Orientations> ThroughFoundLens(const Orientations& orientations,
                                             const Camera& found,
                                             const SlamOptions& options);

/// Angular velocities of all frames.
RotationRates RatesOf(const Orientations& orientations);

/// Standard deviation of every orientation whose covariance is known, rad, relative to the first
/// frame: the root of the mean variance about the three axes.
std::map<FrameId, double> OrientationSigmas(const Orientations& orientations);

/// Standard deviations of keyframes' orientations that a sensor gives, rad, as priors for bundle
/// adjustment. They include the error that all share, and are scaled as if keypoints had a noise of
/// one pixel, as adjustment assumes, instead of the noise of the edges' matches. Empty without
/// given orientations, and where these drift more than the images.
std::map<FrameId, double> SensorPriors(const Orientations& orientations,
                                       const std::set<FrameId>& keyframes);

/// Scale error of all rotations, from loops along which the camera turned right round: the median
/// of true angle over measured angle. 1 where there is no such loop.
struct RotationScale {
  double factor = 1.0;
  int num_loops = 0;
};
RotationScale RotationScaleOf(const std::vector<LoopCheck>& loops);

}  // namespace rotslam
