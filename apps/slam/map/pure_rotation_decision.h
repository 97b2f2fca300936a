#pragma once

#include <optional>
#include <vector>

#include "ba/rotation_adjustment.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// How well a model explains a sequence.
struct Explanation {
  int num_observations = 0;  // explained by the model
  int num_tracks = 0;        // of the explained observations
  // Number of measurements that check the model: two for each explained observation, less the free
  // parameters, which are three for a rotation or a position and two (a direction) or three (a
  // point) for each track.
  int redundancy = 0;
  double cost = 0.0;  // half the sum of robust squared residuals, in sigmas
};

Explanation ExplanationBy(const std::vector<BundleSummary>& bundles);
Explanation ExplanationBy(const PureRotationResult& rotation);

/// Evidence for a model, nats: each check contributes the logarithm of the outlier threshold over
/// the size of the residuals. Of two models with as many checks the one with smaller residuals has
/// more evidence; without checks it is 0.
/// Without a threshold (0) every check counts alike, except those that the tracks have passed
/// before: two successive observations of a track already agreed with the epipolar geometry of
/// their frames.
/// Source:  Moisan and Stival, A probabilistic criterion to detect rigid point matches, IJCV 2004,
/// for weighing inliers against their precision.
double Evidence(const Explanation& explanation, double threshold);

/// Finds rotations and a lens that explain a sequence better than a moving camera does.
///
/// A focal length that is wrong by some percent makes a wide pure rotation look like translation.
/// No pair of frames can tell the two apart; all frames together can. Pure rotation is accepted
/// where another lens makes it fit, or where there are no positions at all, since blur, noise and
/// small rotations also make single pairs look like translation. It needs more evidence than
/// positions and points, and at least a quarter of all checks. Where positions and points leave out
/// a third of the observations, small residuals of the others are no evidence (the outliers were
/// selected), and all checks count alike. A lens at least twice as long as given is not accepted: a
/// wall that a camera passes by fits a rotation through a lens six times as long.
/// @param moving  evidence for positions and points; empty where there are none.
/// Cost:    small where the camera translates: a sample of the tracks is tested first.
std::optional<PureRotationResult> DetectPureRotation(const Camera& camera,
                                                     const RotationMap& cam_from_world,
                                                     const std::vector<Track>& tracks,
                                                     const Explanation& moving,
                                                     const BundleOptions& options);

/// Whether the relative rotations of pairs of views, computed with the lens of DetectPureRotation,
/// allow a pure rotation: enough of the pairs must show no baseline. With the right lens nearly all
/// pairs of a pure rotation show none; stills of a tripod with a lens model that is too simple show
/// none in one pair of ten. Of a hand-held camera that rotates and translates one pair in a hundred
/// or fewer shows none, although short tracks may fit rotations through another lens.
/// @param tracks    of all frames; bearings through the lens in question.
/// @param focal_px  pixels per radian of that lens.
/// @return  also true where the tracks connect no pair.
/// Cost:    one hundred relative rotations; of more edges a sample is used.
bool PairsAllowPureRotation(const ViewGraph& graph,
                            const std::vector<Track>& tracks,
                            double focal_px,
                            const RelativeRotationOptions& options);

/// The inputs of WithoutOffAxisRotations.
struct RotationSources {
  const Camera& camera;
  const ViewGraph& graph;
  const RotationMap& cam_from_world;
  const std::vector<Track>& tracks;
};

/// Removes the segments in which the camera rotates about an axis that does not pass through its
/// centre, although pairs of views show no baseline.
///
/// Such a rotation moves points almost as a longer lens would, and a pair cannot tell the
/// difference from an error of the calibration; but the lens is the same in all segments. A lens is
/// therefore estimated for each segment. If it is the given one, the rotation is pure. If it is
/// another one and the rotation is off axis, more than one pair in ten still shows a baseline with
/// that lens. If its focal length differs from the given one by more than 0.3 %, the rotation
/// before and after the segment is tested together with it.
/// @return  a segment stays, too, where the camera is at rest for most of it, and where too few
///          points are seen to estimate a lens. The segments of one rotation stay or go together.
/// Error:   share of pairs with a baseline on simulated rotations: 0 to 3 % for pure ones with a
///          calibration off by up to 1 %; 33 to 100 % for 2 and 3 cm off the axis with objects at 1
///          to 4 m; 23 % for 1 cm.
/// Cost:    one or two adjustments of rotations and directions (2,000 tracks, at most 100 frames)
///          and a hundred relative rotations: 0.3 to 1 s per segment.
std::vector<PureRotationSegment> WithoutOffAxisRotations(std::vector<PureRotationSegment> segments,
                                                         const RotationSources& sources,
                                                         const RelativeRotationOptions& options,
                                                         const BundleOptions& bundle_options);

}  // namespace rotslam
