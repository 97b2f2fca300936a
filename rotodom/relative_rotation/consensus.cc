#include "rotodom/relative_rotation/consensus.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "rotodom/relative_rotation/planar_ambiguity.h"
#include "rotodom/relative_rotation/refinement.h"

namespace rotslam {
namespace {

// Number of matches used by a descent, which bounds its cost.
constexpr int kThinnedSize = 250;
// Largest angle between the best rotation and the starts of samples. At the parallax of
// neighbouring frames minima are about 1 deg apart, at wide baselines more.
constexpr double kStartScatterDeg = 4.0;
// Largest difference of two scores per inlier, nats, at which either minimum may be the right one.
// Among real pairs of views for which one of two such minima was right, that was the one with the
// worse score in half of the cases.
constexpr double kLargestExcess = 0.25;
// Rotations closer than this count as the same: edges to other views cannot separate them.
constexpr double kOtherRotationDeg = 2.0;
// Finest scale at which hypotheses are told apart; well-refined matches scatter by 0.03 to 0.2 px.
constexpr double kFinestPx = 0.1;
// One more than the five degrees of freedom. Of these every other sample is, from all matches: more
// would too often meet a wrong one.
constexpr int kSmallSample = 6;
// Matches per sample from those that nearly agree with the best hypothesis; fewer fail at small
// baselines.
constexpr int kLargeSample = 10;
// Samples are drawn until a better hypothesis is less likely than one in a thousand, but no fewer
// than these: the share of right matches is only guessed.
constexpr double kConfidence = 0.999;
constexpr int kMinSamples = 20;

int SamplesNeeded(double inlier_ratio, int max_samples) {
  const double all_good = std::pow(std::clamp(inlier_ratio, 0.0, 1.0), kSmallSample);
  if (all_good > 1.0 - 1e-9) return 1;
  if (all_good < 1e-12) return max_samples;
  const double needed = std::log(1.0 - kConfidence) / std::log1p(-all_good);
  return static_cast<int>(std::min<double>(max_samples, std::ceil(needed)));
}

class Sampler {
 public:
  explicit Sampler(std::uint64_t seed) : random_(seed) {}

  // `count` different indices below `population`.
  const std::vector<int>& Draw(int count, int population) {
    drawn_.clear();
    while (static_cast<int>(drawn_.size()) < count) {
      const int index = static_cast<int>(random_() % static_cast<std::uint64_t>(population));
      if (std::find(drawn_.begin(), drawn_.end(), index) == drawn_.end()) drawn_.push_back(index);
    }
    return drawn_;
  }

  // A vector inside the unit ball.
  Eigen::Vector3d DrawInBall() {
    const auto uniform = [&] { return static_cast<double>(random_() >> 11) * 0x1.0p-52 - 1.0; };
    while (true) {
      Eigen::Vector3d vector(uniform(), uniform(), uniform());
      if (vector.squaredNorm() <= 1.0) return vector;
    }
  }

 private:
  std::mt19937_64 random_;
  std::vector<int> drawn_;
};

// Orthonormal frame of two bearings: their sum, difference and normal.
Eigen::Matrix3d FrameOf(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix3d frame;
  frame.col(0) = (a + b).normalized();
  frame.col(1) = (a - b).normalized();
  frame.col(2) = frame.col(0).cross(frame.col(1));
  return frame;
}

// Rotation that best aligns two pairs; nullopt when bearings of a view are parallel.
std::optional<Rotation> AlignTwo(const PairArrays& pairs, int first, int second) {
  const Eigen::Matrix3d R = FrameOf(pairs.BearingJ(first), pairs.BearingJ(second)) *
                            FrameOf(pairs.BearingI(first), pairs.BearingI(second)).transpose();
  if (!(R.determinant() > 0.5)) return std::nullopt;
  return Rotation(Eigen::Quaterniond(R));
}

// About `count` of the indices, evenly spread over their order.
std::vector<int> Thinned(const std::vector<int>& indices, int count) {
  const std::int64_t size = std::ssize(indices);
  if (size <= count) return indices;
  std::vector<int> thinned(count);
  for (int k = 0; k < count; ++k) thinned[k] = indices[k * size / count];
  return thinned;
}

double Quantile(std::vector<double> values, double part) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

class Search {
 public:
  Search(const PairArrays& pairs, double focal_px, const RelativeRotationOptions& options)
      : pairs_(pairs),
        spread_(pairs.Thinned(kThinnedSize)),
        options_(options),
        threshold_(options.inlier_px / focal_px),
        smallest_noise_(kMinNoisePx / focal_px),
        bounds_{threshold_, kFinestPx / focal_px} {}

  const Consensus& best() const { return best_; }

  // The best other minimum within kLargestExcess whose rotation differs by kOtherRotationDeg.
  std::optional<Consensus> Alternative() const {
    std::optional<Consensus> alternative;
    double least = kLargestExcess;
    for (const EpipolarModel& minimum : minima_) {
      const Rotation between = minimum.j_from_i * best_.model.j_from_i.Inverse();
      if (between.AngleDeg() < kOtherRotationDeg) continue;
      const HypothesisScore score = ScoreOf(minimum);
      const double excess = (score.score - best_score_) / best_.num_inliers;
      if (!(excess < least)) continue;
      least = excess;
      alternative =
          Consensus{minimum, score.num_inliers, std::max(0.0, excess), {}, best_.num_samples};
    }
    return alternative;
  }

  void DescendFrom(const Rotation& rotation) {
    FocusOn(rotation);
    const Eigen::Matrix3d axes = TranslationAxes(thinned_, rotation);
    for (int k = 0; k < 3; ++k) DescendAndConsider({rotation, axes.col(k)});
  }

  void DescendFromModel(const EpipolarModel& model) {
    FocusOn(model.j_from_i);
    DescendAndConsider(model);
  }

  void DescendFromAligned(const Rotation& start) {
    // The scale decreases as the rotation explains more matches.
    constexpr int kScales = 5;
    Rotation rotation = start;
    for (int k = 0; k < kScales; ++k) {
      const double scale = std::max(threshold_, TypicalFlow(rotation));
      rotation = RefineRotation(spread_, rotation, scale, 2).j_from_i;
    }
    DescendFrom(rotation);
  }

  void DescendFromAmbiguity() {
    FocusOn(best_.model.j_from_i);
    const auto start = PlanarAmbiguity(thinned_, best_.model, threshold_);
    const auto alternative = start ? Descend(*start) : std::nullopt;
    if (!alternative) return;
    const HypothesisScore score = ScoreOf(*alternative);
    if (!(score.score < best_score_ - kLargestExcess * best_.num_inliers)) return;
    best_score_ = score.score;
    best_.model = *alternative;
    best_.num_inliers = score.num_inliers;
  }

  void Sample(std::uint64_t seed) {
    Sampler sampler(seed);
    FocusOnBest();
    for (best_.num_samples = 0; best_.num_samples < SamplesNeededNow(); ++best_.num_samples) {
      bool improved = false;
      // With a small baseline two bearings determine the rotation: a cheap alternative to a wrong
      // prediction.
      const std::vector<int>& two = sampler.Draw(2, pairs_.size());
      if (const std::optional<Rotation> rotation = AlignTwo(pairs_, two[0], two[1])) {
        improved |= Consider({*rotation, best_.model.direction});
      }
      // Large samples are more accurate with noise and small baselines, small ones are more often
      // free of outliers. Large ones are drawn from the matches that nearly agree with the best
      // model, which are mostly inliers even at a false minimum; small ones from all.
      const bool large = best_.num_samples % 2 == 0;
      const std::vector<int>& from = large ? agreeing_ : near_;
      const int num_from = static_cast<int>(from.size());
      const int size = large ? kLargeSample : kSmallSample;
      std::vector<int> drawn = sampler.Draw(std::min(size, num_from), num_from);
      for (int& index : drawn) index = from[index];
      const Rotation start = Rotation::Exp(kStartScatterDeg * kRadFromDeg * sampler.DrawInBall()) *
                             best_.model.j_from_i;
      improved |= Consider(FitSample(PairArrays(pairs_, drawn), start));
      if (improved) {
        FocusOn(best_.model.j_from_i);
        DescendAndConsider(best_.model);
        FocusOnBest();
      }
    }
  }

 private:
  // Accepts the model if its score is better than the best so far.
  bool Consider(const EpipolarModel& model) {
    // The score of the lines is cheap and a lower bound of that of the half-lines.
    if (!(ScoreEpipolar(pairs_, model, bounds_, best_score_).score < best_score_)) return false;
    const HypothesisScore score = ScoreOf(model);
    if (!(score.score < best_score_)) return false;
    best_score_ = score.score;
    best_.model = model;
    best_.num_inliers = score.num_inliers;
    return true;
  }

  HypothesisScore ScoreOf(const EpipolarModel& model) const {
    // Flow of the size of the noise may have any direction; otherwise a model would be preferred
    // that explains rotation by translation, so that all flow has one direction.
    constexpr double kSigmas = 2.0;
    std::vector<double> squared_distances = SquaredDistances(pairs_, model);
    const double noise = NoiseOf(squared_distances, threshold_, smallest_noise_);
    return ScoreHalfLines(pairs_, model, std::move(squared_distances), bounds_, kSigmas * noise);
  }

  // The 30th percentile of the lengths of the flow, rad.
  double TypicalFlow(const Rotation& rotation) const {
    constexpr double kPart = 0.3;
    return std::sqrt(Quantile(SquaredFlows(spread_, rotation), kPart));
  }

  // Restricts descents and samples to matches whose flow under the rotation is at most six times
  // the typical one. Most of the others are outliers. Each of those fits a direction of translation
  // near any given one, and its long flow creates a sharp false minimum.
  void FocusOn(const Rotation& rotation) {
    constexpr double kProportion = 6.0;
    const double longest = kProportion * (threshold_ + TypicalFlow(rotation));
    const std::vector<double> squared_flows = SquaredFlows(pairs_, rotation);
    near_.clear();
    for (int k = 0; k < pairs_.size(); ++k) {
      if (squared_flows[k] <= longest * longest) near_.push_back(k);
    }
    thinned_ = PairArrays(pairs_, Thinned(near_, kThinnedSize));
  }

  // The same for the best model; also finds the matches that nearly agree with it.
  void FocusOnBest() {
    constexpr double kNearly = 4.0;
    FocusOn(best_.model.j_from_i);
    const double limit = kNearly * kNearly * threshold_ * threshold_;
    const std::vector<double> squared_distances = SquaredDistances(pairs_, best_.model);
    agreeing_.clear();
    for (const int k : near_) {
      if (squared_distances[k] < limit) agreeing_.push_back(k);
    }
  }

  static EpipolarModel FitSample(const PairArrays& sample, const Rotation& start) {
    constexpr int kIterations = 8;
    constexpr double kNoLoss = 1.0;
    const EpipolarModel model{start, TranslationAxes(sample, start).col(0)};
    return RefineEpipolar(sample, model, kNoLoss, kIterations, 1e-3).model;
  }

  // Refines the model at the scale of its own noise, which is updated a few times; nullopt where an
  // earlier descent ended in the same minimum.
  std::optional<EpipolarModel> Descend(EpipolarModel model) {
    constexpr int kScales = 3;
    constexpr int kIterations = 4;
    for (int k = 0; k < kScales; ++k) {
      if (k > 0 && IsKnown(model)) return std::nullopt;
      const double noise = NoiseOf(SquaredDistances(thinned_, model), threshold_, smallest_noise_);
      model = RefineEpipolar(thinned_, model, kLossSigmas * noise, kIterations, 1e-3).model;
    }
    minima_.push_back(model);
    return model;
  }

  void DescendAndConsider(const EpipolarModel& start) {
    if (const auto minimum = Descend(start)) Consider(*minimum);
  }

  bool IsKnown(const EpipolarModel& model) const {
    constexpr double kSameDirection = 0.9998;  // cosine of 1 deg
    const double same_angle = 0.1 * threshold_;
    return std::any_of(minima_.begin(), minima_.end(), [&](const EpipolarModel& minimum) {
      return std::abs(minimum.direction.dot(model.direction)) > kSameDirection &&
             (minimum.j_from_i * model.j_from_i.Inverse()).Angle() < same_angle;
    });
  }

  int SamplesNeededNow() const {
    const double ratio = static_cast<double>(best_.num_inliers) / static_cast<double>(near_.size());
    const int needed = SamplesNeeded(ratio, options_.max_samples);
    return std::max(needed, std::min(kMinSamples, options_.max_samples));
  }

  const PairArrays& pairs_;
  const PairArrays spread_;  // some of all
  const RelativeRotationOptions& options_;
  const double threshold_;
  const double smallest_noise_;
  const ScoreBounds bounds_;

  std::vector<int> near_;              // indices from FocusOn
  std::vector<int> agreeing_;          // indices from FocusOnBest
  PairArrays thinned_;                 // some of them
  std::vector<EpipolarModel> minima_;  // results of descents
  Consensus best_;
  double best_score_ = std::numeric_limits<double>::infinity();
};

// Indices of the pairs without likely chance inliers. An outlier with a flow of `length` in a
// random direction has a distance below the threshold with the probability of a certain angle, and
// the longer its flow, the larger its weight. Where outliers of some length explain more than a
// small share of the inliers of that length, all pairs of that length are rejected. Close points,
// which have long flow, stay while they outnumber the chance inliers.
std::vector<int> RejectChanceInliers(const PairArrays& pairs,
                                     const EpipolarModel& model,
                                     double threshold) {
  // Bins of length are powers of two in units of the threshold; shorter flows cannot be identified
  // as outliers.
  constexpr int kShortest = 2;
  constexpr int kBins = 16;
  constexpr double kLargestPart = 0.05;
  const std::vector<double> squared_distances = SquaredDistances(pairs, model);
  const std::vector<double> squared_flows = SquaredFlows(pairs, model.j_from_i);
  std::vector<int> bin_of_pair(pairs.size());
  std::array<int, kBins> agree = {};
  std::array<int, kBins> disagree = {};
  for (int k = 0; k < pairs.size(); ++k) {
    const int power = std::ilogb(std::sqrt(squared_flows[k]) / threshold);
    bin_of_pair[k] = std::clamp(power, 0, kBins - 1);
    ++(squared_distances[k] < threshold * threshold ? agree : disagree)[bin_of_pair[k]];
  }
  std::array<bool, kBins> trusted = {};
  for (int bin = 0; bin < kBins; ++bin) {
    // r = length * sin(angle) / sqrt(2), because its unit contains the noise of both views.
    const double sine = std::numbers::sqrt2 / std::exp2(bin + 0.5);
    const double chance = 2.0 / std::numbers::pi * std::asin(std::min(sine, 1.0));
    const double by_chance = disagree[bin] * chance / (1.0 - chance);
    trusted[bin] = bin < kShortest || by_chance <= kLargestPart * agree[bin];
  }
  std::vector<int> members;
  for (int k = 0; k < pairs.size(); ++k) {
    if (trusted[bin_of_pair[k]]) members.push_back(k);
  }
  return members;
}

}  // namespace

std::vector<Consensus> FindConsensus(const PairArrays& pairs,
                                     const Rotation& predicted_j_from_i,
                                     double focal_px,
                                     const RelativeRotationOptions& options,
                                     std::uint64_t seed) {
  Search search(pairs, focal_px, options);
  search.DescendFrom(predicted_j_from_i);
  search.DescendFromAligned(predicted_j_from_i);
  search.Sample(seed);
  search.DescendFromAmbiguity();
  std::vector<Consensus> found = {search.best()};
  if (auto alternative = search.Alternative()) found.push_back(*std::move(alternative));
  for (Consensus& consensus : found) {
    consensus.members = RejectChanceInliers(pairs, consensus.model, options.inlier_px / focal_px);
  }
  return found;
}

Consensus FollowConsensus(const PairArrays& pairs,
                          const EpipolarModel& known,
                          const Rotation& predicted_j_from_i,
                          double focal_px,
                          const RelativeRotationOptions& options) {
  Search search(pairs, focal_px, options);
  search.DescendFrom(predicted_j_from_i);
  if (!known.direction.isZero()) search.DescendFromModel(known);
  search.DescendFromAmbiguity();
  Consensus followed = search.best();
  followed.members = RejectChanceInliers(pairs, followed.model, options.inlier_px / focal_px);
  return followed;
}

}  // namespace rotslam
