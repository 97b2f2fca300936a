#pragma once

#include <cstddef>
#include <cstdint>

namespace rotslam {

/// Side of a patch in pixels. At 11 nearly all corners have structure in both directions. Smaller
/// patches lose more accuracy than they save time, larger ones cross depth edges.
inline constexpr int kPatchSide = 11;
/// Length of a row in the arrays below: a patch row in whole vector registers.
inline constexpr int kPatchStride = 16;
/// Side of a sampled patch: one pixel more on each side, for the gradients.
inline constexpr int kSampledSide = kPatchSide + 2;

/// Grey values and gradients of a patch, zero beyond kPatchSide.
struct PatchPlanes {
  static constexpr int kSize = kPatchSide * kPatchStride;
  alignas(64) float values[kSize];
  alignas(64) float gradient_x[kSize];
  alignas(64) float gradient_y[kSize];
};

/// Pixels around a patch as floating point. Loops read up to a row beyond the last one, which must
/// be finite.
struct PatchWindow {
  alignas(64) float values[(kSampledSide + 2) * kPatchStride];
};

/// Weights of the four pixels around a position.
struct PixelWeights {
  float w00, w10, w01, w11;
};

/// The values that PatchLoops::prepare subtracts from a patch, and sums over the remainder.
struct PatchMoments {
  float energy;  // sum of the squared values, their mean removed
  float mean_x, mean_y;
  float share_x, share_y;
  float xx, xy, yy;  // Hessian
};

/// Sums over a patch and the interpolated pixels v of a window.
struct PatchSums {
  float gradient_x, gradient_y, values;  // products of v with the planes
  float sum, squares;                    // of v
};

/// Inputs of PatchLoops::deform: the components that `prepare` removed from the gradients, and the
/// unit vector of the flow.
struct DeformationInputs {
  float mean_x, mean_y;
  float share_x, share_y;
  float along_x, along_y;
};

/// Sums over the pixels for the five modes of a deformation, their gradients complete: shift in x
/// and y, stretch along the flow, shears along the flow that grow with x and y.
struct DeformationSums {
  static constexpr int kModes = 5;
  float modes[kModes];
  float with_values[kModes];                     // products with the patch's values
  float with_image[kModes];                      // products with the interpolated pixels v
  float products[kModes * (kModes + 1) / 2];     // lower triangle, row by row
  float image_sum, image_values, image_squares;  // of v, of v with the patch's values, of v^2
};

/// Weight of the pixel that is `offset` floats away.
struct BlurTap {
  std::ptrdiff_t offset;
  float weight;
};

/// Rows of pixels, and where the weighted means of their pixels go.
struct BlurRows {
  static constexpr int kGroup = 8;  // columns that are worked on together
  const float* pixels;              // where the tap of offset 0 of the first mean lies
  std::ptrdiff_t step;              // floats from row to row
  int rows, columns;                // columns: a multiple of kGroup
  std::uint8_t* means;              // rows by columns, without gaps
};

/// The loops over the pixels of a patch, compiled for one SimdLevel. All levels give the same
/// results: sums run in 16 lanes, one per column, that are added in the same order.
struct PatchLoops {
  /// Copies `rows` rows of kPatchStride pixels and adds a row of zeros.
  void (*load)(const std::uint8_t* pixels, std::ptrdiff_t step, int rows, PatchWindow* window);
  /// Interpolates kSampledSide rows from the window's kSampledSide + 1.
  void (*shift)(const PatchWindow* window, const PixelWeights* weights, PatchWindow* sampled);
  /// Samples kSampledSide^2 pixels at center + A (column - half, row - half), A row-major; all of
  /// them have to lie inside the image, less its last row and column.
  void (*warp)(const std::uint8_t* pixels,
               std::ptrdiff_t step,
               const float* center,
               const float* A,
               PatchWindow* sampled);
  /// Values and gradients of a sampled patch. The mean is removed from the values, and from the
  /// gradients a constant and their share of the values.
  void (*prepare)(const PatchWindow* sampled, PatchPlanes* planes, PatchMoments* moments);
  void (*compare)(const PatchPlanes* planes,
                  const PatchWindow* window,
                  const PixelWeights* weights,
                  PatchSums* sums);
  void (*deform)(const PatchPlanes* planes,
                 const PatchWindow* window,
                 const PixelWeights* weights,
                 const DeformationInputs* inputs,
                 DeformationSums* sums);
  /// Floats of bytes.
  void (*widen)(const std::uint8_t* pixels, int count, float* to);
  /// Rounded weighted means of the pixels around each of them; the weights' sum is one.
  void (*blur)(const BlurTap* taps, int num_taps, const BlurRows* rows);
};

extern const PatchLoops kPatchLoopsBaseline;
extern const PatchLoops kPatchLoopsAvx2;
extern const PatchLoops kPatchLoopsAvx512;

/// Those of UsedSimdLevel().
const PatchLoops& BestPatchLoops();

}  // namespace rotslam
