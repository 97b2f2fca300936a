#include "rotodom/matching/patch_alignment.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include <Eigen/Dense>

#include "rotodom/simd/simd_level.h"

namespace rotslam {
namespace {

constexpr int kHalf = kPatchSide / 2;
constexpr int kNumPixels = kPatchSide * kPatchSide;
constexpr int kMaxIterations = 12;   // of Gauss-Newton
constexpr float kMinStepPx = 0.01F;  // below the accuracy of an alignment, 0.02 px
// Smallest ratio of the Hessian's eigenvalues; below it the patch has structure in one direction
// only.
constexpr float kMinStructure = 0.01F;
// Smallest mean squared gradient in any direction, (grey levels per pixel)^2; below it noise
// dominates.
constexpr float kMinGradientEnergy = 1.0F;

}  // namespace

const PatchLoops& BestPatchLoops() {
#if defined(__x86_64__)
  switch (UsedSimdLevel()) {
    case SimdLevel::kAvx512:
      return kPatchLoopsAvx512;
    case SimdLevel::kAvx2:
      return kPatchLoopsAvx2;
    case SimdLevel::kBaseline:
      break;
  }
#endif
  return kPatchLoopsBaseline;
}

namespace {

// Copies the pixels around a patch; the first one is (x, y). Six parameters: it runs for every
// patch, and a struct of them would be built for this call alone.
// @return  false when they leave the image.
bool LoadWindow(
    const PatchLoops& loops, const cv::Mat& image, int x, int y, int side, PatchWindow& window) {
  if (x < 0 || y < 0 || x + side > image.cols || y + side > image.rows) return false;
  const std::uint8_t* pixels = image.ptr<std::uint8_t>(y) + x;
  const auto step = static_cast<std::ptrdiff_t>(image.step);
  if (x + kPatchStride <= image.cols) {
    loops.load(pixels, step, side, &window);
    return true;
  }
  // At the right border a whole row would leave the image.
  std::fill(std::begin(window.values), std::end(window.values), 0.0F);
  for (int row = 0; row < side; ++row, pixels += step) {
    std::copy(
        pixels, pixels + side, window.values + static_cast<std::ptrdiff_t>(row) * kPatchStride);
  }
  return true;
}

PixelWeights BilinearWeights(float x, float y) {
  return {(1.0F - x) * (1.0F - y), x * (1.0F - y), (1.0F - x) * y, x * y};
}

// Ratio of the noise variance of interpolated values to that of pixels.
float NoiseLeft(const PixelWeights& weights) {
  const auto& [w00, w10, w01, w11] = weights;
  return w00 * w00 + w10 * w10 + w01 * w01 + w11 * w11;
}

// Mean of NoiseLeft over all fractions of a pixel.
constexpr float kMeanNoiseLeft = 4.0F / 9.0F;

// Where the pixels of a patch of half side `half` lie around a position.
struct PixelGrid {
  PixelGrid(const Eigen::Vector2f& center, int half)
      : x(static_cast<int>(std::floor(center.x() - static_cast<float>(half)))),
        y(static_cast<int>(std::floor(center.y() - static_cast<float>(half)))),
        weights(BilinearWeights(center.x() - static_cast<float>(half) - static_cast<float>(x),
                                center.y() - static_cast<float>(half) - static_cast<float>(y))) {}
  int x;
  int y;
  PixelWeights weights;
};

// Returns the noise ratio (NoiseLeft); nullopt where the patch leaves the image.
std::optional<float> SampleShifted(const PatchLoops& loops,
                                   const cv::Mat& image,
                                   const Eigen::Vector2f& center,
                                   PatchWindow& sampled) {
  const PixelGrid grid(center, kHalf + 1);
  PatchWindow window;
  if (!LoadWindow(loops, image, grid.x, grid.y, kSampledSide + 1, window)) return std::nullopt;
  loops.shift(&window, &grid.weights, &sampled);
  return NoiseLeft(grid.weights);
}

std::optional<float> SampleWarped(const PatchLoops& loops,
                                  const cv::Mat& image,
                                  const Eigen::Vector2f& center,
                                  const Eigen::Matrix2f& view_from_patch,
                                  PatchWindow& sampled) {
  const float reach = static_cast<float>(kHalf + 1);
  const Eigen::Vector2f extent =
      view_from_patch.cwiseAbs() * Eigen::Vector2f(reach, reach) + Eigen::Vector2f(1.0F, 1.0F);
  const bool is_inside = center.x() - extent.x() >= 0.0F && center.y() - extent.y() >= 0.0F &&
                         center.x() + extent.x() < static_cast<float>(image.cols - 1) &&
                         center.y() + extent.y() < static_cast<float>(image.rows - 1);
  if (!is_inside) return std::nullopt;
  const Eigen::Matrix<float, 2, 2, Eigen::RowMajor> A = view_from_patch;
  loops.warp(
      image.data, static_cast<std::ptrdiff_t>(image.step), center.data(), A.data(), &sampled);
  return kMeanNoiseLeft;
}

// Inverse of the Hessian; nullopt where the patch has too little structure in some direction.
std::optional<Eigen::Matrix2f> InverseIfStructured(float xx, float xy, float yy) {
  Eigen::Matrix2f hessian;
  hessian << xx, xy, xy, yy;
  const float half_trace = 0.5F * hessian.trace();
  const float determinant = hessian.determinant();
  const float root = std::sqrt(std::max(0.0F, half_trace * half_trace - determinant));
  const float smallest = half_trace - root;
  if (!(smallest > kMinStructure * (half_trace + root)) ||
      !(smallest > kMinGradientEnergy * kNumPixels)) {
    return std::nullopt;
  }
  return hessian.inverse();
}

}  // namespace

std::optional<PatchTemplate> PatchTemplate::Sample(const cv::Mat& image,
                                                   const Eigen::Vector2d& center_px,
                                                   const Eigen::Matrix2d& patch_from_view) {
  const PatchLoops& loops = BestPatchLoops();
  PatchWindow sampled = {};
  const Eigen::Vector2f center = center_px.cast<float>();
  // A warp that moves the corners of the patch by less than a tenth of a pixel is ignored.
  const bool shifted_only =
      (patch_from_view - Eigen::Matrix2d::Identity()).cwiseAbs().maxCoeff() * kHalf < 0.1;
  const std::optional<float> noise_left =
      shifted_only
          ? SampleShifted(loops, image, center, sampled)
          : SampleWarped(loops, image, center, patch_from_view.inverse().cast<float>(), sampled);
  if (!noise_left) return std::nullopt;

  std::optional<PatchTemplate> patch(std::in_place);
  PatchMoments moments;
  loops.prepare(&sampled, &patch->planes_, &moments);
  if (!(moments.energy > kNumPixels * kMinGradientEnergy)) return std::nullopt;
  const auto inverse = InverseIfStructured(moments.xx, moments.xy, moments.yy);
  if (!inverse) return std::nullopt;
  patch->energy_ = moments.energy;
  patch->noise_left_ = *noise_left;
  patch->inverse_hessian_ = *inverse;
  patch->mean_gradient_ = {moments.mean_x, moments.mean_y};
  patch->gradient_share_ = {moments.share_x, moments.share_y};
  return patch;
}

struct PatchAligner {
  static std::optional<PatchAlignment> AlignmentAt(const PatchTemplate& patch,
                                                   const Eigen::Vector2f& center,
                                                   const PatchSums& sums,
                                                   const PixelWeights& weights) {
    const float along = sums.values;
    const float noise_left = 0.5F * (patch.noise_left_ + NoiseLeft(weights));
    const float variance = sums.squares - sums.sum * sums.sum / kNumPixels;
    if (!(variance > 0.0F) || !(along > 0.0F)) return std::nullopt;
    PatchAlignment alignment;
    alignment.center_px = center.cast<double>();
    alignment.correlation = along / std::sqrt(variance * patch.energy_);
    // The residual contains the noise of both images, less the part removed by interpolation, whose
    // high frequencies hardly affect the position. Four parameters have been fitted. The gain
    // converts the patch's gradients to the image's.
    const float gain = along / patch.energy_;
    const float residual = std::max(0.0F, variance - gain * along);
    alignment.covariance =
        (residual / (static_cast<float>(kNumPixels - 4) * noise_left * gain * gain) *
         patch.inverse_hessian_)
            .cast<double>();
    return alignment;
  }

  static std::optional<PatchAlignment> Align(const PatchTemplate& patch,
                                             const cv::Mat& image,
                                             const Eigen::Vector2f& start,
                                             float max_step) {
    const PatchLoops& loops = BestPatchLoops();
    PatchWindow window;
    Eigen::Vector2f center = start;
    int loaded_x = -1000;
    int loaded_y = -1000;
    for (int iteration = 0;; ++iteration) {
      const PixelGrid grid(center, kHalf);
      if (grid.x != loaded_x || grid.y != loaded_y) {
        if (!LoadWindow(loops, image, grid.x, grid.y, kPatchSide + 1, window)) return std::nullopt;
        loaded_x = grid.x;
        loaded_y = grid.y;
      }
      PatchSums sums;
      loops.compare(&patch.planes_, &window, &grid.weights, &sums);
      const Eigen::Vector2f step =
          -patch.inverse_hessian_ * Eigen::Vector2f(sums.gradient_x, sums.gradient_y);
      const bool last = step.squaredNorm() < kMinStepPx * kMinStepPx;
      if (last || iteration == kMaxIterations) {
        if (last) center += step;
        return AlignmentAt(patch, center, sums, grid.weights);
      }
      center += step;
      if (!((center - start).squaredNorm() <= max_step * max_step)) return std::nullopt;
    }
  }

  static constexpr int kNumModes = DeformationSums::kModes;
  using ModeVector = Eigen::Matrix<float, kNumModes, 1>;
  using ModeMatrix = Eigen::Matrix<float, kNumModes, kNumModes>;

  // Normal equations for the amount of each mode (DeformationSums), with offset and gain
  // eliminated.
  struct ModeEquations {
    ModeMatrix products;
    ModeVector b;
    float residual = 0.0F;  // sum of squares in the patch's grey levels
    float noise_left = 1.0F;
  };

  static std::optional<ModeEquations> FormModeEquations(const PatchTemplate& patch,
                                                        const cv::Mat& image,
                                                        const Eigen::Vector2f& center,
                                                        const Eigen::Vector2f& along) {
    const PatchLoops& loops = BestPatchLoops();
    const PixelGrid grid(center, kHalf);
    PatchWindow window;
    if (!LoadWindow(loops, image, grid.x, grid.y, kPatchSide + 1, window)) return std::nullopt;
    const DeformationInputs inputs{patch.mean_gradient_.x(),
                                   patch.mean_gradient_.y(),
                                   patch.gradient_share_.x(),
                                   patch.gradient_share_.y(),
                                   along.x(),
                                   along.y()};
    DeformationSums sums;
    loops.deform(&patch.planes_, &window, &grid.weights, &inputs, &sums);

    const float mean = sums.image_sum / kNumPixels;
    const float gain = sums.image_values / patch.energy_;
    if (!(gain > 0.0F)) return std::nullopt;
    ModeEquations equations;
    int n = 0;
    for (int k = 0; k < kNumModes; ++k) {
      for (int l = 0; l <= k; ++l) {
        equations.products(k, l) = equations.products(l, k) =
            sums.products[n++] - sums.modes[k] * sums.modes[l] / kNumPixels -
            sums.with_values[k] * sums.with_values[l] / patch.energy_;
      }
      equations.b[k] = sums.with_values[k] + (sums.modes[k] * mean - sums.with_image[k]) / gain;
    }
    equations.residual = std::max(
        0.0F, (sums.image_squares - mean * mean * kNumPixels) / (gain * gain) - patch.energy_);
    equations.noise_left = 0.5F * (patch.noise_left_ + NoiseLeft(grid.weights));
    return equations;
  }

  // By Cholesky's decomposition; nullopt unless the matrix is positive definite.
  static std::optional<ModeMatrix> InverseOf(const ModeMatrix& information) {
    ModeMatrix L = ModeMatrix::Zero();
    ModeMatrix inverse_factor = ModeMatrix::Zero();
    for (int k = 0; k < kNumModes; ++k) {
      for (int row = k; row < kNumModes; ++row) {
        float value = information(row, k);
        for (int m = 0; m < k; ++m) value -= L(row, m) * L(k, m);
        if (row == k && !(value > 0.0F)) return std::nullopt;
        L(row, k) = row == k ? std::sqrt(value) : value / L(k, k);
      }
    }
    for (int k = 0; k < kNumModes; ++k) {
      inverse_factor(k, k) = 1.0F / L(k, k);
      for (int row = k + 1; row < kNumModes; ++row) {
        float value = 0.0F;
        for (int m = k; m < row; ++m) value -= L(row, m) * inverse_factor(m, k);
        inverse_factor(row, k) = value / L(row, row);
      }
    }
    ModeMatrix inverse;
    for (int k = 0; k < kNumModes; ++k) {
      for (int l = 0; l <= k; ++l) {
        float value = 0.0F;
        for (int m = k; m < kNumModes; ++m) value += inverse_factor(m, k) * inverse_factor(m, l);
        inverse(k, l) = inverse(l, k) = value;
      }
    }
    return inverse;
  }

  static std::optional<PatchAlignment> Correct(const PatchTemplate& patch,
                                               const cv::Mat& image,
                                               const PatchAlignment& found,
                                               const PatchParallax& parallax) {
    const float flow_px = static_cast<float>(parallax.flow_px.norm());
    if (!(flow_px > 0.0F)) return found;
    const auto equations = FormModeEquations(
        patch, image, found.center_px.cast<float>(), parallax.flow_px.cast<float>() / flow_px);
    if (!equations) return std::nullopt;
    const float variance =
        equations->residual / (static_cast<float>(kNumPixels - 4) * equations->noise_left);
    const float sigma = static_cast<float>(parallax.sigma);
    ModeMatrix information = equations->products;
    information.diagonal().tail<3>().array() += variance / (sigma * sigma);
    const auto found_inverse = InverseOf(information);
    if (!found_inverse) return std::nullopt;
    const ModeMatrix& inverse = *found_inverse;
    const ModeVector motion = inverse * equations->b;

    // The bend of a plane moves a point at offset d by stretch * (shear . d) / flow * d. The
    // best-fitting shift contains the mean of that.
    constexpr float kSecondMoment = (kPatchSide * kPatchSide - 1) / 12.0F;
    const Eigen::Vector2f stretch_times_shear =
        motion[2] * motion.tail<2>() + variance * inverse.block<2, 1>(3, 2);
    const Eigen::Vector2f shift = motion.head<2>() - kSecondMoment / flow_px * stretch_times_shear;
    PatchAlignment corrected = found;
    corrected.center_px += shift.cast<double>();
    corrected.covariance = (variance * inverse.topLeftCorner<2, 2>()).cast<double>();
    return corrected;
  }
};

std::optional<PatchAlignment> AlignPatch(const PatchTemplate& patch,
                                         const cv::Mat& image,
                                         const Eigen::Vector2d& start_px,
                                         double max_step_px) {
  return PatchAligner::Align(patch, image, start_px.cast<float>(), static_cast<float>(max_step_px));
}

std::optional<PatchAlignment> CorrectForParallax(const PatchTemplate& patch,
                                                 const cv::Mat& image,
                                                 const PatchAlignment& found,
                                                 const PatchParallax& parallax) {
  return PatchAligner::Correct(patch, image, found, parallax);
}

Eigen::Matrix2d PatchWarp(const Camera& camera,
                          const Eigen::Vector3d& bearing,
                          const Rotation& target_from_view) {
  Eigen::Matrix<double, 2, 3> J_view;
  Eigen::Matrix<double, 2, 3> J_target;
  if (!camera.Project(bearing, &J_view) || !camera.Project(target_from_view * bearing, &J_target)) {
    return Eigen::Matrix2d::Identity();
  }
  const Eigen::Matrix<double, 3, 2> bearing_from_view =
      J_view.transpose() * (J_view * J_view.transpose()).inverse();
  return J_target * target_from_view.Matrix() * bearing_from_view;
}

}  // namespace rotslam
