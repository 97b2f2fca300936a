#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace rotslam {

// Procedural textures of flat surfaces. Every random choice is a hash of (seed, cell), so that a
// texture is a pure function of its coordinates, equal in any order and on any thread.

/// 64 hashed bits of a seed and two integers; equal arguments give equal bits everywhere.
inline std::uint64_t HashBits(std::uint64_t seed, std::int64_t i, std::int64_t j) {
  std::uint64_t x = seed * 0x9E3779B97F4A7C15u;
  x ^= static_cast<std::uint64_t>(i) * 0xD6E8FEB86659FD93u;
  x ^= (static_cast<std::uint64_t>(j) + 0x632BE59BD9B4E019u) * 0xA0761D6478BD642Fu;
  x = (x ^ (x >> 32)) * 0xE7037ED1A0B428DBu;
  x = (x ^ (x >> 29)) * 0x8EBC6AF09C88C6E3u;
  return x ^ (x >> 32);
}

/// `bits` bits of a hash from bit `shift` on, as a number in [0, 1).
inline float UnitFrom(std::uint64_t hash, int shift, int bits = 8) {
  const std::uint64_t mask = (std::uint64_t{1} << bits) - 1;
  return static_cast<float>((hash >> shift) & mask) / static_cast<float>(mask + 1);
}

enum class Pattern {
  kPlaster,  // walls: stains and painted marks
  kBricks,
  kTiles,
  kPlanks,
  kFacade,   // house front: windows, doors, a lettered band
  kAsphalt,  // patches, cracks and speckle
  kPoster,   // picture blocks and lines of letters
  kShelf,    // rows of books
  kFabric,   // woven figures, for rugs and sofas
  kLeaves,
  kPanel,  // cabinets and car bodies: seams, handles, labels
  kSky,    // weak clouds
};

/// Appearance of a surface.
struct Material {
  Pattern pattern = Pattern::kPlaster;
  std::uint64_t seed = 0;
  float tone = 0.5f;      // mean albedo, in (0, 1)
  float contrast = 1.0f;  // multiplies every difference from the mean
  float size_s_m = 1.0f;  // extent of the surface, for pictures that fill it (posters, facades)
  float size_t_m = 1.0f;
};

/// Albedo at a place of a surface, averaged over a square of side `width_m`.
/// @param s_m, t_m  metres along the surface; on upright surfaces t is the height above its foot.
/// @param width_m   side of the pixel's footprint; finer detail has faded to its mean.
/// @return  albedo in [0.02, 0.98].
float Albedo(const Material& material, double s_m, double t_m, float width_m);

/// Colour of the surface at a place: blue, green, red factors whose luma (Rec. 601) is one.
Eigen::Vector3f Tint(const Material& material, double s_m, double t_m);

}  // namespace rotslam
