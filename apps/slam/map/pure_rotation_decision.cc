#include "apps/slam/map/pure_rotation_decision.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "apps/slam/map/refinement.h"
#include "rotodom/types/median.h"
#include "rotodom/types/track.h"

namespace rotslam {
namespace {

// Tracks of the sample that is tested before all tracks are.
constexpr std::size_t kSampledTracks = 2000;
// Lower bound of the mean squared residual, in sigmas squared, so that perfect data have finite
// evidence.
constexpr double kLeastVariance = 1e-4;
// Share of all measurements that an accepted pure rotation must explain.
constexpr double kMinShare = 0.25;
// Share of the observations that positions and points must explain for their residuals to count as
// evidence. Of a moving camera they explain 0.80 and more, of a rotating tripod 0.4 to 0.6.
constexpr double kMostObservations = 2.0 / 3.0;
// Thresholds for the sample are lower by this factor, since it has fewer observations to estimate
// the lens from.
constexpr double kSampleShare = 0.8;
// Largest factor between the given and the estimated focal length; guesses are better than that.
constexpr double kMaxFocalFactor = 2.0;
// Pairs of views tested for a baseline, and the smallest share of them without one in a pure
// rotation.
constexpr std::size_t kSampledEdges = 100;
constexpr double kMinShareWithoutBaseline = 0.05;
// The smallest share of them without a baseline in a pure rotation, with the lens estimated for it.
constexpr double kInPlaceShareWithoutBaseline = 0.9;
// Remaining error of the estimated lens, see BaselineTestOptions::lens_error.
constexpr double kFoundLensError = 1e-4;
// Largest relative error of a calibrated focal length, as a multiple of
// BaselineTestOptions::lens_error.
constexpr double kCredibleErrors = 3.0;
// Frames from which the lens of a segment is estimated; more add time and little accuracy.
constexpr std::size_t kMaxLensFrames = 100;

bool IsLensCredible(const Camera& given, const Camera& refined) {
  const double factor = refined.MeanFocal() / given.MeanFocal();
  return factor <= kMaxFocalFactor && factor >= 1.0 / kMaxFocalFactor;
}

// Elements at equal steps, at most `max_size`.
template <class T>
std::vector<T> SampleOf(const std::vector<T>& all, std::size_t max_size) {
  const std::size_t stride = (all.size() + max_size - 1) / max_size;
  std::vector<T> sample;
  for (std::size_t k = 0; k < all.size(); k += stride) sample.push_back(all[k]);
  return sample;
}

// The observations of some frames, by track.
using ObservationsOfFrames = std::map<FrameId, std::vector<std::pair<TrackId, const Observation*>>>;

ObservationsOfFrames ObservationsOf(const std::vector<RelativeRotation>& edges,
                                    const std::vector<Track>& tracks) {
  ObservationsOfFrames observations;
  for (const RelativeRotation& edge : edges) {
    observations[edge.i];
    observations[edge.j];
  }
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) {
      const auto frame = observations.find(observation.frame);
      if (frame != observations.end()) frame->second.emplace_back(track.id, &observation);
    }
  }
  for (auto& [frame, seen] : observations) std::sort(seen.begin(), seen.end());
  return observations;
}

std::vector<BearingPair> PairsOf(const RelativeRotation& edge,
                                 const ObservationsOfFrames& observations) {
  std::vector<BearingPair> pairs;
  const auto& in_j = observations.at(edge.j);
  auto next = in_j.begin();
  for (const auto& [track, in_i] : observations.at(edge.i)) {
    while (next != in_j.end() && next->first < track) ++next;
    if (next == in_j.end()) break;
    if (next->first == track) pairs.push_back({in_i->bearing, next->second->bearing});
  }
  return pairs;
}

// Number of pairs of views tested for a baseline, and of those that show none.
struct BaselineVotes {
  int tested = 0;
  int without = 0;
};

BaselineVotes TestPairs(const std::vector<RelativeRotation>& edges,
                        const std::vector<Track>& tracks,
                        double focal_px,
                        const RelativeRotationOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  const std::vector<RelativeRotation> sample = SampleOf(edges, kSampledEdges);
  const ObservationsOfFrames observations = ObservationsOf(sample, tracks);
  BaselineVotes votes;
  for (const RelativeRotation& edge : sample) {
    const auto estimate = EstimateRelativeRotation(
        {PairsOf(edge, observations)}, edge.j_from_i, focal_px, options, kSeed);
    if (!estimate) continue;
    ++votes.tested;
    votes.without += estimate->rotation_only ? 1 : 0;
  }
  return votes;
}

// Whether the camera is at rest for most of the segment.
bool IsAtRest(const PureRotationSegment& segment) {
  int num_still = 0;
  for (const FrameRange& still : segment.still)
    num_still += still.last.value - still.first.value + 1;
  return 2 * num_still > segment.last.value - segment.first.value + 1;
}

RotationMap RotationsOf(const PureRotationSegment& segment, const RotationMap& cam_from_world) {
  return RotationMap(cam_from_world.find(segment.first), cam_from_world.upper_bound(segment.last));
}

// Orientations of the segment and of the frames before and after it, as far as the camera goes on
// rotating in the same direction at half the median rate of the segment or faster.
RotationMap WholeRotation(const PureRotationSegment& segment, const RotationMap& cam_from_world) {
  using Frame = RotationMap::const_iterator;
  const auto step = [](Frame from) -> Eigen::Vector3d {
    return (std::next(from)->second * from->second.Inverse()).Log();
  };
  Frame first = cam_from_world.find(segment.first);
  Frame last = cam_from_world.find(segment.last);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (Frame frame = first; frame != last; ++frame) sum += step(frame);
  const Eigen::Vector3d axis = sum.normalized();
  std::vector<double> steps;
  for (Frame frame = first; frame != last; ++frame) steps.push_back(axis.dot(step(frame)));
  const double enough = 0.5 * Median(std::move(steps));
  const auto goes_on = [&](Frame from) { return axis.dot(step(from)) > enough; };
  while (first != cam_from_world.begin() && goes_on(std::prev(first))) --first;
  while (std::next(last) != cam_from_world.end() && goes_on(last)) ++last;
  return RotationMap(first, std::next(last));
}

// Estimates rotations, directions and lens of a pure rotation from a sample of its frames and
// tracks.
PureRotationResult RefineRotationAndLens(const Camera& camera,
                                         const RotationMap& turn,
                                         const std::vector<Track>& tracks,
                                         BundleOptions options) {
  std::vector<FrameId> frames;
  for (const auto& [frame, rotation] : turn) frames.push_back(frame);
  frames = SampleOf(frames, kMaxLensFrames);
  RotationMap rotations;
  for (const FrameId frame : frames) rotations[frame] = turn.at(frame);
  const std::vector<Track> seen = RestrictTracks(tracks, {frames.begin(), frames.end()}, 3);
  options.lens.given_sigmas.reset();
  options.lens.refine_focal = true;
  options.lens.refine_principal_point = true;
  options.lens.refine_distortion = true;
  return RefinePureRotation(camera, rotations, SampleOf(seen, kSampledTracks), options);
}

// A rotation seen with the lens that fits it best.
struct RotationThroughLens {
  bool is_another = false;      // that lens fits better than the given one
  bool is_credible = true;      // its focal length is within the error of a calibration
  bool shows_baseline = false;  // more pairs have a baseline than in a pure rotation
};

RotationThroughLens TestWithBestLens(const RotationMap& turn,
                                     const RotationSources& sources,
                                     RelativeRotationOptions options,
                                     const BundleOptions& bundle_options) {
  std::set<FrameId> frames;
  for (const auto& [frame, rotation] : turn) frames.insert(frame);
  std::vector<Track> tracks = RestrictTracks(sources.tracks, frames, 3);
  const PureRotationResult in_place =
      RefineRotationAndLens(sources.camera, turn, tracks, bundle_options);
  if (!in_place.Usable() || !in_place.lens_refined) return {};

  std::vector<RelativeRotation> edges;
  for (const RelativeRotation& edge : sources.graph.edges()) {
    // Neighbouring frames have the shortest baselines, which are hard to detect.
    const bool are_neighbours = edge.j.value - edge.i.value == 1;
    if (!are_neighbours && frames.contains(edge.i) && frames.contains(edge.j)) {
      edges.push_back(edge);
    }
  }
  tracks = WithBearingsOf(in_place.camera, std::move(tracks));
  const double credible_change = kCredibleErrors * options.baseline.lens_error;
  options.baseline.lens_error = kFoundLensError;
  const BaselineVotes votes = TestPairs(edges, tracks, in_place.camera.MeanFocal(), options);
  const double change = std::abs(in_place.camera.MeanFocal() / sources.camera.MeanFocal() - 1.0);
  return {
      true, change <= credible_change, votes.without < kInPlaceShareWithoutBaseline * votes.tested};
}

// The frames of the whole rotation around the segment, where the camera is off its axis.
std::optional<FrameRange> OffAxisRotation(const PureRotationSegment& segment,
                                          const RotationSources& sources,
                                          const RelativeRotationOptions& options,
                                          const BundleOptions& bundle_options) {
  if (IsAtRest(segment)) return std::nullopt;
  const auto test = [&](const RotationMap& turn) {
    return TestWithBestLens(turn, sources, options, bundle_options);
  };
  const RotationThroughLens alone = test(RotationsOf(segment, sources.cam_from_world));
  if (!alone.is_another) return std::nullopt;
  const RotationMap whole = WholeRotation(segment, sources.cam_from_world);
  if (!alone.shows_baseline && (alone.is_credible || !test(whole).shows_baseline)) {
    return std::nullopt;
  }
  return FrameRange{whole.begin()->first, whole.rbegin()->first};
}

}  // namespace

Explanation ExplanationBy(const std::vector<BundleSummary>& bundles) {
  Explanation sum;
  for (const BundleSummary& bundle : bundles) {
    const BundleSupport& support = bundle.support;
    sum.num_observations += support.num_observations;
    sum.num_tracks += support.num_points;
    sum.redundancy +=
        2 * support.num_observations - 3 * support.num_points - 6 * support.num_frames;
    sum.cost += support.cost;
  }
  return sum;
}

Explanation ExplanationBy(const PureRotationResult& rotation) {
  const int num_free =
      2 * rotation.num_directions + 3 * static_cast<int>(rotation.cam_from_world.size());
  return {.num_observations = rotation.num_observations,
          .num_tracks = rotation.num_directions,
          .redundancy = 2 * rotation.num_observations - num_free,
          .cost = rotation.final_cost};
}

double Evidence(const Explanation& explanation, double limit) {
  if (explanation.redundancy <= 0) return 0.0;
  if (limit == 0.0) {
    const int num_matches = explanation.num_observations - explanation.num_tracks;
    return std::max(0, explanation.redundancy - num_matches);
  }
  const double variance = std::max(kLeastVariance, 2.0 * explanation.cost / explanation.redundancy);
  return explanation.redundancy * std::max(0.0, 0.5 * std::log(limit * limit / variance));
}

std::optional<PureRotationResult> DetectPureRotation(const Camera& camera,
                                                     const RotationMap& cam_from_world,
                                                     const std::vector<Track>& tracks,
                                                     const Explanation& moving,
                                                     const BundleOptions& options) {
  const int num_given = NumObservations(tracks);
  const bool residuals_tell = moving.num_observations >= kMostObservations * num_given;
  const double limit = residuals_tell ? options.fine.max_error_px : 0.0;
  const double evidence_of_moving = Evidence(moving, limit);
  // Whether a pure rotation fitted to `share` of all observations passes enough checks, and has
  // more evidence than positions and points.
  const auto is_accepted = [&](const PureRotationResult& rotation, double share) {
    const Explanation explanation = ExplanationBy(rotation);
    return rotation.Usable() && IsLensCredible(camera, rotation.camera) &&
           explanation.redundancy > share * kMinShare * 2 * num_given &&
           Evidence(explanation, limit) > share * evidence_of_moving;
  };
  const std::vector<Track> sample = SampleOf(tracks, kSampledTracks);
  if (sample.size() < tracks.size()) {
    const double share = static_cast<double>(NumObservations(sample)) / num_given;
    const PureRotationResult sampled = RefinePureRotation(camera, cam_from_world, sample, options);
    if (!is_accepted(sampled, kSampleShare * share)) return std::nullopt;
  }
  PureRotationResult rotation = RefinePureRotation(camera, cam_from_world, tracks, options);
  // With the given lens the tests of pairs of views are more reliable than this one. They count
  // unless they led to no map.
  const bool has_map = moving.num_observations > 0;
  if (has_map && !rotation.lens_refined) return std::nullopt;
  if (!is_accepted(rotation, 1.0)) return std::nullopt;
  return rotation;
}

bool PairsAllowPureRotation(const ViewGraph& graph,
                            const std::vector<Track>& tracks,
                            double focal_px,
                            const RelativeRotationOptions& options) {
  const BaselineVotes votes = TestPairs(graph.edges(), tracks, focal_px, options);
  return votes.without >= kMinShareWithoutBaseline * votes.tested;
}

std::vector<PureRotationSegment> WithoutOffAxisRotations(std::vector<PureRotationSegment> segments,
                                                         const RotationSources& sources,
                                                         const RelativeRotationOptions& options,
                                                         const BundleOptions& bundle_options) {
  std::vector<FrameRange> off_axis;
  for (const PureRotationSegment& segment : segments) {
    if (const auto turn = OffAxisRotation(segment, sources, options, bundle_options)) {
      off_axis.push_back(*turn);
    }
  }
  std::erase_if(segments, [&](const PureRotationSegment& segment) {
    return !IsAtRest(segment) &&
           std::any_of(off_axis.begin(), off_axis.end(), [&](const FrameRange& turn) {
             return segment.first <= turn.last && turn.first <= segment.last;
           });
  });
  return segments;
}

}  // namespace rotslam
