#include "apps/slam/map/pure_rotation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "apps/slam/map/refinement.h"
#include "rotodom/tracks/keyframes.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Tracks that tell whether it is worth while to look at all of them.
constexpr std::size_t kSampledTracks = 2000;
// Smallest mean square of residuals, in sigmas, that tells anything: 0.01 of a sigma.
constexpr double kLeastVariance = 1e-4;
// Of all measurements, what a believable explanation passes.
constexpr double kMinShare = 0.25;
// Of all observations, what a model explains whose residuals tell how good it is: positions and
// points explain 0.80 and more of what a moving camera sees, 0.4 to 0.6 of a tripod's turn.
constexpr double kMostObservations = 2.0 / 3.0;
// A sample may explain this much less than is asked for: it has fewer observations to find the
// lens with.
constexpr double kSampleShare = 0.8;
// No calibration, guessed or not, is wrong by more than this factor.
constexpr double kMaxFocalFactor = 2.0;
// Pairs of views that tell whether the camera moves, and the share of them without a baseline that
// a turn has at least.
constexpr std::size_t kSampledEdges = 100;
constexpr double kMinShareWithoutBaseline = 0.05;
// The share of them that a turn in place has at least, seen through the lens found for it.
constexpr double kInPlaceShareWithoutBaseline = 0.9;
// What such a lens still has wrong, as BaselineTestOptions::lens_error.
constexpr double kFoundLensError = 1e-4;
// A calibration is no farther off than so many times BaselineTestOptions::lens_error.
constexpr double kCredibleErrors = 3.0;
// Frames of a turn that tell its lens.
constexpr std::size_t kMaxLensFrames = 100;

bool IsLensCredible(const Camera& given, const Camera& refined) {
  const double factor = refined.MeanFocal() / given.MeanFocal();
  return factor <= kMaxFocalFactor && factor >= 1.0 / kMaxFocalFactor;
}

// Evenly over all of them.
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

// Pairs of views asked for a baseline, and those that show none.
struct PairVotes {
  int asked = 0;
  int without = 0;
};

PairVotes AskPairs(const std::vector<RelativeRotation>& edges,
                   const std::vector<Track>& tracks,
                   double focal_px,
                   const RelativeRotationOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  const std::vector<RelativeRotation> sample = SampleOf(edges, kSampledEdges);
  const ObservationsOfFrames observations = ObservationsOf(sample, tracks);
  PairVotes votes;
  for (const RelativeRotation& edge : sample) {
    const auto estimate = EstimateRelativeRotation(
        PairsOf(edge, observations), edge.j_from_i, focal_px, options, kSeed);
    if (!estimate) continue;
    ++votes.asked;
    votes.without += estimate->rotation_only ? 1 : 0;
  }
  return votes;
}

// Whether the camera rests for most of the segment.
bool IsRest(const PureRotationSegment& stretch) {
  int num_still = 0;
  for (const FrameRange& still : stretch.still)
    num_still += still.last.value - still.first.value + 1;
  return 2 * num_still > stretch.last.value - stretch.first.value + 1;
}

RotationMap RotationsOf(const PureRotationSegment& stretch, const RotationMap& cam_from_world) {
  return RotationMap(cam_from_world.find(stretch.first), cam_from_world.upper_bound(stretch.last));
}

// The segment and what is before and behind it, as long as the camera turns the same way there, and
// at least half as fast as is usual in it.
RotationMap WholeTurn(const PureRotationSegment& stretch, const RotationMap& cam_from_world) {
  using Frame = RotationMap::const_iterator;
  const auto step = [](Frame from) -> Eigen::Vector3d {
    return (std::next(from)->second * from->second.Inverse()).Log();
  };
  Frame first = cam_from_world.find(stretch.first);
  Frame last = cam_from_world.find(stretch.last);
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

// Rotations, directions and lens of a turn in place by some of its frames and tracks.
PureRotationResult RefineTurnAndLens(const Camera& camera,
                                     const RotationMap& turn,
                                     const std::vector<Track>& tracks,
                                     BundleOptions options) {
  std::vector<FrameId> frames;
  for (const auto& [frame, rotation] : turn) frames.push_back(frame);
  frames = SampleOf(frames, kMaxLensFrames);
  RotationMap rotations;
  for (const FrameId frame : frames) rotations[frame] = turn.at(frame);
  const std::vector<Track> seen = RestrictTracks(tracks, {frames.begin(), frames.end()}, 3);
  options.lens.refine_focal = true;
  options.lens.refine_principal_point = true;
  options.lens.refine_distortion = true;
  return RefinePureRotation(camera, rotations, SampleOf(seen, kSampledTracks), options);
}

// What a turn looks like through the lens that suits it best.
struct TurnThroughLens {
  bool is_another = false;      // than the given one, which suits it less
  bool is_credible = true;      // as near to it as a calibration should be
  bool shows_baseline = false;  // to more pairs than a turn in place
};

TurnThroughLens LookThroughItsLens(const RotationMap& turn,
                                   const RotationSources& sources,
                                   RelativeRotationOptions options,
                                   const BundleOptions& bundle_options) {
  std::set<FrameId> frames;
  for (const auto& [frame, rotation] : turn) frames.insert(frame);
  std::vector<Track> tracks = RestrictTracks(sources.tracks, frames, 3);
  const PureRotationResult in_place =
      RefineTurnAndLens(sources.camera, turn, tracks, bundle_options);
  if (!in_place.Usable() || !in_place.lens_refined) return {};

  std::vector<RelativeRotation> edges;
  for (const RelativeRotation& edge : sources.graph.edges()) {
    // Neighbours show the least of a baseline.
    const bool are_neighbours = edge.j.value - edge.i.value == 1;
    if (!are_neighbours && frames.contains(edge.i) && frames.contains(edge.j)) {
      edges.push_back(edge);
    }
  }
  tracks = WithBearingsOf(in_place.camera, std::move(tracks));
  const double credible_change = kCredibleErrors * options.baseline.lens_error;
  options.baseline.lens_error = kFoundLensError;
  const PairVotes votes = AskPairs(edges, tracks, in_place.camera.MeanFocal(), options);
  const double change = std::abs(in_place.camera.MeanFocal() / sources.camera.MeanFocal() - 1.0);
  return {
      true, change <= credible_change, votes.without < kInPlaceShareWithoutBaseline * votes.asked};
}

// The whole turn that the segment is a part of, where the camera stands off its axis.
std::optional<FrameRange> OffAxisRotation(const PureRotationSegment& stretch,
                                          const RotationSources& sources,
                                          const RelativeRotationOptions& options,
                                          const BundleOptions& bundle_options) {
  if (IsRest(stretch)) return std::nullopt;
  const auto look = [&](const RotationMap& turn) {
    return LookThroughItsLens(turn, sources, options, bundle_options);
  };
  const TurnThroughLens alone = look(RotationsOf(stretch, sources.cam_from_world));
  if (!alone.is_another) return std::nullopt;
  const RotationMap whole = WholeTurn(stretch, sources.cam_from_world);
  if (!alone.shows_baseline && (alone.is_credible || !look(whole).shows_baseline)) {
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

Explanation ExplanationBy(const PureRotationResult& turning) {
  const int num_free =
      2 * turning.num_directions + 3 * static_cast<int>(turning.cam_from_world.size());
  return {.num_observations = turning.num_observations,
          .num_tracks = turning.num_directions,
          .redundancy = 2 * turning.num_observations - num_free,
          .cost = turning.final_cost};
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
  // Whether a turn of `share` of all observations passes enough checks, and more than movement.
  const auto is_believable = [&](const PureRotationResult& turning, double share) {
    const Explanation explanation = ExplanationBy(turning);
    return turning.Usable() && IsLensCredible(camera, turning.camera) &&
           explanation.redundancy > share * kMinShare * 2 * num_given &&
           Evidence(explanation, limit) > share * evidence_of_moving;
  };
  const std::vector<Track> sample = SampleOf(tracks, kSampledTracks);
  if (sample.size() < tracks.size()) {
    const double share = static_cast<double>(NumObservations(sample)) / num_given;
    const PureRotationResult sampled = RefinePureRotation(camera, cam_from_world, sample, options);
    if (!is_believable(sampled, kSampleShare * share)) return std::nullopt;
  }
  PureRotationResult turning = RefinePureRotation(camera, cam_from_world, tracks, options);
  // Through the lens they were asked through pairs of views know better, but where nothing came of
  // what they say.
  const bool has_map = moving.num_observations > 0;
  if (has_map && !turning.lens_refined) return std::nullopt;
  if (!is_believable(turning, 1.0)) return std::nullopt;
  return turning;
}

bool PairsAllowPureRotation(const ViewGraph& graph,
                            const std::vector<Track>& tracks,
                            double focal_px,
                            const RelativeRotationOptions& options) {
  const PairVotes votes = AskPairs(graph.edges(), tracks, focal_px, options);
  return votes.without >= kMinShareWithoutBaseline * votes.asked;
}

std::vector<PureRotationSegment> WithoutOffAxisRotations(std::vector<PureRotationSegment> held,
                                                         const RotationSources& sources,
                                                         const RelativeRotationOptions& options,
                                                         const BundleOptions& bundle_options) {
  std::vector<FrameRange> arms;
  for (const PureRotationSegment& stretch : held) {
    if (const auto turn = OffAxisRotation(stretch, sources, options, bundle_options)) {
      arms.push_back(*turn);
    }
  }
  std::erase_if(held, [&](const PureRotationSegment& stretch) {
    return !IsRest(stretch) && std::any_of(arms.begin(), arms.end(), [&](const FrameRange& turn) {
      return stretch.first <= turn.last && turn.first <= stretch.last;
    });
  });
  return held;
}

}  // namespace rotslam
