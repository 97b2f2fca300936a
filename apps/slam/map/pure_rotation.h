#pragma once

#include <optional>
#include <vector>

#include "ba/pure_rotation.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// What speaks for a model of a sequence.
struct Explanation {
  int num_observations = 0;  // that it explains
  int num_tracks = 0;        // that these belong to
  // Measurements that it has passed as checks: two for each observation that it explains, less the
  // numbers it was free to choose, three for a rotation or position and two (a direction) or three
  // (a point) for each track.
  int redundancy = 0;
  double cost = 0.0;  // half the sum of robust squared residuals, in sigmas
};

Explanation ExplanationBy(const std::vector<BundleSummary>& bundles);
Explanation ExplanationBy(const PureRotationResult& turning);

/// In nats: each check tells how many times smaller residuals are than the limit (in sigmas) within
/// which they count. Of models that pass as many checks the one with smaller residuals has more of
/// it. 0 where nothing is checked.
/// Without a limit (0) all checks count alike but those that were passed before: from one frame to
/// the next a track went on by a match that the epipolar geometry of the two had let through.
/// Source:  Moisan and Stival, A probabilistic criterion to detect rigid point matches, IJCV 2004,
/// for weighing inliers against their precision.
double Evidence(const Explanation& explanation, double limit);

/// Rotations and a lens that explain a sequence better than a moving camera does. A calibration
/// that is off by some percent makes wide turns in place look like movement, and no pair of frames
/// can tell the two apart; all together can. Rotations alone are believed where another lens makes
/// them fit, or where there are no positions at all: blur, noise and images that hardly turn make
/// some pairs look like movement, too. There must be more evidence of them than of positions and
/// points, and they must pass at least a quarter of all checks. Where positions and points leave a
/// third of the observations out, small residuals of the rest only say that these were picked: then
/// all checks count alike. A lens twice as long or more is not believed: a wall that a camera
/// passes looks like a turn with a lens six times as long.
/// @param moving  positions and points; empty where there are none.
/// Cost:  next to nothing where the camera does move: a sample of the tracks tells first.
std::optional<PureRotationResult> DetectPureRotation(const Camera& camera,
                                                     const RotationMap& cam_from_world,
                                                     const std::vector<Track>& tracks,
                                                     const Explanation& moving,
                                                     const BundleOptions& options);

/// Whether pairs of views agree that the camera only turns, seen through the lens that says so:
/// some show no baseline then, where a lens is found well nearly all (1.00 on turns filmed through
/// one 3 to 10 % off; 0.11 to 0.19 on stills of a tripod 25 to 60 deg apart, whose lens bends more
/// than its model). Of a camera in the hand that turns much they do not (0 to 0.01), though tracks
/// that blur leaves in pieces may fit turns and another lens as well as they fit positions.
/// @param tracks    of all frames; bearings through the lens in question.
/// @param focal_px  pixels per radian of that lens.
/// @return  also true where the tracks tell of no pair.
/// Cost:    of a hundred relative rotations: of more edges a sample is asked.
bool PairsAllowPureRotation(const ViewGraph& graph,
                            const std::vector<Track>& tracks,
                            double focal_px,
                            const RelativeRotationOptions& options);

/// A whole sequence, as far as it tells of turns.
struct RotationSources {
  const Camera& camera;
  const ViewGraph& graph;
  const RotationMap& cam_from_world;
  const std::vector<Track>& tracks;
};

/// The segments less those in which the camera stands some way off the axis of its turn, though
/// pairs of views, each for itself, take it for one in place. Most of what such an arm moves looks
/// like a longer lens, and up to what a calibration may have wrong a pair cannot tell it from that;
/// but the lens is the same in all of them. So one is found for each segment. Where it is the given
/// one the camera turns in place. Where it is another one, pairs off the axis of rotation still
/// show a baseline through it, more than one in ten. Where its focal length is too far from the
/// given one to be believed (0.3 %), the whole turn is asked, too, as far as it goes on before and
/// behind.
/// @return  a segment stays, too, where the camera rests for most of it, and where too little is
///          seen to find a lens by. Of one turn all segments go or none.
/// Error:   on simulated turns in place 0 to 3 % of pairs show a baseline, the calibration up to
///          1 % off; on off-axis rotations of 2 and 3 cm, objects 1 to 4 m away, 33 to 100 %; 23 %
///          with 1 cm.
/// Cost:    of one or two adjustments of rotations and directions (2,000 tracks, at most 100
///          frames) and of a hundred relative rotations: 0.3 to 1 s a segment.
std::vector<PureRotationSegment> WithoutOffAxisRotations(std::vector<PureRotationSegment> held,
                                                         const RotationSources& sources,
                                                         const RelativeRotationOptions& options,
                                                         const BundleOptions& bundle_options);

}  // namespace rotslam
