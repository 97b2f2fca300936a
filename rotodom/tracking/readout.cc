#include "rotodom/tracking/readout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "rotodom/relative_rotation/information_criterion.h"
#include "rotodom/relative_rotation/pair_arrays.h"
#include "rotodom/relative_rotation/refinement.h"
#include "rotodom/tracking/shutter.h"
#include "rotodom/types/median.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Pairs of views that are asked, and matches of each.
constexpr std::size_t kMaxPairs = 300;
constexpr std::size_t kMinPairs = 10;
constexpr std::size_t kMaxMatches = 150;
constexpr std::size_t kMinMatches = 50;
// No sensor that takes sequences is slower.
constexpr double kLongestReadout = 0.05;
// First readouts that are tried, in each direction.
constexpr int kCoarseSteps = 12;
// Matches that agree scatter by no less, rad * focal length.
constexpr double kLeastNoisePx = 0.05;

// A signed readout: along columns (0) or rows (1) of the image, from its left or top where it is
// positive.
struct Readout {
  int axis = 1;
  double seconds = 0.0;
};

ReadoutStart StartOf(const Readout& readout) {
  const bool is_reversed = readout.seconds < 0.0;
  if (readout.axis == 0) return is_reversed ? ReadoutStart::kRight : ReadoutStart::kLeft;
  return is_reversed ? ReadoutStart::kBottom : ReadoutStart::kTop;
}

// Where a frame shows a point.
struct Sight {
  double late_s = 0.0;    // the middle of that frame
  Eigen::Vector2d place;  // from the middle of the image, in its widths and heights
  Eigen::Vector3d bearing;
};

// A point in a frame, and in the frames before and behind where both show it.
struct SeenPoint {
  Sight here;
  std::optional<std::array<Sight, 2>> around;
};

struct TimedSight {
  double after_s = 0.0;
  Eigen::Vector3d unturned;
};

TimedSight Unturn(const Sight& sight, const AngularMotion& motion, const Readout& readout) {
  const double after_s = sight.late_s + readout.seconds * sight.place[readout.axis];
  return {after_s, motion.ToMidFrame(after_s, sight.bearing)};
}

Eigen::Vector3d MidFrameBearing(const SeenPoint& point,
                                const AngularMotion& motion,
                                const Readout& readout) {
  const TimedSight here = Unturn(point.here, motion, readout);
  if (!point.around) return here.unturned;
  const TimedSight before = Unturn((*point.around)[0], motion, readout);
  const TimedSight after = Unturn((*point.around)[1], motion, readout);
  const double share = here.after_s / (after.after_s - before.after_s);
  return (here.unturned - share * (after.unturned - before.unturned)).normalized();
}

// Two models of a pair of views.
struct PairModels {
  Rotation rotation;
  EpipolarModel epipolar;
};

// Two views, and the points that both see, in the same order.
struct ViewPair {
  FrameId i;
  FrameId j;
  AngularMotion motion_i;
  AngularMotion motion_j;
  std::vector<SeenPoint> in_i;
  std::vector<SeenPoint> in_j;
  Rotation predicted_j_from_i;
  double rate_difference = 0.0;  // rad/s: of a readout, it shears so much of every second

  std::vector<BearingPair> BearingsFor(const Readout& readout) const {
    std::vector<BearingPair> bearings;
    bearings.reserve(in_i.size());
    for (std::size_t n = 0; n < in_i.size(); ++n) {
      bearings.push_back({MidFrameBearing(in_i[n], motion_i, readout),
                          MidFrameBearing(in_j[n], motion_j, readout)});
    }
    return bearings;
  }
};

using Frames = std::map<FrameId, SeenPoints>;
using Motions = std::map<FrameId, BelievedMotion>;

double MedianPeriod(const Frames& frames) {
  std::vector<double> periods;
  for (auto frame = frames.begin(); std::next(frame) != frames.end(); ++frame) {
    periods.push_back(std::next(frame)->second.timestamp_s - frame->second.timestamp_s);
  }
  return Median(std::move(periods));
}

// Of the frames that have neighbours on both sides, in time, too.
// @param readout_s  the longest that is sought.
Motions MotionsOf(const Frames& frames,
                  const RotationMap& cam_from_world,
                  double period_s,
                  double readout_s) {
  Motions motions;
  const auto time_s = [&](FrameId frame) { return frames.at(frame).timestamp_s; };
  for (auto frame = std::next(frames.begin()); std::next(frame) != frames.end(); ++frame) {
    const double around_s = time_s(std::next(frame)->first) - time_s(std::prev(frame)->first);
    if (around_s > 3.0 * period_s) continue;
    motions[frame->first] = BelievedMotionAt(frame->first, cam_from_world, time_s, readout_s);
  }
  return motions;
}

// Between the two views of an edge, rad/s.
double RateDifference(const RelativeRotation& edge, const Motions& motions) {
  const Eigen::Vector3d rate_i = motions.at(edge.i).motion.coefficients.col(0);
  const Eigen::Vector3d rate_j = motions.at(edge.j).motion.coefficients.col(0);
  return (rate_j - edge.j_from_i * rate_i).norm();
}

// Edges that tell most of a readout, the best first.
std::vector<RelativeRotation> MostTellingEdges(const ViewGraph& graph,
                                               const Motions& motions,
                                               double focal_px) {
  struct Ranked {
    double difference = 0.0;
    double information = 0.0;
    const RelativeRotation* edge = nullptr;
  };
  // Most rows are nearer to the middle than the ones that may be off by that error.
  constexpr double kShareOfError = 0.5;
  std::vector<Ranked> ranked;
  for (const RelativeRotation& edge : graph.edges()) {
    if (!motions.contains(edge.i) || !motions.contains(edge.j)) continue;
    const double difference = RateDifference(edge, motions);
    const double error_px =
        focal_px * std::hypot(motions.at(edge.i).error_rad, motions.at(edge.j).error_rad);
    const double contrast = difference / std::hypot(edge.noise_px, kShareOfError * error_px);
    ranked.push_back({difference, contrast * contrast * edge.num_inliers, &edge});
  }
  if (ranked.empty()) return {};
  // Views that turn at the same rate tell of other errors: of a gimbal's fast and steady turn,
  // tracked as if its shutter were global, half the readout.
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
  // Pairs that share a frame say much the same: some of many.
  constexpr std::size_t kOfWhich = 4;
  ranked.resize(std::min(ranked.size(), kOfWhich * kMaxPairs));
  const std::size_t stride = std::max<std::size_t>(1, ranked.size() / kMaxPairs);
  std::vector<RelativeRotation> edges;
  for (std::size_t k = 0; k < ranked.size(); k += stride) edges.push_back(*ranked[k].edge);
  return edges;
}

// Makes the pairs of views from the frames' points.
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
  // Evenly, where there are too many.
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

  std::optional<Sight> SightOf(TrackId track, const SeenPoints& frame, double mid_s) const {
    const auto found = std::lower_bound(frame.tracks.begin(), frame.tracks.end(), track);
    if (found == frame.tracks.end() || *found != track) return std::nullopt;
    const Eigen::Vector2d& keypoint_px = frame.keypoints_px[found - frame.tracks.begin()];
    const auto bearing = by_rows_.Unproject(keypoint_px);
    if (!bearing) return std::nullopt;
    const Eigen::Vector2d place(by_columns_.ExposureTime(keypoint_px),
                                by_rows_.ExposureTime(keypoint_px));
    return Sight{frame.timestamp_s - mid_s, place, *bearing};
  }

  std::optional<SeenPoint> PointOf(TrackId track, FrameId frame) const {
    const auto at = frames_.find(frame);
    const double mid_s = at->second.timestamp_s;
    const auto here = SightOf(track, at->second, mid_s);
    if (!here) return std::nullopt;
    SeenPoint point{*here, std::nullopt};
    const auto before = SightOf(track, std::prev(at)->second, mid_s);
    const auto after = SightOf(track, std::next(at)->second, mid_s);
    if (before && after) point.around = {*before, *after};
    return point;
  }

  Camera by_columns_;
  Camera by_rows_;
  const Frames& frames_;
  const Motions& motions_;
};

double Sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// A readout, and the pairs' models with it.
struct ReadoutCandidate {
  Readout readout;
  std::vector<PairModels> models;
};

// Readouts side by side, one step apart, with the criterion of each pair.
struct ScoreTable {
  double first_s = 0.0;
  double step_s = 0.0;
  std::vector<std::vector<double>> scores;

  // Where a parabola through the best one and its neighbours is lowest, without some of the pairs;
  // where the best one is at either end, that.
  double Lowest(std::size_t from, std::size_t to) const {
    std::vector<double> sums;
    for (const std::vector<double>& of_pairs : scores) {
      double sum = 0.0;
      for (std::size_t k = 0; k < of_pairs.size(); ++k) {
        if (k < from || k >= to) sum += of_pairs[k];
      }
      sums.push_back(sum);
    }
    const auto lowest = std::min_element(sums.begin(), sums.end());
    double steps = static_cast<double>(lowest - sums.begin());
    if (lowest != sums.begin() && std::next(lowest) != sums.end()) {
      const double down = *std::prev(lowest) - *lowest;
      const double up = *std::next(lowest) - *lowest;
      if (down + up > 0.0) steps += 0.5 * (down - up) / (down + up);
    }
    return first_s + steps * step_s;
  }

  bool IsAtAnEnd(double seconds) const {
    const double last_s = first_s + static_cast<double>(scores.size() - 1) * step_s;
    return seconds <= first_s || seconds >= last_s;
  }
};

// Standard deviation of the lowest place, by leaving out one stretch of time after the other.
double JackknifeSigma(const ScoreTable& table) {
  constexpr std::size_t kBlocks = 10;
  const std::size_t num_pairs = table.scores.front().size();
  std::vector<double> places;
  for (std::size_t block = 0; block < kBlocks; ++block) {
    places.push_back(table.Lowest(block * num_pairs / kBlocks, (block + 1) * num_pairs / kBlocks));
  }
  const double mean = Sum(places) / kBlocks;
  double squares = 0.0;
  for (const double place : places) squares += (place - mean) * (place - mean);
  return std::sqrt(squares * (kBlocks - 1) / kBlocks);
}

// Searches all readouts for the one that explains the pairs best.
class ReadoutSearch {
 public:
  ReadoutSearch(std::vector<ViewPair> pairs,
                double longest_s,
                double focal_px,
                const RelativeRotationOptions& options,
                int num_threads)
      : pairs_(std::move(pairs)),
        coarse_step_s_(longest_s / kCoarseSteps),
        num_threads_(num_threads) {
    FindModels(focal_px, options);
    std::vector<double> differences;
    for (const ViewPair& pair : pairs_) differences.push_back(pair.rate_difference);
    rate_difference_ = Median(std::move(differences));
  }

  struct Minimum {
    ReadoutCandidate at;
    ScoreTable around;

    double lowest = 0.0;  // the sum there
  };

  /// nullopt where there is none but at the ends.
  std::optional<Minimum> Search() const {
    // Of pairs with and without a translation each kind may have a minimum of its own; which is
    // lower shows only close by (of 20 ms that a turning gimbal had, 10 came first on this grid).
    constexpr std::size_t kMaxMinima = 3;
    std::vector<std::pair<double, ReadoutCandidate>> minima;
    for (const int axis : {1, 0}) AddMinimaAlong(axis, minima);
    std::stable_sort(minima.begin(), minima.end(), [](const auto& a, const auto& b) {
      return a.first < b.first;
    });
    minima.resize(std::min(minima.size(), kMaxMinima));
    std::optional<Minimum> best;
    for (auto& [sum, candidate] : minima) {
      Minimum minimum = Refine(std::move(candidate));
      if (!best || minimum.lowest < best->lowest) best = std::move(minimum);
    }
    return best;
  }

  /// The gain of a candidate over a global shutter, in standard errors.
  double GainSigmas(ReadoutCandidate candidate) const {
    ReadoutCandidate global = global_;
    const std::vector<double> without = Score(global, noise_);
    const std::vector<double> with = Score(candidate, noise_);
    double gain = 0.0;
    double squares = 0.0;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      gain += without[k] - with[k];
      squares += (without[k] - with[k]) * (without[k] - with[k]);
    }
    return squares > 0.0 ? gain / std::sqrt(squares) : 0.0;
  }

  double noise() const { return noise_; }                      // of bearings, rad
  double rate_difference() const { return rate_difference_; }  // the median pair's, rad/s

 private:
  // The pairs' models with a global shutter, and the noise of their matches.
  void FindModels(double focal_px, const RelativeRotationOptions& options) {
    global_.models.resize(pairs_.size());
    std::vector<double> noises_px(pairs_.size(), options.inlier_px);
    ParallelFor(static_cast<int>(pairs_.size()), num_threads_, [&](int k) {
      constexpr std::uint64_t kSeed = 1;
      const Rotation& predicted = pairs_[k].predicted_j_from_i;
      const std::vector<BearingPair> bearings = pairs_[k].BearingsFor({});
      const auto estimate = EstimateRelativeRotation(bearings, predicted, focal_px, options, kSeed);
      auto& [rotation, epipolar] = global_.models[k];
      rotation = epipolar.j_from_i = estimate ? estimate->j_from_i : predicted;
      if (estimate) noises_px[k] = estimate->noise_px;
      epipolar.direction =
          estimate && !estimate->translation_direction.isZero()
              ? estimate->translation_direction
              : Eigen::Vector3d(TranslationAxes(PairArrays(bearings), rotation).col(0));
    });
    noise_ = std::max(Median(std::move(noises_px)), kLeastNoisePx) / focal_px;
  }

  // The criterion of each pair; refines the candidate's models.
  std::vector<double> Score(ReadoutCandidate& candidate, double noise) const {
    constexpr double kLossSigmas = 3.0;
    constexpr int kIterations = 10;
    constexpr double kTolerance = 1e-4;
    std::vector<double> scores(pairs_.size());
    ParallelFor(static_cast<int>(pairs_.size()), num_threads_, [&](int k) {
      const PairArrays bearings(pairs_[k].BearingsFor(candidate.readout));
      auto& [rotation, epipolar] = candidate.models[k];
      const double loss = kLossSigmas * noise;
      rotation = RefineRotation(bearings, rotation, loss, kIterations).j_from_i;
      epipolar = RefineEpipolar(bearings, epipolar, loss, kIterations, kTolerance).model;
      scores[k] = std::min(RotationCriterion(SquaredFlows(bearings, rotation), noise),
                           EpipolarCriterion(SquaredDistances(bearings, epipolar), noise));
    });
    return scores;
  }

  // With a tolerance for what lies between two steps.
  double NoiseFor(double step_s) const {
    constexpr double kShareOfStep = 0.15;
    return std::max(noise_, kShareOfStep * rate_difference_ * step_s);
  }

  // Of readouts in both directions; from each one the models go on to the next.
  void AddMinimaAlong(int axis, std::vector<std::pair<double, ReadoutCandidate>>& minima) const {
    std::vector<ReadoutCandidate> line(2 * kCoarseSteps + 1);
    std::vector<double> sums(line.size());
    const auto visit = [&](int step, ReadoutCandidate candidate) {
      candidate.readout = {axis, step * coarse_step_s_};
      sums[kCoarseSteps + step] = Sum(Score(candidate, NoiseFor(coarse_step_s_)));
      line[kCoarseSteps + step] = std::move(candidate);
    };
    visit(0, global_);
    for (int k = 1; k <= kCoarseSteps; ++k) {
      visit(k, line[kCoarseSteps + k - 1]);
      visit(-k, line[kCoarseSteps - k + 1]);
    }
    for (std::size_t k = 1; k + 1 < line.size(); ++k) {
      if (sums[k] <= sums[k - 1] && sums[k] < sums[k + 1]) minima.emplace_back(sums[k], line[k]);
    }
  }

  Minimum Refine(ReadoutCandidate candidate) const {
    Minimum minimum{std::move(candidate), {}, 0.0};
    bool is_last = false;
    for (double step_s = 0.5 * coarse_step_s_; !is_last; step_s *= 0.5) {
      is_last = NoiseFor(step_s) == noise_;
      const int num_around = is_last ? 6 : 3;
      const ReadoutCandidate middle = minimum.at;
      minimum.around = {middle.readout.seconds - num_around * step_s, step_s, {}};
      minimum.lowest = std::numeric_limits<double>::infinity();
      for (int k = -num_around; k <= num_around; ++k) {
        ReadoutCandidate at = middle;
        at.readout.seconds += k * step_s;
        minimum.around.scores.push_back(Score(at, NoiseFor(step_s)));
        const double sum = Sum(minimum.around.scores.back());
        if (sum >= minimum.lowest) continue;
        minimum.lowest = sum;
        minimum.at = std::move(at);
      }
    }
    minimum.at.readout.seconds = minimum.around.Lowest(0, 0);
    return minimum;
  }

  std::vector<ViewPair> pairs_;  // in order of time
  double coarse_step_s_;
  int num_threads_;
  ReadoutCandidate global_;
  double noise_ = 0.0;
  double rate_difference_ = 0.0;
};

}  // namespace

bool ReadoutEstimate::IsRolling() const {
  // No sensor is faster that is not global. On footage of the latter up to 4.3 standard deviations
  // were found, up to 7 where the shear was less than 1.8 times the noise.
  constexpr double kShortest = 1e-3;
  constexpr double kSigmas = 5.0;
  constexpr double kGainSigmas = 2.0;
  // What is smaller is as easily a lens that is not quite known, and not worth knowing.
  constexpr double kLeastShear = 2.5;
  return readout_s > std::max(kShortest, kSigmas * sigma_s) && gain_sigmas > kGainSigmas &&
         shear_px > kLeastShear * noise_px;
}

bool ReadoutEstimate::IsGlobal() const {
  constexpr double kNegligible = 0.1;  // of the time between two frames
  return readout_s + 3.0 * sigma_s < kNegligible * frame_s;
}

std::optional<ReadoutEstimate> EstimateReadout(const Camera& camera,
                                               const std::map<FrameId, SeenPoints>& frames,
                                               const ViewGraph& graph,
                                               const RotationMap& cam_from_world,
                                               const RelativeRotationOptions& options,
                                               int num_threads) {
  constexpr std::size_t kMinFrames = 4;
  if (frames.size() < kMinFrames) return std::nullopt;
  const double period_s = MedianPeriod(frames);
  const double longest_s = std::min(period_s, kLongestReadout);
  const double focal_px = camera.MeanFocal();
  const auto motions = MotionsOf(frames, cam_from_world, period_s, longest_s);
  const PairMaker maker(camera, frames, motions);
  std::vector<ViewPair> pairs;
  for (const RelativeRotation& edge : MostTellingEdges(graph, motions, focal_px)) {
    ViewPair pair = maker.Make(edge);
    if (pair.in_i.size() >= kMinMatches) pairs.push_back(std::move(pair));
  }
  if (pairs.size() < kMinPairs) return std::nullopt;
  std::sort(pairs.begin(), pairs.end(), [](const ViewPair& a, const ViewPair& b) {
    return std::pair(a.i, a.j) < std::pair(b.i, b.j);
  });

  const ReadoutSearch search(std::move(pairs), longest_s, focal_px, options, num_threads);
  const auto best = search.Search();
  if (!best || best->around.IsAtAnEnd(best->at.readout.seconds)) return std::nullopt;
  ReadoutEstimate estimate;
  estimate.readout_s = std::abs(best->at.readout.seconds);
  estimate.readout_from = StartOf(best->at.readout);
  estimate.sigma_s = JackknifeSigma(best->around);
  estimate.gain_sigmas = search.GainSigmas(best->at);
  estimate.shear_px = estimate.readout_s * search.rate_difference() * focal_px;
  estimate.noise_px = search.noise() * focal_px;
  estimate.frame_s = period_s;
  return estimate;
}

}  // namespace rotslam
