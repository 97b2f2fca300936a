#include "rotodom/rolling_shutter/readout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>

#include "rotodom/relative_rotation/information_criterion.h"
#include "rotodom/relative_rotation/pair_arrays.h"
#include "rotodom/relative_rotation/refinement.h"
#include "rotodom/rolling_shutter/readout_pairs.h"
#include "rotodom/types/median.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

constexpr std::size_t kMinPairs = 10;  // one for each block of the jackknife
// Upper bound of the readout, s: sensors of video cameras are faster.
constexpr double kLongestReadout = 0.05;
// Steps of the first search in each direction.
constexpr int kCoarseSteps = 12;
// Pairs of views that decide between the minima; then all of them measure the readout.
constexpr std::size_t kDecidingPairs = 75;
// Lower bound of the noise of matches, px.
constexpr double kLeastNoisePx = 0.05;

ReadoutStart StartOf(const Readout& readout) {
  const bool is_reversed = readout.seconds < 0.0;
  if (readout.axis == 0) return is_reversed ? ReadoutStart::kRight : ReadoutStart::kLeft;
  return is_reversed ? ReadoutStart::kBottom : ReadoutStart::kTop;
}

// Two models of a pair of views.
struct PairModels {
  Rotation rotation;
  EpipolarModel epipolar;
};

double Sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

// A readout, and the pairs' models with it.
struct ReadoutCandidate {
  Readout readout;
  std::vector<PairModels> models;
};

// Criterion of each pair for readouts at equal steps.
struct ScoreTable {
  double first_s = 0.0;
  double step_s = 0.0;
  std::vector<std::vector<double>> scores;

  // Minimum of the parabola through the best readout and its neighbours, without pairs [from, to);
  // at either end of the table the best readout itself.
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

// Jackknife standard deviation of the minimum: blocks of consecutive pairs are left out in turn.
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

// Gain of a group of pairs.
struct GroupGain {
  double sum = 0.0;
  double squares = 0.0;
  std::size_t count = 0;

  void Add(double gain) {
    sum += gain;
    squares += gain * gain;
    ++count;
  }
  // In standard errors.
  double Sigmas() const { return squares > 0.0 ? sum / std::sqrt(squares) : 0.0; }
  // The same, 0 for a group too small to confirm anything.
  double InGroup() const { return count < kMinPairs ? 0.0 : Sigmas(); }
};

// Searches the readout that explains the pairs best.
class ReadoutSearch {
 public:
  ReadoutSearch(std::vector<ViewPair> pairs,
                double longest_s,
                double focal_px,
                const RelativeRotationOptions& options,
                int num_threads)
      : pairs_(std::move(pairs)),
        coarse_stride_(std::max<std::size_t>(1, pairs_.size() / kDecidingPairs)),
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
    double lowest = 0.0;  // sum of the criteria
    double step_s = 0.0;  // of the table
  };

  /// nullopt where the only minima are at the ends.
  std::optional<Minimum> Search() const {
    // Pairs with and without a translation may each cause a minimum. The finer search decides
    // between them, because the coarse grid can rank them wrongly.
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
    if (!best) return std::nullopt;
    // All pairs may have their minimum outside of a table around that of some.
    constexpr int kMaxTables = 3;
    for (int table = 0; table < kMaxTables; ++table) {
      Tabulate(best->step_s, kFinalSteps, 1, *best);
      if (!best->around.IsAtAnEnd(best->around.Lowest(0, 0))) break;
    }
    best->at.readout.seconds = best->around.Lowest(0, 0);
    return best;
  }

  /// Gain of a candidate over a global shutter, in standard errors.
  struct Gain {
    double of_all = 0.0;
    double of_worst_group = 0.0;  // 0 where a group has too few pairs
  };
  Gain GainSigmas(ReadoutCandidate candidate) const {
    ReadoutCandidate global = global_;
    std::vector<double> gains = Score(global, noise_);
    const std::vector<double> with = Score(candidate, noise_);
    for (std::size_t k = 0; k < gains.size(); ++k) gains[k] -= with[k];
    GroupGain all;
    std::array<GroupGain, 2> halves;
    std::array<GroupGain, 2> changes;
    for (std::size_t k = 0; k < gains.size(); ++k) {
      all.Add(gains[k]);
      halves[2 * k < gains.size() ? 0 : 1].Add(gains[k]);
      changes[pairs_[k].RotatesFaster() ? 0 : 1].Add(gains[k]);
    }
    return {all.Sigmas(),
            std::min({halves[0].InGroup(),
                      halves[1].InGroup(),
                      changes[0].InGroup(),
                      changes[1].InGroup()})};
  }

  double noise() const { return noise_; }                      // of bearings, rad
  double rate_difference() const { return rate_difference_; }  // the median pair's, rad/s

 private:
  // Fits the models of all pairs for a global shutter, and estimates the noise of their matches.
  void FindModels(double focal_px, const RelativeRotationOptions& options) {
    global_.models.resize(pairs_.size());
    std::vector<double> noises_px(pairs_.size(), options.inlier_px);
    ParallelFor(static_cast<int>(pairs_.size()), num_threads_, [&](int k) {
      const Rotation& predicted = pairs_[k].predicted_j_from_i;
      const std::vector<BearingPair> bearings = pairs_[k].BearingsFor({});
      const auto estimate = UpdateRelativeRotation(
          {bearings}, {predicted, pairs_[k].translation_direction}, predicted, focal_px, options);
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

  // Computes the criterion of every `stride`th pair and refines the candidate's models of these.
  std::vector<double> Score(ReadoutCandidate& candidate,
                            double noise,
                            std::size_t stride = 1) const {
    constexpr double kLossSigmas = 3.0;
    constexpr int kIterations = 10;
    constexpr double kTolerance = 1e-4;
    std::vector<double> scores((pairs_.size() + stride - 1) / stride);
    ParallelFor(static_cast<int>(scores.size()), num_threads_, [&](int n) {
      const std::size_t k = static_cast<std::size_t>(n) * stride;
      const PairArrays bearings(pairs_[k].BearingsFor(candidate.readout));
      auto& [rotation, epipolar] = candidate.models[k];
      const double loss = kLossSigmas * noise;
      rotation = RefineRotation(bearings, rotation, loss, kIterations).j_from_i;
      epipolar = RefineEpipolar(bearings, epipolar, loss, kIterations, kTolerance).model;
      scores[n] = std::min(RotationCriterion(SquaredFlows(bearings, rotation), noise),
                           EpipolarCriterion(SquaredDistances(bearings, epipolar), noise));
    });
    return scores;
  }

  // Noise that includes the error of a readout between two steps.
  double NoiseFor(double step_s) const {
    constexpr double kShareOfStep = 0.15;
    return std::max(noise_, kShareOfStep * rate_difference_ * step_s);
  }

  // Adds the minima along one axis for readouts of both signs. The models of one readout are the
  // start of the next.
  void AddMinimaAlong(int axis, std::vector<std::pair<double, ReadoutCandidate>>& minima) const {
    std::vector<ReadoutCandidate> line(2 * kCoarseSteps + 1);
    std::vector<double> sums(line.size());
    const auto visit = [&](int step, ReadoutCandidate candidate) {
      candidate.readout = {axis, step * coarse_step_s_};
      sums[kCoarseSteps + step] = Sum(Score(candidate, NoiseFor(coarse_step_s_), coarse_stride_));
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

  // Narrows the steps around a minimum as far as the noise allows.
  Minimum Refine(ReadoutCandidate candidate) const {
    Minimum minimum{std::move(candidate), {}, 0.0};
    bool is_last = false;
    for (double step_s = 0.5 * coarse_step_s_; !is_last; step_s *= 0.5) {
      is_last = NoiseFor(step_s) == noise_;
      Tabulate(step_s, 3, coarse_stride_, minimum);
      minimum.step_s = step_s;
    }
    return minimum;
  }

  // Moves to the best of the readouts around a minimum.
  void Tabulate(double step_s, int num_around, std::size_t stride, Minimum& minimum) const {
    const ReadoutCandidate middle = minimum.at;
    minimum.around = {middle.readout.seconds - num_around * step_s, step_s, {}};
    minimum.lowest = std::numeric_limits<double>::infinity();
    for (int k = -num_around; k <= num_around; ++k) {
      ReadoutCandidate at = middle;
      at.readout.seconds += k * step_s;
      minimum.around.scores.push_back(Score(at, NoiseFor(step_s), stride));
      const double sum = Sum(minimum.around.scores.back());
      if (sum >= minimum.lowest) continue;
      minimum.lowest = sum;
      minimum.at = std::move(at);
    }
  }

  // Steps around the minimum of the last table, which the jackknife needs to contain those of parts
  // of the pairs.
  static constexpr int kFinalSteps = 6;

  std::vector<ViewPair> pairs_;  // in order of time
  std::size_t coarse_stride_;    // one of so many pairs decides
  double coarse_step_s_;
  int num_threads_;
  ReadoutCandidate global_;
  double noise_ = 0.0;
  double rate_difference_ = 0.0;
};

}  // namespace

bool ReadoutEstimate::IsRolling() const {
  // Thresholds: the fastest rolling shutter, s; standard deviations of the readout, of which
  // sequences with a global shutter reach up to 4.3; of the gain, and of the worst group's.
  constexpr double kShortest = 1e-3;
  constexpr double kSigmas = 5.0;
  constexpr double kGainSigmas = 2.0;
  constexpr double kLeastGainSigmas = 1.5;
  // Sensors are read from the top. From a side it is the picture of a camera held upright, which is
  // rare, while errors of the lens and parallax are mostly horizontal.
  const bool is_from_a_side =
      readout_from == ReadoutStart::kLeft || readout_from == ReadoutStart::kRight;
  const double caution = is_from_a_side ? 2.0 : 1.0;
  // Smallest shear, as a multiple of the noise. A smaller one may be caused by the lens
  // calibration, which has reached 5.2, and has little effect on the results; rolling shutters of
  // cameras in a hand reach 7.5 to 80.
  constexpr double kLeastShear = 6.5;
  return readout_s > std::max(kShortest, caution * kSigmas * sigma_s) &&
         gain_sigmas > caution * kGainSigmas && least_gain_sigmas > caution * kLeastGainSigmas &&
         shear_px > kLeastShear * noise_px;
}

bool ReadoutEstimate::IsGlobal() const {
  constexpr double kNegligible = 0.1;  // of the time between two frames
  return readout_s + 3.0 * sigma_s < kNegligible * frame_s;
}

std::optional<ReadoutEstimate> EstimateReadout(const Camera& camera,
                                               const TrackedFrames& frames,
                                               const RelativeRotationOptions& options,
                                               int num_threads) {
  constexpr std::size_t kMinFrames = 4;
  if (frames.points.size() < kMinFrames) return std::nullopt;
  const double period_s = MedianPeriod(frames.points);
  const double longest_s = std::min(period_s, kLongestReadout);
  const double focal_px = camera.MeanFocal();
  std::vector<ViewPair> pairs =
      SelectReadoutPairs(camera, frames.points, frames.graph, frames.cam_from_world, longest_s);
  if (pairs.size() < kMinPairs) return std::nullopt;
  const ReadoutSearch search(std::move(pairs), longest_s, focal_px, options, num_threads);
  const auto best = search.Search();
  if (!best || best->around.IsAtAnEnd(best->at.readout.seconds)) return std::nullopt;
  ReadoutEstimate estimate;
  estimate.readout_s = std::abs(best->at.readout.seconds);
  estimate.readout_from = StartOf(best->at.readout);
  estimate.sigma_s = JackknifeSigma(best->around);
  const ReadoutSearch::Gain gain = search.GainSigmas(best->at);
  estimate.gain_sigmas = gain.of_all;
  estimate.least_gain_sigmas = gain.of_worst_group;
  estimate.shear_px = estimate.readout_s * search.rate_difference() * focal_px;
  estimate.noise_px = search.noise() * focal_px;
  estimate.frame_s = period_s;
  return estimate;
}

}  // namespace rotslam
