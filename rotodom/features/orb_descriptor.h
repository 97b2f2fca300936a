#pragma once

#include <cstddef>
#include <cstdint>

namespace rotslam {

// Half the side of ORB's patch, pixels.
inline constexpr int kOrbHalfPatch = 15;

inline constexpr float kOrbRadPerDeg = 0.017453292519943295F;

// Largest row or column offset of a rotated point pair, pixels.
inline constexpr int kOrbReach = 19;

/// Direction from a pixel to the centroid of the grey values in the disc around it.
/// @param center  the pixel; kOrbHalfPatch + 1 pixels around it are read, `step` bytes a row.
/// @return  degrees, -180 to 180, x axis to y axis; what cv::ORB gives, to its 0.3 deg.
float CentroidAngleDeg(const std::uint8_t* center, std::ptrdiff_t step);

/// The 32 bytes of ORB.
/// @param blurred_center  the pixel in the blurred image; kOrbReach pixels around it are read.
/// @param angle_deg       as cv::KeyPoint has it.
/// @param descriptor      receives the bytes that cv::ORB has for this pixel and angle.
/// Source:  Rublee et al., ORB, ICCV 2011.
void ComputeOrbDescriptor(const std::uint8_t* blurred_center,
                          std::ptrdiff_t step,
                          float angle_deg,
                          std::uint8_t* descriptor);

// Side of a block that is blurred at once.
inline constexpr int kBlurBlock = 32;
// Rows and columns that the kernel needs on each side of the block, and columns read beside it in
// all.
inline constexpr int kBlurReach = 3;
inline constexpr int kBlurMargin = 8;

/// Blurs a square block of kBlurBlock pixels with the Gaussian of 7 x 7 pixels and sigma 2 that ORB
/// applies before its comparisons. The result equals that of cv::GaussianBlur on bytes; cv::ORB
/// blurs in floating point, which differs by one grey level at most.
/// @param from  top left pixel of the block. kBlurReach rows above and below it, as many columns
///              before it and the rest of kBlurMargin after it are read.
void BlurBlock(const std::uint8_t* from,
               std::ptrdiff_t from_step,
               std::uint8_t* to,
               std::ptrdiff_t to_step);

}  // namespace rotslam
