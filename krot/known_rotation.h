#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "krot/bisection.h"
#include "krot/linear_start.h"
#include "krot/lp.h"
#include "krot/robust_start.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

struct KrotOptions {
  // Which answer gives the positions: "l1", the least sum of misses, forgives outliers and is the
  // better start for bundle adjustment; "bisection", the least largest residual of what l1 kept;
  // "linear", equations between the centres (SolveLinearStart) on the same. All lead bundle
  // adjustment to one minimum.
  // The bracket is found either way (see use_bracket).
  std::string start = "l1";
  // Image bound of the L1 start: observations within it cost nothing. It must cover feature noise
  // and rotation error together: 0.3 deg moves a point by 3.7 px at f = 700.
  double threshold_px = 4.0;
  // Where orientations are less certain than that, the bound is this many standard deviations of a
  // track's keypoints and of its views' orientations together.
  double threshold_sigmas = 3.0;
  // Observations of triangulated points are kept up to this many thresholds. The positions are a
  // start, good to a few metres over 150: a tight test here throws good observations away.
  double loose_factor = 2.0;
  // Find [gamma_low, gamma_high] of the observations the L1 start kept.
  bool use_bracket = true;
  // Views that go into one linear program. Components with more start from this many and grow view
  // by view from there.
  int max_lp_views = 150;
  // Components with more views get no lower bound: gamma_low stays zero for them.
  int max_bracket_views = 150;
  // Observations per view in the linear programs.
  int observations_per_view = 40;
  // Tracks under this parallax come into the linear programs last, for the sake of conditioning.
  double min_lp_parallax_deg = 1.0;
  // Points of the answer are seen under at least this angle.
  double min_point_angle_deg = 0.5;
  // Below this flow beyond rotation a track says nothing of positions; noise and rotation error
  // alone reach a few px.
  double still_parallax_px = 4.0;
  // Known points a view must see to belong to a component.
  int min_shared_points = 8;
  // Remove what contradicts the rotations pair by pair before anything else.
  bool use_epipolar_filter = true;
  // Observations further than this off the optical axis have no bounded image coordinates and stay
  // out of the linear programs (they are triangulated all the same).
  double max_off_axis_deg = 80.0;
  RobustStartOptions robust_start;
  LinearStartOptions linear_start;
  BisectionOptions bisection;
  std::uint64_t seed = 1;
  int num_threads = 1;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("start", start);
    visit("threshold_px", threshold_px);
    visit("threshold_sigmas", threshold_sigmas);
    visit("loose_factor", loose_factor);
    visit("use_bracket", use_bracket);
    visit("max_lp_views", max_lp_views);
    visit("max_bracket_views", max_bracket_views);
    visit("observations_per_view", observations_per_view);
    visit("min_lp_parallax_deg", min_lp_parallax_deg);
    visit("min_point_angle_deg", min_point_angle_deg);
    visit("still_parallax_px", still_parallax_px);
    visit("min_shared_points", min_shared_points);
    visit("use_epipolar_filter", use_epipolar_filter);
    visit("max_off_axis_deg", max_off_axis_deg);
    visit("robust_start", robust_start);
    visit("linear_start", linear_start);
    visit("bisection", bisection);
    visit("seed", seed);
  }
};

enum class KrotStatus {
  kNotRun,
  kConverged,       // positions found, brackets as narrow as asked
  kIterationLimit,  // positions found; a bracket stayed wider than asked, or was not asked for
  kInfeasible,      // the tracks do not determine positions: none, or no parallax
  kSolverFailed,    // the linear programs gave no structure
};

enum class RemovalReason {
  kNotFinite,       // bearing is not finite or not of unit length
  kDuplicate,       // a second observation of its frame in one track
  kEpipolar,        // contradicts the rotations in pairs of views
  kReprojection,    // further than loose_factor * threshold_px from its point
  kOtherComponent,  // its view lies in another component than the track's point
};

struct RemovedObservation {
  TrackId track;
  FrameId frame;
  RemovalReason reason;
};

struct KrotSolution {
  KrotStatus status = KrotStatus::kNotRun;
  std::string message;        // one sentence for a person
  CenterMap center_in_world;  // views that could not be placed are absent
  PointMap point_in_world;
  // Rigid component of each placed view, 0 the largest. Each has an origin (its first view's
  // centre) and a scale (median depth one) of its own; placing them together is the caller's.
  std::map<FrameId, int> component;
  // The least possible largest residual (per image axis, unit focal length) of the observations the
  // bracket covers lies in [gamma_low, gamma_high]; the largest over the components.
  double gamma_low = 0.0;
  double gamma_high = kInfinity;
  // What the bracket covers: the selected tracks' observations that the L1 start fits to
  // threshold_px, of the views in linear programs.
  int num_bracket_observations = 0;
  int num_bracket_tracks = 0;
  int num_programs = 0;                     // linear programs solved
  int num_grown_views = 0;                  // views placed by resection
  std::vector<RemovedObservation> removed;  // of tracks that have a point, and unusable ones of any
  double seconds = 0.0;

  /// Positions are there and gamma_high is finite, whatever stopped us.
  [[nodiscard]] bool Usable() const { return gamma_high < kInfinity && !center_in_world.empty(); }
};

/// Finds camera centres and points, rotations being known.
/// @param cam_from_world  one rotation per view named in `tracks`; further ones are ignored.
/// @param tracks          bearings unit, in the camera frame.
/// @param camera          converts pixels to normalised units (MeanFocal) and nothing else.
/// @param sigma_rad       standard deviations of the orientations against the first one, where
/// known.
///                        Between views the difference of their variances counts, as for an
///                        odometry's chain: what views share moves them together.
/// @return  see KrotSolution. Throws std::invalid_argument when an option is out of range, a track
///          names a view without rotation, or the camera has no focal length.
/// Error:   truth to 1e-6 (relative to the scene) on clean scenes (KnownRotation tests).
/// Cost:    linear programs over observations_per_view observations of each view; everything else
///          is linear in the observations. On a street with 0.7 px noise, one thread: 100 views,
///          10k tracks, 64k observations 2.5 to 3.5 s of which the bracket 2 s; 200 views, 40k
///          tracks, 258k observations 4.3 s without bracket.
/// Source:  Kahl & Hartley, Multiple-View Geometry under the L-infinity Norm, PAMI 2008, for the
///          bracket; Dalalyan & Keriven, L1-penalized robust estimation for a class of inverse
///          problems arising in multiview geometry, NIPS 2009, for the L1 start; resection as in
///          Zhang, Chin et al., A Fast Resection-Intersection Method for the Known Rotation
///          Problem, CVPR 2018.
KrotSolution SolveKnownRotation(const RotationMap& cam_from_world,
                                const std::vector<Track>& tracks,
                                const Camera& camera,
                                const KrotOptions& options,
                                const std::map<FrameId, double>& sigma_rad = {});

/// Name of a status or reason as the summary file writes it.
std::string ToString(KrotStatus status);
std::string ToString(RemovalReason reason);

}  // namespace rotslam
