#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "krot/bracket/bisection_options.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// The solution that gives the positions. All lead bundle adjustment to the same minimum.
enum class KrotStart {
  kL1,           // least sum of misses: forgives outliers, the better start for bundle adjustment
  kBisection,    // least largest residual of what kL1 kept
  kPositioning,  // rays nearest to what was seen (SolveGlobalPositioning), no linear programs
};
/// Their names in option files: "l1", "bisection", "positioning".
std::span<const char* const> OptionWords(KrotStart);

/// All parts of the known-rotation solver. The defaults run a real sequence untouched.
struct KrotOptions {
  // The bracket is found with any of them (see use_bracket).
  KrotStart start = KrotStart::kL1;
  // Image bound of the L1 start: observations within it cost nothing. It must cover feature noise
  // and rotation error together: 0.3 deg moves a point by 3.7 px at f = 700.
  double threshold_px = 4.0;
  // Observations of triangulated points are kept up to this many thresholds. The positions are a
  // start, good to a few metres over 150: a tight test here throws good observations away.
  double loose_factor = 2.0;
  // Find [gamma_low, gamma_high] of all observations that fit the start.
  bool use_bracket = true;
  // Components with more views keep the start's residual as gamma_high and prove no gamma_low,
  // unless `start` needs the bracket: positions do not gain by it, and its time grows faster than
  // the sequence (docs/performance.md).
  int max_bracket_views = 1000;
  // Views that go into the start's programs together. Components with more are solved in blocks of
  // so many, which overlap by a quarter and are joined by what they share (JoinBlocks). Larger ones
  // take more iterations a view, ten times the time at 1,000, and bundle adjustment ends at the
  // same cost from either.
  int max_lp_views = 150;
  // Observations per view in the start's programs.
  int observations_per_view = 40;
  // Points of the answer are seen under at least this angle.
  double min_point_angle_deg = 0.5;
  // Remove what contradicts the rotations pair by pair before anything else.
  bool use_epipolar_filter = true;
  BisectionOptions bisection;
  std::uint64_t seed = 1;
  int num_threads = 1;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("start", start);
    visit("threshold_px", threshold_px);
    visit("use_bracket", use_bracket);
    visit("max_bracket_views", max_bracket_views);
    visit("max_lp_views", max_lp_views);
    visit("observations_per_view", observations_per_view);
    visit("min_point_angle_deg", min_point_angle_deg);
    visit("use_epipolar_filter", use_epipolar_filter);
    visit("bisection", bisection);
  }
};

/// Those of the options that are lengths and angles, in the units the stages use.
struct KrotUnits {
  double focal_px;
  double gamma;            // threshold_px, normalised
  double still_rad;        // kStillParallaxPx
  double lp_parallax_rad;  // kMinLpParallaxDeg
  double point_angle_rad;  // min_point_angle_deg
  double loose_rad;        // loose_factor * threshold_px
  double min_z;            // cosine of kMaxOffAxisDeg

  KrotUnits(const KrotOptions& options, const Camera& camera);
};

}  // namespace rotslam
