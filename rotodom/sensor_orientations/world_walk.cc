#include "rotodom/sensor_orientations/world_walk.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "rotodom/sensor_orientations/random_walk.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Bounds of a step's variance, rad^2: a thousandth of what an encoder resolves, and ten degrees.
constexpr double kLeastStep = 1e-12;
constexpr double kLargestStep = 0.03;
// Deviations from the orientations beside it at which one is taken for wrong, and the share of all
// above which they are not: then it is the noise that has no normal distribution.
constexpr double kOutlierSigmas = 6.0;
constexpr double kMostOutliers = 0.1;
// Median of the squared length of a normal vector of three components.
constexpr double kMedianOfSquare = 2.366;
// The images cannot tell of the sensor's variance what is smaller than this share of their own.
constexpr double kLeastShare = 0.1;
constexpr double kLeastVariance = 1e-10;  // (0.0006 deg)^2
// The images drift by up to this many times the variance that they claim before the sensor is taken
// to drift, too: what OrientationCovariance is off by at worst.
constexpr double kImageDrift = 2.0;
constexpr std::size_t kLeastPairs = 4;  // for a mean

// y less the mean of those beside it, by pair; zero at the ends of chains.
Eigen::MatrixXd SecondDifferences(const std::vector<FrameChain>& chains, const Eigen::MatrixXd& y) {
  Eigen::MatrixXd differences = Eigen::MatrixXd::Zero(y.rows(), 3);
  for (const FrameChain& chain : chains) {
    for (std::size_t m = chain.begin + 1; m + 1 < chain.end; ++m) {
      differences.row(m) = y.row(m) - 0.5 * (y.row(m - 1) + y.row(m + 1));
    }
  }
  return differences;
}

// Orientations that stand alone against those beside them.
void FindOutliers(const std::vector<FrameChain>& chains,
                  const Eigen::MatrixXd& y,
                  SensorNoise& noise) {
  const Eigen::MatrixXd differences = SecondDifferences(chains, y);
  std::vector<double> squared;
  for (const FrameChain& chain : chains) {
    for (std::size_t m = chain.begin + 1; m + 1 < chain.end; ++m) {
      squared.push_back(differences.row(m).squaredNorm());
    }
  }
  if (squared.empty()) return;
  const double variance =
      std::max(Median(std::move(squared)) / kMedianOfSquare, 1.5 * kLeastVariance);
  const auto length = [&](std::size_t m) { return differences.row(m).norm(); };
  for (const FrameChain& chain : chains) {
    for (std::size_t m = chain.begin + 1; m + 1 < chain.end; ++m) {
      if (length(m) < kOutlierSigmas * std::sqrt(variance)) continue;
      // It shows at its neighbours, too, half as large.
      if (length(m) < length(m - 1) || length(m) < length(m + 1)) continue;
      if ((y.row(m + 1) - y.row(m - 1)).norm() > 0.5 * length(m)) continue;
      noise.is_outlier[m] = true;
      ++noise.num_outliers;
    }
  }
  if (noise.num_outliers > kMostOutliers * static_cast<double>(y.rows())) {
    noise.is_outlier.assign(y.rows(), false);
    noise.num_outliers = 0;
  }
}

// Two pairs some pairs apart.
struct Stretch {
  double squared_change = 0.0;  // per axis
  double by_images = 0.0;       // the variance that the images account for
  int num_frames = 0;
};

// Means over the better half of the stretches, by what the images can tell.
struct Change {
  double excess = 0.0;     // squared change less what the images account for
  double by_images = 0.0;  // that
  double num_frames = 0.0;
  bool is_known = false;
};

Change MeanOf(const std::vector<Stretch>& stretches) {
  std::vector<double> by_images;
  by_images.reserve(stretches.size());
  for (const Stretch& stretch : stretches) by_images.push_back(stretch.by_images);
  const double limit = (1.0 + 1e-9) * Median(std::move(by_images));
  Change mean;
  std::size_t number = 0;
  for (const Stretch& stretch : stretches) {
    if (stretch.by_images > limit) continue;
    mean.excess += stretch.squared_change - stretch.by_images;
    mean.by_images += stretch.by_images;
    mean.num_frames += stretch.num_frames;
    ++number;
  }
  mean.is_known = number >= kLeastPairs;
  const double weight = 1.0 / static_cast<double>(std::max<std::size_t>(number, 1));
  mean.excess *= weight;
  mean.by_images *= weight;
  mean.num_frames *= weight;
  return mean;
}

}  // namespace

WorldWalk::WorldWalk(const std::vector<OrientationPair>& pairs,
                     const Rotation& cam_from_sensor,
                     const std::vector<double>& step_variance)
    : pairs_(pairs), step_variance_(step_variance), vectors_(pairs.size(), 3) {
  const auto between = [&](const OrientationPair& pair) {
    return pair.cam_from_world.Inverse() * cam_from_sensor * pair.sensor_from_world;
  };
  const int num_frames = static_cast<int>(step_variance.size()) + 1;
  std::size_t next = 0;
  for (int first = 0; first < num_frames;) {
    FrameChain chain;
    chain.first = chain.last = first;
    while (chain.last + 1 < num_frames && std::isfinite(step_variance[chain.last])) ++chain.last;
    chain.begin = next;
    while (next < pairs.size() && pairs[next].frame <= chain.last) ++next;
    chain.end = next;
    first = chain.last + 1;
    if (chain.begin == chain.end) continue;
    chain.reference = between(pairs[(chain.begin + chain.end) / 2]);
    for (std::size_t m = chain.begin; m < chain.end; ++m) {
      vectors_.row(m) = (chain.reference.Inverse() * between(pairs[m])).Log().transpose();
    }
    chains_.push_back(chain);
  }
}

double WorldWalk::ImageStep(int frame) const {
  return std::clamp(step_variance_[frame], kLeastStep, kLargestStep);
}

SensorNoise WorldWalk::Noise() const {
  SensorNoise noise;
  noise.is_outlier.assign(pairs_.size(), false);
  FindOutliers(chains_, vectors_, noise);
  std::vector<double> walked(step_variance_.size() + 1, 0.0);  // from the first frame
  for (std::size_t k = 0; k < step_variance_.size(); ++k) {
    walked[k + 1] = walked[k] + ImageStep(static_cast<int>(k));
  }
  const auto change_over = [&](std::size_t lag) {
    std::vector<Stretch> stretches;
    for (const FrameChain& chain : chains_) {
      for (std::size_t m = chain.begin; m + lag < chain.end; ++m) {
        if (noise.is_outlier[m] || noise.is_outlier[m + lag]) continue;
        const int from = pairs_[m].frame;
        const int to = pairs_[m + lag].frame;
        stretches.push_back({(vectors_.row(m + lag) - vectors_.row(m)).squaredNorm() / 3.0,
                             walked[to] - walked[from],
                             to - from});
      }
    }
    return MeanOf(stretches);
  };
  const Change first = change_over(1);
  noise.variance =
      std::max({0.5 * first.excess, 0.5 * kLeastShare * first.by_images, kLeastVariance});
  for (std::size_t lag = 2; 4 * lag <= pairs_.size(); lag *= 2) {
    const Change change = change_over(lag);
    if (!change.is_known || change.num_frames <= first.num_frames) continue;
    // Nor what chance may have added: stretches that overlap tell the same.
    const double chance =
        (change.excess + change.by_images) *
        std::sqrt(2.0 * static_cast<double>(lag) / (3.0 * static_cast<double>(pairs_.size())));
    const double unexplained = change.excess - (kImageDrift - 1.0) * change.by_images - chance;
    noise.step_variance = std::max(
        noise.step_variance,
        (unexplained - std::max(first.excess, 0.0)) / (change.num_frames - first.num_frames));
  }
  return noise;
}

Eigen::MatrixXd WorldWalk::Smooth(const FrameChain& chain,
                                  const SensorNoise& noise,
                                  const Eigen::VectorXd& weights,
                                  const Eigen::MatrixXd& values,
                                  std::vector<double>* variances) const {
  const int size = chain.last - chain.first + 1;
  std::vector<double> frame_weights(size, 0.0);
  Eigen::MatrixXd at_frames = Eigen::MatrixXd::Zero(size, values.cols());
  for (std::size_t m = chain.begin; m < chain.end; ++m) {
    frame_weights[pairs_[m].frame - chain.first] = weights[m] / noise.variance;
    at_frames.row(pairs_[m].frame - chain.first) = values.row(m);
  }
  std::vector<double> steps;
  steps.reserve(size);
  for (int frame = chain.first; frame < chain.last; ++frame) {
    steps.push_back(ImageStep(frame) + noise.step_variance);
  }
  const RandomWalkSmoother smoother(std::move(frame_weights), steps);
  if (variances != nullptr) *variances = smoother.Variances();
  return smoother.Smooth(at_frames);
}

Eigen::MatrixXd WorldWalk::Residuals(const SensorNoise& noise,
                                     const Eigen::VectorXd& weights,
                                     const Eigen::MatrixXd& values) const {
  Eigen::MatrixXd residuals = values;
  for (const FrameChain& chain : chains_) {
    const Eigen::MatrixXd smoothed = Smooth(chain, noise, weights, values);
    for (std::size_t m = chain.begin; m < chain.end; ++m) {
      residuals.row(m) -= smoothed.row(pairs_[m].frame - chain.first);
    }
  }
  return residuals;
}

}  // namespace rotslam
