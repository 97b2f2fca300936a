#pragma once

#include <map>
#include <string>
#include <vector>

#include "krot/lp/linear_program.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// How the solver ended; "no" is an answer, not an error.
enum class KrotStatus {
  kNotRun,
  kConverged,       // positions found, brackets as narrow as asked
  kIterationLimit,  // positions found; a bracket stayed wider than asked, or was not asked for
  kCancelled,       // positions found; bisection.on_progress ended the search for the bracket
  kContradiction,   // positions found, but most observations contradict the rotations
  kInfeasible,      // the tracks do not determine positions: none, or no parallax
  kSolverFailed,    // the linear programs gave no structure
};

/// Why an observation has no part in the answer.
enum class RemovalReason {
  kNotFinite,       // bearing is not finite or not of unit length
  kDuplicate,       // a second observation of its frame in one track
  kEpipolar,        // contradicts the rotations in pairs of views
  kReprojection,    // further than loose_factor * threshold_px from its point
  kOtherComponent,  // its view lies in another component than the track's point
};

/// An observation that the solver has taken out.
struct RemovedObservation {
  TrackId track;
  FrameId frame;
  RemovalReason reason;
};

/// An observation that holds the optimum: its residual is within the asked gap of gamma_high.
struct ActiveObservation {
  TrackId track;
  FrameId frame;
};

/// Positions, points, and how far the largest residual is from the least possible one.
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
  // The bracket covers every observation that the triangulation from the start's positions kept (to
  // loose_factor thresholds), less than 80 deg off the axis. Their number, and that of the tracks:
  int num_bracket_observations = 0;
  int num_bracket_tracks = 0;
  std::vector<ActiveObservation> active;    // of the component that has gamma_high
  int num_programs = 0;                     // linear programs solved
  int num_grown_views = 0;                  // views placed by resection
  std::vector<RemovedObservation> removed;  // of tracks that have a point, and unusable ones of any
  double seconds = 0.0;

  /// How far the largest residual can be from the least possible one, as a share of it; one where
  /// no bracket was asked for.
  [[nodiscard]] double Gap() const { return gamma_high > 0.0 ? 1.0 - gamma_low / gamma_high : 0.0; }

  /// Positions are there and gamma_high is finite, whatever stopped us.
  [[nodiscard]] bool Usable() const { return gamma_high < kInfinity && !center_in_world.empty(); }
};

/// Name of a status or reason as the summary file writes it.
std::string ToString(KrotStatus status);
std::string ToString(RemovalReason reason);

}  // namespace rotslam
