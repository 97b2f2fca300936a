#include "rotodom/rolling_shutter/readout_pairs.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <tuple>
#include <utility>

#include "rotodom/features/view.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Number of pairs of views (up to twice as many where they cannot be thinned evenly), and numbers
// of matches per pair.
constexpr std::size_t kPairs = 300;
constexpr std::size_t kMaxMatches = 150;
constexpr std::size_t kMinMatches = 50;

// The observation with the known rotation removed.
TimedBearing Unturn(const FrameObservation& observation,
                    const AngularMotion& motion,
                    const Readout& readout) {
  const double after_s = observation.time_s + readout.seconds * observation.place[readout.axis];
  return {after_s, motion.ToMidFrame(after_s, observation.bearing)};
}

Eigen::Vector3d MidFrameBearing(const SeenPoint& point,
                                const AngularMotion& motion,
                                const Readout& readout) {
  const TimedBearing here = Unturn(point.here, motion, readout);
  if (!point.around) return here.bearing;
  const TimedBearing before = Unturn((*point.around)[0], motion, readout);
  const TimedBearing after = Unturn((*point.around)[1], motion, readout);
  const double share = here.after_s / (after.after_s - before.after_s);
  return (here.bearing - share * (after.bearing - before.bearing)).normalized();
}

using Frames = std::map<FrameId, SeenPoints>;
using Motions = std::map<FrameId, MotionEstimate>;

// Motions of the frames with neighbours on both sides that are also near in time.
// @param readout_s  upper bound of the readout, s.
Motions MotionsOf(const Frames& frames,
                  const RotationMap& cam_from_world,
                  double period_s,
                  double readout_s) {
  Motions motions;
  const auto time_s = [&](FrameId frame) { return frames.at(frame).timestamp_s; };
  for (auto frame = std::next(frames.begin()); std::next(frame) != frames.end(); ++frame) {
    const double around_s = time_s(std::next(frame)->first) - time_s(std::prev(frame)->first);
    if (around_s > 3.0 * period_s) continue;
    motions[frame->first] = EstimateMotionAt(frame->first, cam_from_world, time_s, readout_s);
  }
  return motions;
}

// Difference of the angular velocities of an edge's views, rad/s.
double RateDifference(const RelativeRotation& edge, const Motions& motions) {
  const Eigen::Vector3d rate_i = motions.at(edge.i).motion.coefficients.col(0);
  const Eigen::Vector3d rate_j = motions.at(edge.j).motion.coefficients.col(0);
  return (rate_j - edge.j_from_i * rate_i).norm();
}

// Edges that are most informative about the readout, the best first.
std::vector<RelativeRotation> MostInformativeEdges(const ViewGraph& graph,
                                                   const Motions& motions,
                                                   double focal_px) {
  struct Ranked {
    double difference = 0.0;
    double information = 0.0;
    const RelativeRotation* edge = nullptr;
  };
  std::vector<Ranked> ranked;
  for (const RelativeRotation& edge : graph.edges()) {
    if (!motions.contains(edge.i) || !motions.contains(edge.j)) continue;
    const double difference = RateDifference(edge, motions);
    const double error_px = focal_px * std::hypot(motions.at(edge.i).TypicalErrorRad(),
                                                  motions.at(edge.j).TypicalErrorRad());
    const double contrast = difference / std::hypot(edge.noise_px, error_px);
    ranked.push_back({difference, contrast * contrast * edge.num_inliers, &edge});
  }
  if (ranked.empty()) return {};
  // Edges between views at equal rates measure other errors than the readout. The threshold is
  // relative to the rate differences among the largest tenth.
  constexpr double kShareOfLarge = 0.2;
  const auto large = ranked.begin() + static_cast<std::ptrdiff_t>(ranked.size() * 9 / 10);
  std::nth_element(ranked.begin(), large, ranked.end(), [](const Ranked& a, const Ranked& b) {
    return a.difference < b.difference;
  });
  const double least = kShareOfLarge * large->difference;
  std::erase_if(ranked, [&](const Ranked& one) { return one.difference < least; });
  std::sort(ranked.begin(), ranked.end(), [](const Ranked& a, const Ranked& b) {
    return std::tuple(b.information, a.edge->i, a.edge->j) <
           std::tuple(a.information, b.edge->i, b.edge->j);
  });
  // Pairs with a common frame are redundant: every fourth of the best ones is used.
  constexpr std::size_t kOfWhich = 4;
  ranked.resize(std::min(ranked.size(), kOfWhich * kPairs));
  const std::size_t stride = std::max<std::size_t>(1, ranked.size() / kPairs);
  std::vector<RelativeRotation> edges;
  for (std::size_t k = 0; k < ranked.size(); k += stride) edges.push_back(*ranked[k].edge);
  return edges;
}

// Builds the pairs of views from the points of the frames.
class PairMaker {
 public:
  PairMaker(const Camera& camera, const Frames& frames, const Motions& motions)
      : by_columns_(camera), by_rows_(camera), frames_(frames), motions_(motions) {
    by_columns_.readout_s = by_rows_.readout_s = 1.0;
    by_columns_.readout_from = ReadoutStart::kLeft;
    by_rows_.readout_from = ReadoutStart::kTop;
  }

  ViewPair Make(const RelativeRotation& edge) const {
    ViewPair pair;
    pair.i = edge.i;
    pair.j = edge.j;
    pair.motion_i = motions_.at(edge.i).motion;
    pair.motion_j = motions_.at(edge.j).motion;
    pair.predicted_j_from_i = edge.j_from_i;
    pair.translation_direction = edge.translation_direction;
    pair.rate_difference = RateDifference(edge, motions_);
    const std::vector<TrackId> common = CommonTracks(edge);
    for (const TrackId track : common) {
      auto in_i = PointOf(track, edge.i);
      auto in_j = PointOf(track, edge.j);
      if (!in_i || !in_j) continue;
      pair.in_i.push_back(*std::move(in_i));
      pair.in_j.push_back(*std::move(in_j));
    }
    return pair;
  }

 private:
  // Common tracks, thinned evenly where there are too many.
  std::vector<TrackId> CommonTracks(const RelativeRotation& edge) const {
    const SeenPoints& i = frames_.at(edge.i);
    const SeenPoints& j = frames_.at(edge.j);
    std::vector<TrackId> all;
    std::set_intersection(i.tracks.begin(),
                          i.tracks.end(),
                          j.tracks.begin(),
                          j.tracks.end(),
                          std::back_inserter(all));
    if (all.size() <= kMaxMatches) return all;
    std::vector<TrackId> some;
    for (std::size_t k = 0; k < kMaxMatches; ++k) some.push_back(all[k * all.size() / kMaxMatches]);
    return some;
  }

  std::optional<FrameObservation> ObservationOf(TrackId track,
                                                const SeenPoints& frame,
                                                double mid_s) const {
    const int index = FindTrack(frame.tracks, track);
    if (index < 0) return std::nullopt;
    const Eigen::Vector2d& keypoint_px = frame.keypoints_px[index];
    const auto bearing = by_rows_.Unproject(keypoint_px);
    if (!bearing) return std::nullopt;
    const Eigen::Vector2d place(by_columns_.ExposureTime(keypoint_px),
                                by_rows_.ExposureTime(keypoint_px));
    return FrameObservation{frame.timestamp_s - mid_s, place, *bearing};
  }

  std::optional<SeenPoint> PointOf(TrackId track, FrameId frame) const {
    const auto at = frames_.find(frame);
    const double mid_s = at->second.timestamp_s;
    const auto here = ObservationOf(track, at->second, mid_s);
    if (!here) return std::nullopt;
    SeenPoint point{*here, std::nullopt};
    const auto before = ObservationOf(track, std::prev(at)->second, mid_s);
    const auto after = ObservationOf(track, std::next(at)->second, mid_s);
    if (before && after) point.around = {*before, *after};
    return point;
  }

  Camera by_columns_;
  Camera by_rows_;
  const Frames& frames_;
  const Motions& motions_;
};

}  // namespace

bool ViewPair::RotatesFaster() const {
  const Eigen::Vector3d rate_i = motion_i.coefficients.col(0);
  const Eigen::Vector3d rate_j = motion_j.coefficients.col(0);
  return predicted_j_from_i.Log().dot(rate_j - predicted_j_from_i * rate_i) > 0.0;
}

std::vector<BearingPair> ViewPair::BearingsFor(const Readout& readout) const {
  std::vector<BearingPair> bearings;
  bearings.reserve(in_i.size());
  for (std::size_t n = 0; n < in_i.size(); ++n) {
    bearings.push_back(
        {MidFrameBearing(in_i[n], motion_i, readout), MidFrameBearing(in_j[n], motion_j, readout)});
  }
  return bearings;
}

double MedianPeriod(const Frames& frames) {
  std::vector<double> periods;
  for (auto frame = frames.begin(); std::next(frame) != frames.end(); ++frame) {
    periods.push_back(std::next(frame)->second.timestamp_s - frame->second.timestamp_s);
  }
  return Median(std::move(periods));
}

std::vector<ViewPair> SelectReadoutPairs(const Camera& camera,
                                         const std::map<FrameId, SeenPoints>& frames,
                                         const ViewGraph& graph,
                                         const RotationMap& cam_from_world,
                                         double longest_s) {
  const Motions motions = MotionsOf(frames, cam_from_world, MedianPeriod(frames), longest_s);
  const PairMaker maker(camera, frames, motions);
  std::vector<ViewPair> pairs;
  for (const RelativeRotation& edge : MostInformativeEdges(graph, motions, camera.MeanFocal())) {
    ViewPair pair = maker.Make(edge);
    if (pair.in_i.size() >= kMinMatches) pairs.push_back(std::move(pair));
  }
  std::sort(pairs.begin(), pairs.end(), [](const ViewPair& a, const ViewPair& b) {
    return std::pair(a.i, a.j) < std::pair(b.i, b.j);
  });
  return pairs;
}

}  // namespace rotslam
