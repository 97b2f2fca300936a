#include "rotodom/matching/patch_alignment.h"

#include <cmath>

#include <Eigen/Dense>

namespace rotslam {
namespace {

constexpr int kHalf = kPatchSide / 2;
constexpr int kRow = 12;  // a patch row in whole registers
constexpr int kNumPixels = kPatchSide * kPatchSide;
constexpr int kMaxIterations = 12;   // of Gauss-Newton
constexpr float kMinStepPx = 0.01F;  // below the accuracy of an alignment, 0.02 px
// Smallest ratio of the Hessian's eigenvalues; below it the patch has structure in one direction
// only.
constexpr float kMinStructure = 0.01F;
// Smallest mean squared gradient in any direction, (grey levels per pixel)^2; below it noise
// dominates.
constexpr float kMinGradientEnergy = 1.0F;

using Row = Eigen::Array<float, kRow, 1>;

Eigen::Map<const Row, Eigen::Unaligned> RowAt(const float* values) {
  return Eigen::Map<const Row, Eigen::Unaligned>(values);
}

// One where a row holds a pixel, zero in the padding.
Row InsidePatch() {
  Row mask = Row::Ones();
  mask[kRow - 1] = 0.0F;
  return mask;
}

// Copy of the pixels that a patch centred near one position can touch, as floating point.
template <int Side>
class Window {
 public:
  static constexpr int kStride = 16;
  static_assert(Side <= kStride);

  // The window's first pixel is (x, y); false when it leaves the image.
  bool Load(const cv::Mat& image, int x, int y) {
    if (x < 0 || y < 0 || x + kStride > image.cols || y + Side > image.rows) {
      if (x < 0 || y < 0 || x + Side > image.cols || y + Side > image.rows) return false;
      // At the right border a whole register would leave the image.
      for (int row = 0; row < Side; ++row) {
        const std::uint8_t* from = image.ptr<std::uint8_t>(y + row) + x;
        for (int column = 0; column < kStride; ++column) {
          values_[row * kStride + column] = column < Side ? static_cast<float>(from[column]) : 0.0F;
        }
      }
      return true;
    }
    for (int row = 0; row < Side; ++row) {
      const std::uint8_t* from = image.ptr<std::uint8_t>(y + row) + x;
      for (int column = 0; column < kStride; ++column) {
        values_[row * kStride + column] = static_cast<float>(from[column]);
      }
    }
    return true;
  }

  const float* row(int y) const { return values_.data() + y * kStride; }

 private:
  alignas(16) std::array<float, static_cast<std::size_t>(Side + 1) * kStride> values_ = {};
};

// Weights of the four pixels around a position.
struct Bilinear {
  Bilinear(float x, float y)
      : w00((1.0F - x) * (1.0F - y)), w10(x * (1.0F - y)), w01((1.0F - x) * y), w11(x * y) {}
  float w00;
  float w10;
  float w01;
  float w11;

  // Ratio of the noise variance of interpolated values to that of pixels.
  float NoiseLeft() const { return w00 * w00 + w10 * w10 + w01 * w01 + w11 * w11; }
};

// Where the pixels of a patch of half side `half` lie around a position.
struct PixelGrid {
  PixelGrid(const Eigen::Vector2f& center, int half)
      : x(static_cast<int>(std::floor(center.x() - static_cast<float>(half)))),
        y(static_cast<int>(std::floor(center.y() - static_cast<float>(half)))),
        weights(center.x() - static_cast<float>(half) - static_cast<float>(x),
                center.y() - static_cast<float>(half) - static_cast<float>(y)) {}
  int x;
  int y;
  Bilinear weights;
};

// A row of the patch interpolated from the two rows of pixels around it.
Row Interpolated(const float* above, const float* below, const Bilinear& weights) {
  return weights.w00 * RowAt(above) + weights.w10 * RowAt(above + 1) + weights.w01 * RowAt(below) +
         weights.w11 * RowAt(below + 1);
}

// Mean of Bilinear::NoiseLeft over all fractions of a pixel.
constexpr float kMeanNoiseLeft = 4.0F / 9.0F;

float SampleAt(const cv::Mat& image, float x, float y) {
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const Bilinear weights(x - static_cast<float>(column), y - static_cast<float>(row));
  const std::uint8_t* above = image.ptr<std::uint8_t>(row) + column;
  const std::uint8_t* below = image.ptr<std::uint8_t>(row + 1) + column;
  return weights.w00 * above[0] + weights.w10 * above[1] + weights.w01 * below[0] +
         weights.w11 * below[1];
}

constexpr int kSampled = kPatchSide + 2;  // one more on each side, for the gradients
constexpr int kSampledStride = 16;
using SampledPatch = std::array<float, static_cast<std::size_t>(kSampled) * kSampledStride>;

// Returns the noise ratio (Bilinear::NoiseLeft); nullopt where the patch leaves the image.
std::optional<float> SampleShifted(const cv::Mat& image,
                                   const Eigen::Vector2f& center,
                                   SampledPatch& sampled) {
  const auto [x, y, weights] = PixelGrid(center, kHalf + 1);
  Window<kSampled + 1> window;
  if (!window.Load(image, x, y)) return std::nullopt;
  for (int row = 0; row < kSampled; ++row) {
    const float* above = window.row(row);
    const float* below = window.row(row + 1);
    float* to = sampled.data() + row * kSampledStride;
    for (int column = 0; column < kSampledStride - 1; ++column) {
      to[column] = weights.w00 * above[column] + weights.w10 * above[column + 1] +
                   weights.w01 * below[column] + weights.w11 * below[column + 1];
    }
  }
  return weights.NoiseLeft();
}

std::optional<float> SampleWarped(const cv::Mat& image,
                                  const Eigen::Vector2f& center,
                                  const Eigen::Matrix2f& view_from_patch,
                                  SampledPatch& sampled) {
  const float reach = static_cast<float>(kHalf + 1);
  const Eigen::Vector2f extent =
      view_from_patch.cwiseAbs() * Eigen::Vector2f(reach, reach) + Eigen::Vector2f(1.0F, 1.0F);
  if (center.x() - extent.x() < 0.0F || center.y() - extent.y() < 0.0F ||
      center.x() + extent.x() >= static_cast<float>(image.cols - 1) ||
      center.y() + extent.y() >= static_cast<float>(image.rows - 1)) {
    return std::nullopt;
  }
  for (int row = 0; row < kSampled; ++row) {
    Eigen::Vector2f at =
        center + view_from_patch * Eigen::Vector2f(-reach, static_cast<float>(row) - reach);
    for (int column = 0; column < kSampled; ++column) {
      sampled[row * kSampledStride + column] = SampleAt(image, at.x(), at.y());
      at += view_from_patch.col(0);
    }
  }
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

// Longer than a screen: three passes over the rows share sums that stay in registers.
std::optional<PatchTemplate> PatchTemplate::Sample(const cv::Mat& image,
                                                   const Eigen::Vector2d& center_px,
                                                   const Eigen::Matrix2d& patch_from_view) {
  static_assert(kStride == kRow);
  alignas(16) SampledPatch sampled = {};
  const Eigen::Vector2f center = center_px.cast<float>();
  // A warp that moves the corners of the patch by less than a tenth of a pixel is ignored.
  const bool shifted_only =
      (patch_from_view - Eigen::Matrix2d::Identity()).cwiseAbs().maxCoeff() * kHalf < 0.1;
  const std::optional<float> noise_left =
      shifted_only ? SampleShifted(image, center, sampled)
                   : SampleWarped(image, center, patch_from_view.inverse().cast<float>(), sampled);
  if (!noise_left) return std::nullopt;

  PatchTemplate patch;
  patch.noise_left_ = *noise_left;
  Row sum = Row::Zero();
  Row sum_x = Row::Zero();
  Row sum_y = Row::Zero();
  const Row mask = InsidePatch();
  for (int row = 0; row < kPatchSide; ++row) {
    const float* middle = sampled.data() + (row + 1) * kSampledStride;
    const Row values = mask * RowAt(middle + 1);
    const Row gradient_x = mask * 0.5F * (RowAt(middle + 2) - RowAt(middle));
    const Row gradient_y =
        mask * 0.5F * (RowAt(middle + 1 + kSampledStride) - RowAt(middle + 1 - kSampledStride));
    Eigen::Map<Row>(patch.values_.data() + row * kRow) = values;
    Eigen::Map<Row>(patch.gradient_x_.data() + row * kRow) = gradient_x;
    Eigen::Map<Row>(patch.gradient_y_.data() + row * kRow) = gradient_y;
    sum += values;
    sum_x += gradient_x;
    sum_y += gradient_y;
  }
  const float mean = sum.sum() / kNumPixels;
  const float mean_x = sum_x.sum() / kNumPixels;
  const float mean_y = sum_y.sum() / kNumPixels;
  Row energy = Row::Zero();
  Row along_x = Row::Zero();
  Row along_y = Row::Zero();
  for (int row = 0; row < kPatchSide; ++row) {
    Eigen::Map<Row> values(patch.values_.data() + row * kRow);
    Eigen::Map<Row> gradient_x(patch.gradient_x_.data() + row * kRow);
    Eigen::Map<Row> gradient_y(patch.gradient_y_.data() + row * kRow);
    values -= mean * mask;
    gradient_x -= mean_x * mask;
    gradient_y -= mean_y * mask;
    energy += values.square();
    along_x += values * gradient_x;
    along_y += values * gradient_y;
  }
  patch.energy_ = energy.sum();
  if (!(patch.energy_ > kNumPixels * kMinGradientEnergy)) return std::nullopt;
  const float share_x = along_x.sum() / patch.energy_;
  const float share_y = along_y.sum() / patch.energy_;
  patch.mean_gradient_ = {mean_x, mean_y};
  patch.gradient_share_ = {share_x, share_y};
  Row xx = Row::Zero();
  Row xy = Row::Zero();
  Row yy = Row::Zero();
  for (int row = 0; row < kPatchSide; ++row) {
    const Eigen::Map<const Row> values(patch.values_.data() + row * kRow);
    Eigen::Map<Row> gradient_x(patch.gradient_x_.data() + row * kRow);
    Eigen::Map<Row> gradient_y(patch.gradient_y_.data() + row * kRow);
    gradient_x -= share_x * values;
    gradient_y -= share_y * values;
    xx += gradient_x.square();
    xy += gradient_x * gradient_y;
    yy += gradient_y.square();
  }
  const auto inverse = InverseIfStructured(xx.sum(), xy.sum(), yy.sum());
  if (!inverse) return std::nullopt;
  patch.inverse_hessian_ = *inverse;
  return patch;
}

struct PatchAligner {
  // Sums over the pixels of the image under the patch.
  struct Sums {
    float values = 0.0F;
    float along = 0.0F;  // products with the patch
    float squares = 0.0F;
  };

  static std::optional<PatchAlignment> AlignmentAt(const PatchTemplate& patch,
                                                   const Eigen::Vector2f& center,
                                                   const Sums& sums,
                                                   const Bilinear& weights) {
    const auto& [sum, along, squares] = sums;
    const float noise_left = 0.5F * (patch.noise_left_ + weights.NoiseLeft());
    const float variance = squares - sum * sum / kNumPixels;
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
    Window<kPatchSide + 1> window;
    Eigen::Vector2f center = start;
    int loaded_x = -1000;
    int loaded_y = -1000;
    for (int iteration = 0;; ++iteration) {
      const auto [x, y, weights] = PixelGrid(center, kHalf);
      if (x != loaded_x || y != loaded_y) {
        if (!window.Load(image, x, y)) return std::nullopt;
        loaded_x = x;
        loaded_y = y;
      }
      Row b_x = Row::Zero();
      Row b_y = Row::Zero();
      Row row_sum = Row::Zero();
      Row row_along = Row::Zero();
      Row row_squares = Row::Zero();
      for (int row = 0; row < kPatchSide; ++row) {
        const Row values = Interpolated(window.row(row), window.row(row + 1), weights);
        b_x += values * Eigen::Map<const Row>(patch.gradient_x_.data() + row * kRow);
        b_y += values * Eigen::Map<const Row>(patch.gradient_y_.data() + row * kRow);
        row_along += values * Eigen::Map<const Row>(patch.values_.data() + row * kRow);
        row_sum += values;
        row_squares += values.square();
      }
      const Eigen::Vector2f b(b_x.sum(), b_y.sum());
      const Eigen::Vector2f step = -patch.inverse_hessian_ * b;
      const bool last = step.squaredNorm() < kMinStepPx * kMinStepPx;
      if (last || iteration == kMaxIterations) {
        // The padding column is no part of the patch.
        row_sum[kRow - 1] = 0.0F;
        row_squares[kRow - 1] = 0.0F;
        if (last) center += step;
        return AlignmentAt(
            patch, center, {row_sum.sum(), row_along.sum(), row_squares.sum()}, weights);
      }
      center += step;
      if (!((center - start).squaredNorm() <= max_step * max_step)) return std::nullopt;
    }
  }

  // Derivatives of a patch's values by a shift of one pixel in x and y, a stretch along the flow,
  // and shears along the flow that grow with x and y.
  static constexpr int kNumModes = 5;
  using ModeVector = Eigen::Matrix<float, kNumModes, 1>;
  using ModeMatrix = Eigen::Matrix<float, kNumModes, kNumModes>;

  // Normal equations for the amount of each mode, with offset and gain eliminated.
  struct ModeEquations {
    ModeMatrix products;
    ModeVector b;
    float residual = 0.0F;  // sum of squares in the patch's grey levels
    float noise_left = 1.0F;
  };

  // Longer than a screen: one pass over the rows holds all sums, which the second part reduces.
  static std::optional<ModeEquations> FormModeEquations(const PatchTemplate& patch,
                                                        const cv::Mat& image,
                                                        const Eigen::Vector2f& center,
                                                        const Eigen::Vector2f& along) {
    const auto [x, y, weights] = PixelGrid(center, kHalf);
    Window<kPatchSide + 1> window;
    if (!window.Load(image, x, y)) return std::nullopt;

    const Row mask = InsidePatch();
    const Row dx = Row::LinSpaced(-kHalf, kRow - 1 - kHalf);
    std::array<Row, kNumModes> modes;
    std::array<Row, kNumModes> sums;
    std::array<Row, kNumModes> shares;
    std::array<Row, kNumModes> b;
    std::array<Row, kNumModes*(kNumModes + 1) / 2> products;
    for (auto* rows : {&sums, &shares, &b}) rows->fill(Row::Zero());
    products.fill(Row::Zero());
    Row image_sum = Row::Zero();
    Row image_share = Row::Zero();
    Row image_squares = Row::Zero();
    for (int row = 0; row < kPatchSide; ++row) {
      const Row image_values = mask * Interpolated(window.row(row), window.row(row + 1), weights);
      const Row values = RowAt(patch.values_.data() + row * kRow);
      const Row gradient_x = RowAt(patch.gradient_x_.data() + row * kRow) +
                             mask * patch.mean_gradient_.x() + patch.gradient_share_.x() * values;
      const Row gradient_y = RowAt(patch.gradient_y_.data() + row * kRow) +
                             mask * patch.mean_gradient_.y() + patch.gradient_share_.y() * values;
      const Row gradient_along = along.x() * gradient_x + along.y() * gradient_y;
      const float dy = static_cast<float>(row - kHalf);
      modes = {gradient_x,
               gradient_y,
               dx * gradient_x + dy * gradient_y,
               dx * gradient_along,
               dy * gradient_along};
      image_sum += image_values;
      image_share += image_values * values;
      image_squares += image_values.square();
      int n = 0;
      for (int k = 0; k < kNumModes; ++k) {
        sums[k] += modes[k];
        shares[k] += modes[k] * values;
        b[k] += modes[k] * image_values;
        for (int l = 0; l <= k; ++l) products[n++] += modes[k] * modes[l];
      }
    }

    const float mean = image_sum.sum() / kNumPixels;
    const float gain = image_share.sum() / patch.energy_;
    if (!(gain > 0.0F)) return std::nullopt;
    ModeEquations equations;
    ModeVector sum;
    ModeVector share;
    int n = 0;
    for (int k = 0; k < kNumModes; ++k) {
      sum[k] = sums[k].sum();
      share[k] = shares[k].sum() / patch.energy_;
      for (int l = 0; l <= k; ++l) {
        equations.products(k, l) = equations.products(l, k) = products[n++].sum() -
                                                              sum[k] * sum[l] / kNumPixels -
                                                              share[k] * share[l] * patch.energy_;
      }
      equations.b[k] = share[k] * patch.energy_ + (sum[k] * mean - b[k].sum()) / gain;
    }
    equations.residual = std::max(
        0.0F, (image_squares.sum() - mean * mean * kNumPixels) / (gain * gain) - patch.energy_);
    equations.noise_left = 0.5F * (patch.noise_left_ + weights.NoiseLeft());
    return equations;
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
    const ModeMatrix inverse = information.inverse();
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
