#include "rotodom/self_calibration/lens_from_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>

#include <Eigen/Cholesky>

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

using PixelDerivatives = Eigen::Matrix<double, 3, 2>;  // of a bearing, per px

constexpr std::uint64_t kLensSeed = 1;
constexpr std::size_t kLeastPairsOfLens = 3;
// Standard deviation of a tracked point's distance from its epipolar line.
constexpr double kNoise_px = 0.25;
// Rotation (3) and direction of translation (2) of a pair.
constexpr int kPoseSize = 5;

// A pair's relative pose, as it is estimated.
struct PairPose {
  bool is_known = false;
  bool rotation_only = false;
  Rotation j_from_i;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // of the translation, unit
};

// A pixel's bearing, and how it moves with the pixel and with the lens.
struct LensRay {
  Eigen::Vector3d bearing;
  PixelDerivatives by_pixel;
  Eigen::Matrix<double, 2, kLensSize> pixel_by_lens;  // of the pixel that shows the bearing
};

std::optional<LensRay> RayOf(const Eigen::Vector2d& pixel,
                             const Camera& camera,
                             const Camera& reference) {
  // Smaller determinants are those of the distortion's fold, px^2 per rad^2, as a share of f^2.
  constexpr double kFold = 1e-3;
  const auto bearing = camera.Unproject(pixel);
  if (!bearing) return std::nullopt;
  Eigen::Matrix<double, 2, 3> by_point;
  if (!camera.Project(*bearing, &by_point)) return std::nullopt;
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(*bearing);
  const Eigen::Matrix2d by_tangent = by_point * basis;
  const double determinant = by_tangent.determinant();
  if (!(std::abs(determinant) > kFold * camera.fx * camera.fy)) return std::nullopt;
  return LensRay{
      *bearing, basis * by_tangent.inverse(), LensJacobian(camera, reference, *bearing, pixel)};
}

// One residual, px, and its derivatives.
struct LensResidual {
  double value = 0.0;
  Eigen::Matrix<double, kPoseSize, 1> by_pose = Eigen::Matrix<double, kPoseSize, 1>::Zero();
  LensParameters by_lens = LensParameters::Zero();
};

// Sampson distance in the image, for errors that are alike in both images.
LensResidual EpipolarResidual(const PairPose& pose, const LensRay& i, const LensRay& j) {
  constexpr double kLeastSlope = 1e-9;  // rad per px: at the epipole a point has no line
  const Eigen::Matrix3d R = pose.j_from_i.Matrix();
  const Eigen::Vector3d turned = R * i.bearing;
  const Eigen::Vector3d from_j = j.bearing.cross(pose.direction);
  const Eigen::Vector3d normal = pose.direction.cross(turned);
  const Eigen::Vector2d slope_i = i.by_pixel.transpose() * (R.transpose() * from_j);
  const Eigen::Vector2d slope_j = j.by_pixel.transpose() * normal;
  const double scale =
      1.0 / std::max(kLeastSlope, std::sqrt(slope_i.squaredNorm() + slope_j.squaredNorm()));
  LensResidual residual;
  residual.value = scale * j.bearing.dot(normal);
  residual.by_pose.head<3>() = scale * turned.cross(from_j);
  residual.by_pose.tail<2>() =
      scale * TangentBasis(pose.direction).transpose() * turned.cross(j.bearing);
  residual.by_lens =
      -scale * (i.pixel_by_lens.transpose() * slope_i + j.pixel_by_lens.transpose() * slope_j);
  return residual;
}

// Distance in image j from where the rotation leads the point of image i, along one of two axes of
// the tangent plane; sqrt(2) counts the errors of both images.
std::array<LensResidual, 2> RotationResiduals(const PairPose& pose,
                                              const LensRay& i,
                                              const LensRay& j) {
  const Eigen::Matrix3d R = pose.j_from_i.Matrix();
  const Eigen::Vector3d turned = R * i.bearing;
  // Pixels of image j per rad, near the point.
  const Eigen::Matrix<double, 2, 3> to_pixel =
      (j.by_pixel.transpose() * j.by_pixel).inverse() * j.by_pixel.transpose() / std::sqrt(2.0);
  const Eigen::Vector2d value = to_pixel * (turned - j.bearing);
  const Eigen::Matrix<double, 2, 3> by_rotation = -to_pixel * Skew(turned);
  const Eigen::Matrix<double, 2, kLensSize> by_lens =
      to_pixel * (-R * i.by_pixel * i.pixel_by_lens + j.by_pixel * j.pixel_by_lens);
  std::array<LensResidual, 2> residuals;
  for (int k = 0; k < 2; ++k) {
    residuals[k].value = value[k];
    residuals[k].by_pose.head<3>() = by_rotation.row(k).transpose();
    residuals[k].by_lens = by_lens.row(k).transpose();
  }
  return residuals;
}

// Normal equations of one pair, with the robust weights in them.
struct PairNormal {
  Eigen::Matrix<double, kPoseSize, kPoseSize> H_pose =
      Eigen::Matrix<double, kPoseSize, kPoseSize>::Zero();
  Eigen::Matrix<double, kPoseSize, kLensSize> H_mixed =
      Eigen::Matrix<double, kPoseSize, kLensSize>::Zero();
  Eigen::Matrix<double, kLensSize, kLensSize> H_lens =
      Eigen::Matrix<double, kLensSize, kLensSize>::Zero();
  Eigen::Matrix<double, kPoseSize, 1> g_pose = Eigen::Matrix<double, kPoseSize, 1>::Zero();
  LensParameters g_lens = LensParameters::Zero();
  double cost = 0.0;  // sum of r^2 / (loss^2 + r^2), at most one for a point
  int num_explained = 0;

  void Add(const LensResidual& residual, double weight) {
    H_pose += weight * residual.by_pose * residual.by_pose.transpose();
    H_mixed += weight * residual.by_pose * residual.by_lens.transpose();
    H_lens += weight * residual.by_lens * residual.by_lens.transpose();
    g_pose += weight * residual.value * residual.by_pose;
    g_lens += weight * residual.value * residual.by_lens;
  }
};

// Six parameters: a pair with its pose, two cameras and two thresholds; each call has others of
// them.
PairNormal Linearize(const LensPair& pair,
                     const PairPose& pose,
                     const Camera& camera,
                     const Camera& reference,
                     double loss_px,
                     double inlier_px) {
  PairNormal normal;
  for (const auto& [i_px, j_px] : pair.points) {
    const auto i = RayOf(i_px, camera, reference);
    const auto j = i ? RayOf(j_px, camera, reference) : std::nullopt;
    if (!j) {
      normal.cost += 1.0;
      continue;
    }
    std::array<LensResidual, 2> residuals;
    double square = 0.0;
    if (pose.rotation_only) {
      residuals = RotationResiduals(pose, *i, *j);
      square = residuals[0].value * residuals[0].value + residuals[1].value * residuals[1].value;
    } else {
      residuals[0] = EpipolarResidual(pose, *i, *j);
      square = residuals[0].value * residuals[0].value;
    }
    normal.num_explained += square < inlier_px * inlier_px ? 1 : 0;
    const double ratio = square / (loss_px * loss_px);
    normal.cost += ratio / (1.0 + ratio);
    const double weight = 1.0 / (loss_px * loss_px * (1.0 + ratio) * (1.0 + ratio));
    normal.Add(residuals[0], weight);
    if (pose.rotation_only) normal.Add(residuals[1], weight);
  }
  return normal;
}

PairPose Moved(const PairPose& pose, const Eigen::Matrix<double, kPoseSize, 1>& step) {
  PairPose moved = pose;
  moved.j_from_i = Rotation::Exp(step.head<3>()) * pose.j_from_i;
  moved.direction = (pose.direction + TangentBasis(pose.direction) * step.tail<2>()).normalized();
  return moved;
}

// The pairs, their poses and the lens, through the rounds of a fit.
class LensFitter {
 public:
  LensFitter(std::span<const LensPair> pairs,
             const LensPrior& prior,
             const Camera& start,
             const LensPairsOptions& options)
      : pairs_(pairs),
        prior_(prior),
        expected_(LensOf(prior.camera, prior.camera)),
        options_(options),
        poses_(pairs.size()),
        lens_(LensOf(start, prior.camera)) {}

  // Relative rotations through the lens as it stands.
  // @return  the number of pairs that have one.
  std::size_t EstimatePoses(double inlier_px) {
    const Camera camera = WithLens(prior_.camera, lens_);
    RelativeRotationOptions options = options_.relative_rotation;
    options.inlier_px = inlier_px;
    ParallelFor(static_cast<int>(pairs_.size()), options_.num_threads, [&](int n) {
      std::vector<BearingPair> bearings;
      for (const auto& [i_px, j_px] : pairs_[n].points) {
        const auto i = camera.Unproject(i_px);
        const auto j = camera.Unproject(j_px);
        if (i && j) bearings.push_back({*i, *j});
      }
      const Rotation predicted = poses_[n].is_known ? poses_[n].j_from_i : pairs_[n].j_from_i;
      const auto estimate =
          EstimateRelativeRotation({bearings}, predicted, camera.MeanFocal(), options, kLensSeed);
      PairPose& pose = poses_[n];
      pose.is_known = estimate.has_value();
      if (!estimate) return;
      pose.rotation_only = options_.rotates_only || estimate->translation_direction.isZero();
      pose.j_from_i = estimate->j_from_i;
      if (!pose.rotation_only) pose.direction = estimate->translation_direction;
    });
    return std::count_if(
        poses_.begin(), poses_.end(), [](const PairPose& pose) { return pose.is_known; });
  }

  void Minimise(double loss_px) {
    const int max_steps = options_.is_rough ? 4 : 8;
    constexpr double kLeastGain = 1e-4;  // share of the cost
    constexpr double kFirstDamping = 1e-3;
    constexpr double kMostDamping = 1e6;
    double damping = kFirstDamping;
    Evaluate(lens_, poses_, loss_px);
    for (int step = 0; step < max_steps && damping < kMostDamping; ++step) {
      const Step next = StepFrom(damping);
      const std::vector<PairNormal> before = normals_;
      const double cost_before = Cost(lens_);
      Evaluate(next.lens, next.poses, loss_px);
      const double cost = Cost(next.lens);
      if (!(cost < cost_before)) {
        normals_ = before;
        damping *= 10.0;
        continue;
      }
      lens_ = next.lens;
      poses_ = next.poses;
      damping = std::max(1e-9, damping * 0.1);
      if (cost_before - cost < kLeastGain * cost_before) break;
    }
  }

  FittedLens Result(double loss_px) {
    Evaluate(lens_, poses_, loss_px);
    FittedLens fit;
    fit.camera = WithLens(prior_.camera, lens_);
    fit.sigmas = Sigmas();
    double cost = 0.0;
    for (std::size_t n = 0; n < pairs_.size(); ++n) {
      const auto num_points = static_cast<int>(pairs_[n].points.size());
      fit.num_points += num_points;
      fit.num_pairs += poses_[n].is_known ? 1 : 0;
      fit.num_explained += normals_[n].num_explained;
      cost += poses_[n].is_known ? normals_[n].cost : num_points;
    }
    fit.cost = fit.num_points > 0 ? cost / fit.num_points : 1.0;
    return fit;
  }

 private:
  struct Step {
    LensParameters lens;
    std::vector<PairPose> poses;
  };

  void Evaluate(const LensParameters& lens, const std::vector<PairPose>& poses, double loss_px) {
    loss_px_ = loss_px;
    const Camera camera = WithLens(prior_.camera, lens);
    normals_.assign(pairs_.size(), PairNormal());
    const double inlier_px = options_.relative_rotation.inlier_px;
    ParallelFor(static_cast<int>(pairs_.size()), options_.num_threads, [&](int n) {
      if (!poses[n].is_known) return;
      normals_[n] = Linearize(pairs_[n], poses[n], camera, prior_.camera, loss_px, inlier_px);
    });
  }

  // Inverse variances of the parameters that move, in units of the loss; the others are held by
  // large ones.
  LensParameters PriorWeights() const {
    constexpr double kHeld = 1e16;
    const double unit = kNoise_px / loss_px_;
    return (prior_.sigmas.array() > 0.0)
        .select(unit * unit * prior_.sigmas.array().max(1e-8).square().inverse(), kHeld);
  }

  double Cost(const LensParameters& lens) const {
    double cost = PriorWeights().dot((lens - expected_).cwiseAbs2());
    for (const PairNormal& normal : normals_) cost += normal.cost;
    return cost;
  }

  // The lens' normal equations with the poses eliminated.
  Eigen::Matrix<double, kLensSize, kLensSize> Reduced(double damping,
                                                      LensParameters& gradient) const {
    const LensParameters weights = PriorWeights();
    Eigen::Matrix<double, kLensSize, kLensSize> H = weights.asDiagonal();
    gradient = weights.cwiseProduct(lens_ - expected_);
    for (const PairNormal& normal : normals_) {
      const auto factor = FactorOf(normal, damping);
      H += normal.H_lens - normal.H_mixed.transpose() * factor.solve(normal.H_mixed);
      gradient += normal.g_lens - normal.H_mixed.transpose() * factor.solve(normal.g_pose);
    }
    return H;
  }

  static Eigen::LDLT<Eigen::Matrix<double, kPoseSize, kPoseSize>> FactorOf(const PairNormal& normal,
                                                                           double damping) {
    constexpr double kLeast = 1e-9;  // of directions that do not count
    Eigen::Matrix<double, kPoseSize, kPoseSize> H = normal.H_pose;
    H.diagonal() *= 1.0 + damping;
    H.diagonal().array() += kLeast * (1.0 + normal.H_pose.trace());
    return H.ldlt();
  }

  Step StepFrom(double damping) const {
    LensParameters gradient;
    Eigen::Matrix<double, kLensSize, kLensSize> H = Reduced(damping, gradient);
    H.diagonal() *= 1.0 + damping;
    // What is held keeps its last bit.
    const LensParameters change =
        (prior_.sigmas.array() > 0.0).select(-H.ldlt().solve(gradient), 0.0);
    Step step;
    step.lens = lens_ + change;
    step.poses = poses_;
    for (std::size_t n = 0; n < poses_.size(); ++n) {
      if (!poses_[n].is_known) continue;
      const Eigen::Matrix<double, kPoseSize, 1> right =
          normals_[n].g_pose + normals_[n].H_mixed * change;
      step.poses[n] = Moved(poses_[n], -FactorOf(normals_[n], damping).solve(right));
    }
    return step;
  }

  // By the curvature where the fit ended, the weights of the loss in it.
  LensParameters Sigmas() const {
    LensParameters gradient;
    const Eigen::Matrix<double, kLensSize, kLensSize> covariance = Reduced(0.0, gradient).inverse();
    const LensParameters sigmas =
        kNoise_px / loss_px_ * covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
    return (prior_.sigmas.array() > 0.0).select(sigmas, 0.0);
  }

  std::span<const LensPair> pairs_;
  const LensPrior& prior_;
  LensParameters expected_;
  const LensPairsOptions& options_;
  std::vector<PairPose> poses_;
  LensParameters lens_;
  double loss_px_ = 1.0;  // of normals_
  std::vector<PairNormal> normals_;
};

}  // namespace

std::optional<FittedLens> FitLensToPairs(std::span<const LensPair> pairs,
                                         const LensPrior& prior,
                                         const Camera& start,
                                         const LensPairsOptions& options) {
  // Scales of the loss of the rounds, as multiples of inlier_px: through a lens that is off, points
  // are several pixels from their lines, and farther from where a rotation leads them.
  constexpr std::array kRough = {3.0, 1.0};
  constexpr std::array kOfMotion = {3.0, 1.5, 1.0, 0.4};
  constexpr std::array kOfRotation = {12.0, 3.0, 1.0, 0.4};
  const double inlier_px = options.relative_rotation.inlier_px;
  std::span<const double> widths = options.rotates_only ? kOfRotation : kOfMotion;
  if (options.is_rough && !options.rotates_only) widths = kRough;
  LensFitter fitter(pairs, prior, start, options);
  for (const double width : widths) {
    // Inliers of the estimates, which become inaccurate where the threshold is far off.
    const double threshold_px = std::clamp(width, 1.0, 3.0) * inlier_px;
    if (fitter.EstimatePoses(threshold_px) < kLeastPairsOfLens) return std::nullopt;
    fitter.Minimise(width * inlier_px);
  }
  return fitter.Result(widths.back() * inlier_px);
}

double CostOfLens(std::span<const LensPair> pairs,
                  const Camera& camera,
                  const LensPairsOptions& options) {
  const LensPrior held = {camera, LensParameters::Zero()};
  LensFitter fitter(pairs, held, camera, options);
  const double inlier_px = options.relative_rotation.inlier_px;
  fitter.EstimatePoses(inlier_px);
  return fitter.Result(inlier_px).cost;
}

}  // namespace rotslam
