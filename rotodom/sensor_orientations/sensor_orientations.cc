#include "rotodom/sensor_orientations/sensor_orientations.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "rotodom/sensor_orientations/orientation_pairing.h"
#include "rotodom/sensor_orientations/sensor_alignment.h"
#include "rotodom/sensor_orientations/world_walk.h"
#include "rotodom/types/median.h"
#include "rotodom/types/options.h"

namespace rotslam {
namespace {

constexpr std::size_t kLeastOrientations = 3;
// Nothing, but enough where there is nothing else.
constexpr double kOutlierWeight = 1e-9;

void Check(const ImageOrientations& images,
           const std::vector<StampedRotation>& given,
           const SensorFusionOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("SensorFusionOptions: " + *problem);
  }
  const std::size_t num_frames = images.timestamps_s.size();
  if (num_frames < 2 || images.cam_from_world.size() != num_frames ||
      images.step_variance.size() + 1 != num_frames ||
      (!images.is_known.empty() && images.is_known.size() != num_frames)) {
    throw std::invalid_argument(
        "FuseOrientations: n timestamps and orientations, n at least 2, and n - 1 variances of "
        "steps are needed");
  }
  if (given.size() < 2) {
    throw std::invalid_argument("FuseOrientations: at least two orientations are needed");
  }
}

// Median angle between the turns of camera and sensor from pair to pair.
double Disagreement(const std::vector<OrientationPair>& pairs,
                    const Rotation& cam_from_sensor,
                    const std::vector<double>& step_variance) {
  const WorldWalk walk(pairs, cam_from_sensor, step_variance);
  std::vector<double> angles;
  angles.reserve(pairs.size());
  for (const FrameChain& chain : walk.chains()) {
    for (std::size_t m = chain.begin; m + 1 < chain.end; ++m) {
      angles.push_back((walk.vectors().row(m + 1) - walk.vectors().row(m)).norm());
    }
  }
  return Median(std::move(angles));
}

// The frames of a chain: E smoothed, its steps shared out to images and sensor.
void FuseChain(const ImageOrientations& images,
               const WorldWalk& walk,
               const SensorNoise& noise,
               const FrameChain& chain,
               SensorFusion& fusion) {
  Eigen::VectorXd weights(walk.vectors().rows());
  for (Eigen::Index m = 0; m < weights.size(); ++m)
    weights[m] = noise.is_outlier[m] ? kOutlierWeight : 1.0;
  std::vector<double> variances;
  const Eigen::MatrixXd smoothed = walk.Smooth(chain, noise, weights, walk.vectors(), &variances);
  const int size = chain.last - chain.first + 1;
  // The images' part of the walk; the sensor's is the rest, and zero on average.
  Eigen::MatrixXd part = Eigen::MatrixXd::Zero(size, 3);
  std::vector<double> own(size, 0.0);  // variance that the sum of both walks does not tell
  std::vector<double> share(size, 1.0);
  for (int k = 1; k < size; ++k) {
    const double by_images = walk.ImageStep(chain.first + k - 1);
    share[k] = by_images / (by_images + noise.step_variance);
    part.row(k) = part.row(k - 1) + share[k] * (smoothed.row(k) - smoothed.row(k - 1));
    own[k] = own[k - 1] + share[k] * noise.step_variance;
  }
  share[0] = size > 1 ? share[1] : 1.0;
  const Eigen::RowVector3d rest = (smoothed - part).colwise().mean();
  for (int k = 0; k < size; ++k) {
    const int frame = chain.first + k;
    const Eigen::Vector3d vector = (part.row(k) + rest).transpose();
    fusion.cam_from_world[frame] =
        images.cam_from_world[frame] * chain.reference * Rotation::Exp(vector);
    const double shared = fusion.systematic_rad * fusion.systematic_rad;
    fusion.variance[frame] = share[k] * share[k] * (variances[k] + shared) + own[k];
    fusion.source[frame] = OrientationSource::kImages;
  }
}

// Frames of chains without the sensor: in the world of the chain before, or of that behind.
void FollowNeighbours(const ImageOrientations& images,
                      const std::vector<bool>& is_fused,
                      SensorFusion& fusion) {
  const auto num_frames = static_cast<int>(is_fused.size());
  int before = -1;
  for (int k = 0; k < num_frames; ++k) {
    if (is_fused[k]) {
      before = k;
      continue;
    }
    int from = before;
    for (int behind = k; from < 0; ++behind) {
      if (is_fused[behind]) from = behind;
    }
    fusion.cam_from_world[k] = images.cam_from_world[k] * images.cam_from_world[from].Inverse() *
                               fusion.cam_from_world[from];
    fusion.variance[k] = std::numeric_limits<double>::infinity();
    fusion.source[k] = OrientationSource::kImages;
  }
}

// The images' frames of which they tell anything, and their numbers.
ImageOrientations KnownFrames(const ImageOrientations& images, std::vector<int>& numbers) {
  ImageOrientations known;
  double step = 0.0;
  for (std::size_t k = 0; k < images.timestamps_s.size(); ++k) {
    if (k > 0) step = std::max(step, images.step_variance[k - 1]);
    if (!images.is_known.empty() && !images.is_known[k]) continue;
    if (!numbers.empty()) known.step_variance.push_back(step);
    step = 0.0;
    numbers.push_back(static_cast<int>(k));
    known.timestamps_s.push_back(images.timestamps_s[k]);
    known.cam_from_world.push_back(images.cam_from_world[k]);
  }
  return known;
}

// What is wrong with orientations by their alignment, against one another, rad: as far as it is
// known to be wrong and was not taken out, and by its uncertainty.
double SystematicError(const ImageOrientations& images,
                       const OrientationPairing& pairing,
                       const SensorAlignment& alignment,
                       bool is_taken_out) {
  double squared_offset_s = alignment.offset_sigma_s * alignment.offset_sigma_s;
  Eigen::Matrix3d mounting = alignment.mounting_covariance;
  if (!is_taken_out && alignment.has_offset) {
    squared_offset_s += alignment.offset_s * alignment.offset_s;
  }
  if (!is_taken_out && alignment.has_mounting) {
    const Eigen::Vector3d turn = alignment.cam_from_sensor.Log();
    mounting += turn * turn.transpose();
  }
  const double weight = 1.0 / static_cast<double>(images.timestamps_s.size());
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  double squared_rate = 0.0;
  for (std::size_t k = 0; k < images.timestamps_s.size(); ++k) {
    mean += weight * images.cam_from_world[k].Matrix();
    squared_rate += weight * pairing.images().RateAt(images.timestamps_s[k]).squaredNorm() / 3.0;
  }
  // A mounting error x moves orientation k by R_k^T x, of which the mean is another world.
  double squared = squared_rate * squared_offset_s;
  for (const Rotation& rotation : images.cam_from_world) {
    const Eigen::Matrix3d J = (rotation.Matrix() - mean).transpose();
    squared += weight * (J * mounting * J.transpose()).trace() / 3.0;
  }
  return std::sqrt(squared);
}

// A misalignment that is known and not taken out counts as a drift from frame to frame, rad^2: it
// comes through as the motion goes on. So does one that may be there, where it is larger than all
// the drift of the images and may hide in the sensor's noise.
double DriftOfMisalignment(const ImageOrientations& images,
                           const OrientationPairing& pairing,
                           double systematic_rad,
                           bool is_known) {
  constexpr double kMotionS = 1.0;  // how long a motion lasts
  double walked = 0.0;
  for (const double variance : images.step_variance) {
    if (std::isfinite(variance) && !is_known) walked += variance;
  }
  const double excess = std::max(0.0, systematic_rad * systematic_rad - walked);
  return 2.0 * excess * pairing.frame_interval_s() / kMotionS;
}

// Puts the frames in, of which the images tell nothing: the sensor's orientations, turned as those
// of the frames beside them are by the fusion.
SensorFusion WithAllFrames(const ImageOrientations& images,
                           const std::vector<int>& numbers,
                           const SensorFusion& fusion,
                           const std::vector<std::optional<Rotation>>& by_sensor) {
  const std::size_t num_frames = images.timestamps_s.size();
  SensorFusion all = fusion;
  all.cam_from_world = images.cam_from_world;
  all.variance.assign(num_frames, std::numeric_limits<double>::infinity());
  all.source.assign(num_frames, OrientationSource::kNothing);
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    all.cam_from_world[numbers[n]] = fusion.cam_from_world[n];
    all.variance[numbers[n]] = fusion.variance[n];
    all.source[numbers[n]] = fusion.source[n];
  }
  // Between the sensor's world and that of the fusion, where both are known.
  const auto turn_of = [&](int frame) {
    return by_sensor[frame]->Inverse() * all.cam_from_world[frame];
  };
  const auto has_both = [&](int frame) {
    return by_sensor[frame].has_value() && (all.source[frame] == OrientationSource::kBoth ||
                                            all.source[frame] == OrientationSource::kImages);
  };
  const auto size = static_cast<int>(num_frames);
  std::vector<int> before(num_frames, -1);
  std::vector<int> behind(num_frames, -1);
  for (int k = 0; k < size; ++k) before[k] = has_both(k) ? k : k > 0 ? before[k - 1] : -1;
  for (int k = size - 1; k >= 0; --k) {
    behind[k] = has_both(k) ? k : k + 1 < size ? behind[k + 1] : -1;
  }
  for (int k = 0; k < size; ++k) {
    if (all.source[k] != OrientationSource::kNothing || !by_sensor[k]) continue;
    Rotation turn;
    if (before[k] >= 0 && behind[k] >= 0) {
      const double from_s = images.timestamps_s[before[k]];
      const double to_s = images.timestamps_s[behind[k]];
      turn = Interpolate(turn_of(before[k]),
                         turn_of(behind[k]),
                         (images.timestamps_s[k] - from_s) / (to_s - from_s));
    } else if (before[k] >= 0 || behind[k] >= 0) {
      turn = turn_of(std::max(before[k], behind[k]));
    }
    all.cam_from_world[k] = *by_sensor[k] * turn;
    all.variance[k] =
        fusion.sigma_rad * fusion.sigma_rad + fusion.systematic_rad * fusion.systematic_rad;
  }
  for (int k = 0; k < size; ++k) {
    if (all.source[k] == OrientationSource::kNothing && by_sensor[k]) {
      all.source[k] = OrientationSource::kSensor;
    }
  }
  return all;
}

}  // namespace

std::optional<std::string> SensorFusionOptions::Problem() const {
  if (!(max_offset_s >= 0.0 && max_offset_s <= 60.0)) {
    return OutOfRange("max_offset_s", max_offset_s, "from 0 to 60");
  }
  if (!(max_gap_s > 0.0)) return OutOfRange("max_gap_s", max_gap_s, "positive");
  return std::nullopt;
}

std::optional<SensorFusion> FuseOrientations(const ImageOrientations& all_images,
                                             const std::vector<StampedRotation>& given,
                                             const SensorFusionOptions& options) {
  Check(all_images, given, options);
  std::vector<int> numbers;
  const ImageOrientations images = KnownFrames(all_images, numbers);
  if (numbers.size() < kLeastOrientations) return std::nullopt;
  const OrientationPairing pairing(images, given, options.max_gap_s);
  SensorFusion fusion;
  fusion.alignment = AlignSensor(pairing, images.step_variance, options.max_offset_s);
  const SensorAlignment& alignment = fusion.alignment;
  const double offset_s = alignment.has_offset ? alignment.offset_s : 0.0;
  const Rotation mounting = alignment.has_mounting ? alignment.cam_from_sensor : Rotation();
  const double used_offset_s = options.use_alignment ? offset_s : 0.0;
  const Rotation used_mounting = options.use_alignment ? mounting : Rotation();
  const std::vector<OrientationPair> pairs = pairing.At(used_offset_s);
  if (pairs.size() < kLeastOrientations) return std::nullopt;
  fusion.disagreement_rad = Disagreement(pairing.At(0.0), Rotation(), images.step_variance);
  fusion.aligned_disagreement_rad =
      Disagreement(pairing.At(offset_s), mounting, images.step_variance);
  const WorldWalk walk(pairs, used_mounting, images.step_variance);
  fusion.systematic_rad = SystematicError(images, pairing, alignment, options.use_alignment);
  SensorNoise noise = walk.Noise();
  noise.step_variance += DriftOfMisalignment(
      images,
      pairing,
      fusion.systematic_rad,
      !options.use_alignment && (alignment.has_offset || alignment.has_mounting));
  fusion.sigma_rad = std::sqrt(noise.variance);
  fusion.drift_rad = std::sqrt(noise.step_variance);
  fusion.drifts_less = noise.step_variance < Median(images.step_variance);
  fusion.num_outliers = noise.num_outliers;
  const std::size_t num_frames = images.timestamps_s.size();
  fusion.cam_from_world.resize(num_frames);
  fusion.variance.resize(num_frames);
  fusion.source.resize(num_frames);
  std::vector<bool> is_fused(num_frames, false);
  for (const FrameChain& chain : walk.chains()) {
    FuseChain(images, walk, noise, chain, fusion);
    std::fill(is_fused.begin() + chain.first, is_fused.begin() + chain.last + 1, true);
  }
  FollowNeighbours(images, is_fused, fusion);
  for (std::size_t m = 0; m < pairs.size(); ++m) {
    if (!noise.is_outlier[m]) fusion.source[pairs[m].frame] = OrientationSource::kBoth;
  }
  std::vector<std::optional<Rotation>> by_sensor;
  by_sensor.reserve(all_images.timestamps_s.size());
  for (const double time_s : all_images.timestamps_s) {
    by_sensor.push_back(pairing.SensorAt(time_s + used_offset_s));
    if (by_sensor.back()) by_sensor.back() = used_mounting * *by_sensor.back();
  }
  return WithAllFrames(all_images, numbers, fusion, by_sensor);
}

}  // namespace rotslam
