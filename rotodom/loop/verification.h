#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/matching/matching.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/types/maps.h"
#include "rotodom/view_graph/estimate_edges.h"

namespace rotslam {

/// Tests that a candidate passes to count as the same place.
struct VerificationOptions {
  // An edge back to an older place needs this many matches that agree, and this share of all that
  // look alike. Of wrong places' matches chance makes up to a third agree.
  int min_inliers = 40;
  double min_inlier_ratio = 0.45;
  // An edge that is less certain of its rotation than this, one standard deviation of the least
  // certain axis, tells nothing of drift. Up to the second bound it still confirms others: matches
  // that agree are the same place, however little their points say of the rotation.
  double max_sigma_deg = 0.2;
  double max_witness_sigma_deg = 0.6;
  // Where the camera turned, corners err along the image's motion, and a translation along it hides
  // that. So such edges are asked again with corners that much less certain along it, per pixel of
  // noise and px/s. One is taken, as found then, if it says the same within max_cycle_deg, or if
  // an edge from another place does; else there is no edge, and the matches are
  // all that a loop brings. Zero asks once. TUM fr1_rpy, three seeds: 56, 45, 53 edges, 8, 5, 7 of
  // them more than 2 deg off, with zero; 21, 21, 26, the farthest 1.3, 1.6, 1.7 deg off, with 4 ms.
  // Twice BundleOptions::blur_s_per_px, which fits residuals best: a check has to allow for more.
  double blur_s_per_px = 0.004;
  // With a rolling shutter the rows of a moving camera see the scene from different places. From
  // frame to frame that is much the same; to an edge between two visits it adds this, on each axis.
  double shutter_sigma_deg = 0.3;
  // Rotations around short cycles, present place - old place - its neighbour, close to this. Two
  // views of a plane, or with little overlap, have several solutions; over three views only the
  // right one is the same. Or within so many deviations of the two edges, where that is more: real
  // edges between visits are four to eight times as far off as their matches alone can tell.
  double max_cycle_deg = 1.0;
  double max_cycle_sigmas = 4.5;
  // Edges of one place that must agree so.
  int min_edges = 2;
  // Of edges at different frames, instead: these must look in directions that differ by this, since
  // frames that see the same err alike.
  double min_witness_deg = 5.0;
  // With fewer matches in all than this, the place before must have led to the same places.
  int sure_inliers = 200;
  // Orientations may have drifted by this, and by so much per square root of a frame between the
  // two places: a loop that contradicts them by more is a wrong place with a similar look.
  double max_drift_deg = 3.0;
  double max_drift_deg_per_sqrt_frame = 0.3;
  // With a wrong focal length all turns come out too large or too small: orientations may be wrong
  // by up to this share of the turns between them, too, when all turns share it.
  double max_turn_error = 0.1;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("min_inliers", min_inliers);
    visit("max_drift_deg", max_drift_deg);
  }
};

/// A loop with all rotations between its ends scaled by the same factor, so that they fit the
/// measured rotation best.
struct ScaledLoop {
  double turn_scale = 1.0;  // 1 where the sum of the rotations is too small to estimate it
  double angle_deg = 0.0;   // remaining rotation around the loop
};

/// Estimates that scale. In a loop with a full turn it measures the focal length: a scale above one
/// means that the true focal length is shorter.
/// @param cam_from_world  orientations of both ends and of all frames between them.
/// @param max_turn_error  largest difference of the scale from one.
ScaledLoop ScaleRotations(const RotationMap& cam_from_world,
                          const RelativeRotation& loop,
                          double max_turn_error);

/// The result of comparing a place with an older one.
struct LoopEvidence {
  // The older place of the most certain edge; the candidate when there is none.
  FrameId match;
  int num_inliers = 0;  // of that edge
  // Rotation around the loop: angle between that edge and the present orientations.
  double angle_deg = 0.0;
  ScaledLoop scaled;
  bool accepted = false;
  // Edges that agree with each other and are certain, the most certain one first, whether or not
  // the loop is accepted.
  std::vector<EdgeWithMatches> connections;
  // Edges whose rotation changes when motion blur is taken into account: they prove the same
  // points, but no relative rotation.
  std::vector<EdgeWithMatches> unproven;
};

/// A place and the older ones that it is compared with.
struct PlaceComparison {
  const Features& view;                         // described features of the present place
  std::span<const Features* const> old_places;  // described; the candidate first, then neighbours
  const RotationMap& cam_from_world;  // present orientations of all of them and of those between
  const RotationRates& rates;         // angular velocities of the view and old places, where known
  int num_consistent = 0;             // as in LoopCandidate
  // The two places are in one component of the view-graph, so that their orientations are wrong by
  // drift only.
  bool are_linked = false;
};

/// How places are matched and relative rotations estimated.
struct VerificationTools {
  MatchingOptions matching;
  RelativeRotationOptions relative_rotation;
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Verifies a candidate geometrically: matches descriptors and estimates relative rotations as the
/// odometry does, and tests whether enough of the edges are consistent with each other and with the
/// orientations between the two places.
LoopEvidence VerifyLoop(const PlaceComparison& places,
                        const Camera& camera,
                        const VerificationOptions& options,
                        const VerificationTools& tools);

}  // namespace rotslam
