#include "rotodom/relative_rotation/relative_rotation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <Eigen/Dense>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// Added to the squared Sampson denominator: within about 2 deg of the epipole the distance has no
// meaning.
constexpr double kEpipoleFloor = 1e-3;

// Minima of the epipolar distance lie this far from one another at the parallax of neighbouring
// frames.
constexpr double kStartScatterDeg = 1.0;
// One more than the five degrees of freedom.
constexpr int kSmallSample = 6;

struct EpipolarModel {
  Rotation j_from_i;
  Eigen::Vector3d direction;
};

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

double SampsonDistance(const BearingPair& pair,
                       const Eigen::Matrix3d& R_j_i,
                       const Eigen::Vector3d& direction) {
  const Eigen::Vector3d g = R_j_i * pair.bearing_i;
  const double along_i = direction.dot(g);
  const double along_j = direction.dot(pair.bearing_j);
  const double squared = 2.0 - along_i * along_i - along_j * along_j + kEpipoleFloor;
  return direction.dot(g.cross(pair.bearing_j)) / std::sqrt(squared);
}

// Weight of the Geman-McClure loss.
double LossWeight(double squared_residual, double squared_scale) {
  const double ratio = 1.0 + squared_residual / squared_scale;
  return 1.0 / (ratio * ratio);
}

struct Normal5 {
  Matrix5 H = Matrix5::Zero();
  Vector5 gradient = Vector5::Zero();
  double cost = 0.0;
};

// Normal equations of the Sampson distances over (rotation, two tangent directions of the
// translation).
Normal5 LinearizeEpipolar(const std::vector<BearingPair>& pairs,
                          const EpipolarModel& model,
                          double loss) {
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  const Eigen::Vector3d& t = model.direction;
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(t);
  const double squared_loss = loss * loss;
  Normal5 normal;
  for (const BearingPair& pair : pairs) {
    const Eigen::Vector3d g = R_j_i * pair.bearing_i;
    const Eigen::Vector3d& f = pair.bearing_j;
    const double along_i = t.dot(g);
    const double along_j = t.dot(f);
    const Eigen::Vector3d g_cross_f = g.cross(f);
    const double e = t.dot(g_cross_f);
    const double inverse_squared =
        1.0 / (2.0 - along_i * along_i - along_j * along_j + kEpipoleFloor);
    const double inverse = std::sqrt(inverse_squared);
    const double r = e * inverse;
    normal.cost += squared_loss * r * r / (squared_loss + r * r);
    const double weight = LossWeight(r * r, squared_loss);
    // r = e / d: dr = de / d - (e / 2 d^3) d(d^2).
    const double share = e * inverse_squared;
    const Eigen::Vector3d d_rotation =
        inverse * ((along_i * f - g.dot(f) * t) + share * along_i * g.cross(t));
    const Eigen::Vector3d d_direction = inverse * (g_cross_f + share * (along_i * g + along_j * f));
    Vector5 J;
    J.head<3>() = d_rotation;
    J.tail<2>() = basis.transpose() * d_direction;
    normal.H.noalias() += weight * J * J.transpose();
    normal.gradient.noalias() += (weight * r) * J;
  }
  return normal;
}

double EpipolarCost(const std::vector<BearingPair>& pairs,
                    const EpipolarModel& model,
                    double loss) {
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  double cost = 0.0;
  for (const BearingPair& pair : pairs) {
    const double r = SampsonDistance(pair, R_j_i, model.direction);
    cost += loss * loss * r * r / (loss * loss + r * r);
  }
  return cost;
}

// Levenberg-Marquardt on the Sampson distances of all pairs.
EpipolarModel RefineEpipolar(const std::vector<BearingPair>& pairs,
                             EpipolarModel model,
                             double loss,
                             int iterations) {
  double damping = 1e-4;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Normal5 normal = LinearizeEpipolar(pairs, model, loss);
    bool improved = false;
    double step_length = 0.0;
    while (!improved && damping < 1e4) {
      Matrix5 damped = normal.H;
      // The directions' block vanishes with the baseline; it is damped by its own size.
      damped.diagonal().head<3>().array() +=
          damping * normal.H.topLeftCorner<3, 3>().trace() / 3.0 + 1e-300;
      damped.diagonal().tail<2>().array() +=
          damping * normal.H.bottomRightCorner<2, 2>().trace() / 2.0 + 1e-300;
      const Vector5 step = -damped.ldlt().solve(normal.gradient);
      if (!step.allFinite()) break;
      EpipolarModel candidate;
      candidate.j_from_i = Rotation::Exp(step.head<3>()) * model.j_from_i;
      candidate.direction =
          (model.direction + TangentBasis(model.direction) * step.tail<2>()).normalized();
      if (EpipolarCost(pairs, candidate, loss) <= normal.cost) {
        improved = true;
        step_length = step.head<3>().norm();
        model = candidate;
        damping = std::max(0.1 * damping, 1e-8);
      } else {
        damping *= 10.0;
      }
    }
    if (!improved || step_length < 1e-8) break;
  }
  return model;
}

struct RotationFit {
  Rotation j_from_i;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
};

// Iteratively re-weighted alignment, R f_i ~ f_j.
RotationFit RefineRotation(const std::vector<BearingPair>& pairs,
                           const Rotation& start,
                           double loss,
                           int iterations) {
  RotationFit fit;
  fit.j_from_i = start;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Eigen::Matrix3d R_j_i = fit.j_from_i.Matrix();
    fit.H.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const BearingPair& pair : pairs) {
      const Eigen::Vector3d g = R_j_i * pair.bearing_i;
      const Eigen::Vector3d residual = g - pair.bearing_j;
      const double weight = LossWeight(residual.squaredNorm(), loss * loss);
      // d g / d delta = -[g]x; [g]x^T [g]x = I - g g^T.
      fit.H += weight * (Eigen::Matrix3d::Identity() - g * g.transpose());
      gradient += weight * g.cross(residual);
    }
    const Eigen::Vector3d step = -fit.H.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    fit.j_from_i = Rotation::Exp(step) * fit.j_from_i;
    if (step.norm() < 1e-9) break;
  }
  return fit;
}

// Sum of log(1 + r^2 / s^2) of the Sampson distances r, cut off at the threshold; smaller is
// better. A match is worth more the nearer it is at every scale above s = `finest`, so that two
// models which share their inliers are told apart by the matches' own noise, whatever that is.
double Score(const std::vector<BearingPair>& pairs,
             const EpipolarModel& model,
             double threshold,
             double finest,
             int* num_inliers) {
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  const double outlier = 1.0 + threshold * threshold / (finest * finest);
  // Logarithms are slow: take one of a product of many factors, each at most `outlier`.
  constexpr int kFactors = 16;
  double score = 0.0;
  double product = 1.0;
  int count = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const double r = SampsonDistance(pairs[k], R_j_i, model.direction);
    const bool behind = pairs[k].bearing_j.dot(R_j_i * pairs[k].bearing_i) < 0.0;
    const bool inlier = !behind && std::abs(r) < threshold;
    product *= inlier ? 1.0 + r * r / (finest * finest) : outlier;
    count += inlier;
    if (k % kFactors == kFactors - 1) {
      score += std::log(product);
      product = 1.0;
    }
  }
  *num_inliers = count;
  return score + std::log(product);
}

// Directions in which the translation may point, the rotation given, the best one first.
Eigen::Matrix3d DirectionsFor(const std::vector<BearingPair>& pairs, const Rotation& j_from_i) {
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d R_j_i = j_from_i.Matrix();
  for (const BearingPair& pair : pairs) {
    const Eigen::Vector3d n = (R_j_i * pair.bearing_i).cross(pair.bearing_j);
    // Normalising bounds what one wrong match can do.
    M += n * n.transpose() / (n.squaredNorm() + 1e-6);
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(M).eigenvectors();
}

int SamplesNeeded(double inlier_ratio, int sample_size, double confidence, int max_samples) {
  const double all_good = std::pow(std::clamp(inlier_ratio, 0.0, 1.0), sample_size);
  if (all_good > 1.0 - 1e-9) return 1;
  if (all_good < 1e-12) return max_samples;
  const double needed = std::log(1.0 - confidence) / std::log1p(-all_good);
  return static_cast<int>(std::min<double>(max_samples, std::ceil(needed)));
}

class Sampler {
 public:
  Sampler(int population, std::uint64_t seed) : population_(population), random_(seed) {}

  // `count` different indices.
  const std::vector<int>& Draw(int count) {
    drawn_.clear();
    while (static_cast<int>(drawn_.size()) < count) {
      const int index = static_cast<int>(random_() % static_cast<std::uint64_t>(population_));
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
  int population_;
  std::mt19937_64 random_;
  std::vector<int> drawn_;
};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Robust standard deviation of the Sampson distance among the pairs within `threshold`.
double NoiseOf(const std::vector<BearingPair>& pairs,
               const EpipolarModel& model,
               double threshold,
               double smallest) {
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  std::vector<double> distances;
  for (const BearingPair& pair : pairs) {
    const double r = std::abs(SampsonDistance(pair, R_j_i, model.direction));
    if (r < threshold) distances.push_back(r);
  }
  // 1.4826: from the median absolute value to the standard deviation of a normal.
  return distances.empty() ? threshold : std::max(1.4826 * Median(std::move(distances)), smallest);
}

// Refines at the scale of the noise that the model itself shows, again and again as that comes
// down.
EpipolarModel Descend(const std::vector<BearingPair>& pairs,
                      EpipolarModel model,
                      double threshold,
                      double smallest_noise,
                      double loss_sigmas) {
  constexpr int kScales = 3;
  constexpr int kIterations = 4;
  for (int k = 0; k < kScales; ++k) {
    const double noise = NoiseOf(pairs, model, threshold, smallest_noise);
    model = RefineEpipolar(pairs, model, loss_sigmas * noise, kIterations);
  }
  return model;
}

// About `count` of the pairs, evenly spread over their order.
std::vector<BearingPair> Thinned(const std::vector<BearingPair>& pairs, std::size_t count) {
  std::vector<BearingPair> thinned;
  const std::size_t step = std::max<std::size_t>(1, pairs.size() / count);
  for (std::size_t k = 0; k < pairs.size(); k += step) thinned.push_back(pairs[k]);
  return thinned;
}

struct Consensus {
  EpipolarModel model;
  int num_inliers = 0;
  int num_samples = 0;
};

// With little parallax the epipolar distance has several minima, a rotation traded for a
// translation. So the search descends from the prediction and from the rotation that aligns the
// bearings best, each with every principal direction of the flow, and then from small samples.
Consensus FindConsensus(const std::vector<BearingPair>& pairs,
                        const Rotation& predicted,
                        double focal_px,
                        const RelativeRotationOptions& options,
                        std::uint64_t seed) {
  constexpr std::size_t kThinnedSize = 250;
  const double threshold = options.inlier_px / focal_px;
  const double smallest_noise = options.min_noise_px / focal_px;
  const double finest = options.finest_px / focal_px;
  const std::vector<BearingPair> thinned = Thinned(pairs, kThinnedSize);

  Consensus best;
  double best_score = std::numeric_limits<double>::infinity();
  const auto consider = [&](const EpipolarModel& model) {
    int num_inliers = 0;
    const double score = Score(pairs, model, threshold, finest, &num_inliers);
    if (score >= best_score) return false;
    best_score = score;
    best.model = model;
    best.num_inliers = num_inliers;
    return true;
  };
  const auto polish = [&] {
    consider(Descend(thinned, best.model, threshold, smallest_noise, options.loss_sigmas));
  };

  for (const Rotation& rotation :
       {predicted, RefineRotation(thinned, predicted, threshold, 8).j_from_i}) {
    const Eigen::Matrix3d directions = DirectionsFor(thinned, rotation);
    for (int k = 0; k < 3; ++k) {
      consider(Descend(
          thinned, {rotation, directions.col(k)}, threshold, smallest_noise, options.loss_sigmas));
    }
  }

  const int num_pairs = static_cast<int>(pairs.size());
  const int sample_size = std::min(options.sample_size, num_pairs);
  const auto samples_needed = [&] {
    const double ratio = static_cast<double>(best.num_inliers) / num_pairs;
    const int needed = SamplesNeeded(ratio, sample_size, options.confidence, options.max_samples);
    return std::max(needed, std::min(options.min_samples, options.max_samples));
  };
  Sampler sampler(num_pairs, seed);
  int needed = samples_needed();
  std::vector<BearingPair> sample;
  for (best.num_samples = 0; best.num_samples < needed; ++best.num_samples) {
    bool improved = false;
    // Two bearings fix a rotation when the baseline is small: cheap, and the way out of a bad
    // prediction.
    sample.clear();
    for (const int index : sampler.Draw(2)) sample.push_back(pairs[index]);
    if (const std::optional<Rotation> rotation = AlignBearings(sample)) {
      improved |= consider({*rotation, best.model.direction});
    }
    // Large samples bear noise and small baselines better, small ones miss the wrong matches more
    // often.
    const int size = best.num_samples % 2 == 0 ? sample_size : std::min(kSmallSample, num_pairs);
    NormalEpipolarSums sums;
    for (const int index : sampler.Draw(size)) sums.Add(pairs[index]);
    const Rotation start =
        Rotation::Exp(kStartScatterDeg * kRadFromDeg * sampler.DrawInBall()) * best.model.j_from_i;
    const NormalEpipolarMinimum minimum = MinimizeNormalEpipolar(sums, start, 10);
    improved |= consider({minimum.j_from_i, minimum.translation_direction});
    if (improved) {
      polish();
      needed = samples_needed();
    }
  }
  return best;
}

// Torr's geometric information criterion for four-dimensional data (two image points a match).
struct ModelChoice {
  double epipolar = 0.0;
  double rotation = 0.0;
};

ModelChoice InformationCriterion(const std::vector<BearingPair>& pairs,
                                 const EpipolarModel& epipolar,
                                 const Rotation& rotation,
                                 double noise) {
  const double n = static_cast<double>(pairs.size());
  const double per_dimension = std::log(4.0);
  const double per_parameter = std::log(4.0 * n);
  const Eigen::Matrix3d R_epipolar = epipolar.j_from_i.Matrix();
  const Eigen::Matrix3d R_rotation = rotation.Matrix();
  ModelChoice choice;
  for (const BearingPair& pair : pairs) {
    const double r = SampsonDistance(pair, R_epipolar, epipolar.direction) / noise;
    choice.epipolar += std::min(r * r, 2.0);
    // Both images' noise enters the difference of the bearings, so its variance per axis is twice
    // the noise's.
    const double flow =
        (R_rotation * pair.bearing_i - pair.bearing_j).squaredNorm() / (2.0 * noise * noise);
    choice.rotation += std::min(flow, 4.0);
  }
  choice.epipolar += 3.0 * n * per_dimension + 5.0 * per_parameter;
  choice.rotation += 2.0 * n * per_dimension + 3.0 * per_parameter;
  return choice;
}

// Sign of the direction that puts most points in front of both cameras.
Eigen::Vector3d WithForwardSign(const std::vector<BearingPair>& pairs,
                                const std::vector<int>& inliers,
                                const EpipolarModel& model) {
  const Eigen::Matrix3d R_j_i = model.j_from_i.Matrix();
  double votes = 0.0;
  for (const int index : inliers) {
    // x_j = depth_i g + t in front means that moving from g to f turns towards t.
    const Eigen::Vector3d g = R_j_i * pairs[index].bearing_i;
    votes += g.cross(pairs[index].bearing_j).dot(g.cross(model.direction)) > 0.0 ? 1.0 : -1.0;
  }
  return votes >= 0.0 ? model.direction : Eigen::Vector3d(-model.direction);
}

}  // namespace

std::optional<std::string> RelativeRotationOptions::Problem() const {
  if (!(inlier_px > 0.0)) return OutOfRange("inlier_px", inlier_px, "positive");
  if (!(loss_sigmas > 0.0)) return OutOfRange("loss_sigmas", loss_sigmas, "positive");
  if (!(min_noise_px > 0.0)) return OutOfRange("min_noise_px", min_noise_px, "positive");
  if (!(shared_error_px >= 0.0)) {
    return OutOfRange("shared_error_px", shared_error_px, "zero or more");
  }
  if (!(finest_px > 0.0)) return OutOfRange("finest_px", finest_px, "positive");
  if (min_samples < 0) return OutOfRange("min_samples", min_samples, "zero or more");
  if (sample_size < 5) return OutOfRange("sample_size", sample_size, "at least 5");
  if (!(confidence > 0.0 && confidence < 1.0)) {
    return "confidence = " + std::to_string(confidence) + ": must lie between 0 and 1";
  }
  if (max_samples < 1) return OutOfRange("max_samples", max_samples, "at least 1");
  if (refine_iterations < 1) {
    return OutOfRange("refine_iterations", refine_iterations, "at least 1");
  }
  if (min_inliers < 6) return OutOfRange("min_inliers", min_inliers, "at least 6");
  return std::nullopt;
}

std::optional<RelativeRotationEstimate> EstimateRelativeRotation(
    const std::vector<BearingPair>& pairs,
    const Rotation& predicted_j_from_i,
    double focal_px,
    const RelativeRotationOptions& options,
    std::uint64_t seed) {
  if (const auto problem = options.Problem())
    throw std::invalid_argument("RelativeRotationOptions: " + *problem);
  for (const BearingPair& pair : pairs) {
    if (!pair.bearing_i.allFinite() || !pair.bearing_j.allFinite()) {
      throw std::invalid_argument("EstimateRelativeRotation: a bearing is not finite");
    }
  }
  if (static_cast<int>(pairs.size()) < options.min_inliers) return std::nullopt;

  const double threshold = options.inlier_px / focal_px;
  const double smallest_noise = options.min_noise_px / focal_px;
  const Consensus consensus = FindConsensus(pairs, predicted_j_from_i, focal_px, options, seed);
  if (consensus.num_inliers < options.min_inliers) return std::nullopt;

  const double loss =
      options.loss_sigmas * NoiseOf(pairs, consensus.model, threshold, smallest_noise);
  const EpipolarModel epipolar =
      RefineEpipolar(pairs, consensus.model, loss, options.refine_iterations);
  RelativeRotationEstimate estimate;
  estimate.num_samples = consensus.num_samples;

  const Eigen::Matrix3d R_epipolar = epipolar.j_from_i.Matrix();
  double squared_flow = 0.0;
  for (int index = 0; index < static_cast<int>(pairs.size()); ++index) {
    const double r = std::abs(SampsonDistance(pairs[index], R_epipolar, epipolar.direction));
    if (r > threshold || pairs[index].bearing_j.dot(R_epipolar * pairs[index].bearing_i) < 0.0)
      continue;
    estimate.inliers.push_back(index);
    squared_flow += (R_epipolar * pairs[index].bearing_i - pairs[index].bearing_j).squaredNorm();
  }
  if (static_cast<int>(estimate.inliers.size()) < options.min_inliers) return std::nullopt;
  const double num_inliers = static_cast<double>(estimate.inliers.size());
  estimate.parallax_px = std::sqrt(squared_flow / num_inliers) * focal_px;
  const double noise = NoiseOf(pairs, epipolar, threshold, smallest_noise);
  estimate.noise_px = noise * focal_px;

  const RotationFit rotation =
      RefineRotation(pairs, epipolar.j_from_i, 2.0 * loss, options.refine_iterations);
  const ModelChoice criterion = InformationCriterion(
      pairs, epipolar, rotation.j_from_i, std::hypot(noise, options.shared_error_px / focal_px));
  estimate.rotation_only = criterion.rotation < criterion.epipolar;
  if (estimate.rotation_only) {
    estimate.j_from_i = rotation.j_from_i;
    estimate.translation_direction.setZero();
    estimate.covariance = 2.0 * noise * noise * rotation.H.inverse();
    return estimate;
  }
  estimate.j_from_i = epipolar.j_from_i;
  estimate.translation_direction = WithForwardSign(pairs, estimate.inliers, epipolar);
  const Matrix5 H = LinearizeEpipolar(pairs, epipolar, loss).H;
  const Eigen::Matrix<double, 3, 2> H_rt = H.topRightCorner<3, 2>();
  const Eigen::Matrix3d H_rotation =
      H.topLeftCorner<3, 3>() - H_rt * H.bottomRightCorner<2, 2>().inverse() * H_rt.transpose();
  estimate.covariance = noise * noise * H_rotation.inverse();
  return estimate;
}

}  // namespace rotslam
