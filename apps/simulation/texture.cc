#include "apps/simulation/texture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rotslam {
namespace {

std::int64_t Floor(double x) {
  const auto i = static_cast<std::int64_t>(x);
  return i - (x < static_cast<double>(i) ? 1 : 0);
}

std::int64_t FloorDiv(std::int64_t a, std::int64_t b) {
  return a >= 0 ? a / b : -((-a + b - 1) / b);
}

float Clamp01(float x) { return std::clamp(x, 0.0f, 1.0f); }

// Hash as a number in [-1, 1).
float Signed(std::uint64_t hash, int shift, int bits = 8) {
  return 2.0f * UnitFrom(hash, shift, bits) - 1.0f;
}

// One where a figure of size `size` is resolved by pixels of `width`, zero where it is not.
float Resolved(float size, float width) { return Clamp01(1.5f * size / width - 1.0f); }

// Share of a pixel [x - width/2, x + width/2] that lies within [low, high].
float CoverInterval(float x, float low, float high, float width) {
  const float half = 0.5f * width;
  return (std::clamp(x + half, low, high) - std::clamp(x - half, low, high)) / width;
}

float CoverRect(float x, float y, float half_x, float half_y, float width) {
  return CoverInterval(x, -half_x, half_x, width) * CoverInterval(y, -half_y, half_y, width);
}

// Average of a piecewise constant picture of unit cells over a box of `wx` by `wy` <= 1 cells.
template <class CellValue>
float AverageCells(double x, double y, float wx, float wy, const CellValue& cell_value) {
  wx = std::min(wx, 1.0f);
  wy = std::min(wy, 1.0f);
  const std::int64_t i = Floor(x - 0.5 * wx);
  const std::int64_t j = Floor(y - 0.5 * wy);
  const float a = Clamp01((static_cast<float>(x - static_cast<double>(i)) - 1.0f) / wx + 0.5f);
  const float b = Clamp01((static_cast<float>(y - static_cast<double>(j)) - 1.0f) / wy + 0.5f);
  float sum = 0.0f;
  if (a < 1.0f && b < 1.0f) sum += (1.0f - a) * (1.0f - b) * cell_value(i, j);
  if (a > 0.0f && b < 1.0f) sum += a * (1.0f - b) * cell_value(i + 1, j);
  if (a < 1.0f && b > 0.0f) sum += (1.0f - a) * b * cell_value(i, j + 1);
  if (a > 0.0f && b > 0.0f) sum += a * b * cell_value(i + 1, j + 1);
  return sum;
}

// Value noise in [-1, 1] with a lattice of unit cells.
float Noise(std::uint64_t seed, double x, double y) {
  const std::int64_t i = Floor(x);
  const std::int64_t j = Floor(y);
  float a = static_cast<float>(x - static_cast<double>(i));
  float b = static_cast<float>(y - static_cast<double>(j));
  a = a * a * (3.0f - 2.0f * a);
  b = b * b * (3.0f - 2.0f * b);
  const float v00 = Signed(HashBits(seed, i, j), 0, 16);
  const float v10 = Signed(HashBits(seed, i + 1, j), 0, 16);
  const float v01 = Signed(HashBits(seed, i, j + 1), 0, 16);
  const float v11 = Signed(HashBits(seed, i + 1, j + 1), 0, 16);
  return (v00 * (1.0f - a) + v10 * a) * (1.0f - b) + (v01 * (1.0f - a) + v11 * a) * b;
}

// The pixel of a surface that is painted: its middle and its width, m.
struct Pixel {
  double s = 0.0;
  double t = 0.0;
  float width = 0.0f;
};

// Sizes of a pattern: the largest, m, their number, and the strength of each to the one before.
struct Scales {
  float coarse = 0.0f;
  int count = 0;
  float gain = 0.0f;
};

// Octaves of value noise from wavelength `coarse` down, each half as long and `gain` as strong.
float Octaves(std::uint64_t seed, const Pixel& at, const Scales& scales) {
  float coarse = scales.coarse;
  float sum = 0.0f;
  float amplitude = 1.0f;
  for (int k = 0; k < scales.count; ++k) {
    const float visible = Resolved(0.5f * coarse, at.width);
    if (visible <= 0.0f) break;
    sum += visible * amplitude *
           Noise(seed + static_cast<std::uint64_t>(k), at.s / coarse, at.t / coarse);
    coarse *= 0.5f;
    amplitude *= scales.gain;
  }
  return sum;
}

// Random grey cells, in [-1, 1], mean zero.
float Mosaic(std::uint64_t seed, const Pixel& at, float cell_s, float cell_t) {
  const auto& [s, t, width] = at;
  const float visible = Resolved(std::min(cell_s, cell_t), width);
  if (visible <= 0.0f) return 0.0f;
  const auto value = [seed](std::int64_t i, std::int64_t j) {
    return Signed(HashBits(seed, i, j), 0);
  };
  return visible * AverageCells(s / cell_s, t / cell_t, width / cell_s, width / cell_t, value);
}

// One figure (bar, disc, ring, wedge) in some of the cells of side `cell`; in [-1, 1].
float Marks(std::uint64_t seed, const Pixel& at, float cell, float density) {
  const auto& [s, t, width] = at;
  const float visible = Resolved(0.25f * cell, width);
  if (visible <= 0.0f) return 0.0f;
  const double inverse = 1.0 / cell;
  const std::int64_t i = Floor(s * inverse);
  const std::int64_t j = Floor(t * inverse);
  const std::uint64_t hash = HashBits(seed, i, j);
  if (UnitFrom(hash, 0) >= density) return 0.0f;
  const float x =
      static_cast<float>(s * inverse - static_cast<double>(i)) - 0.5f - 0.14f * Signed(hash, 8);
  const float y =
      static_cast<float>(t * inverse - static_cast<double>(j)) - 0.5f - 0.14f * Signed(hash, 16);
  const float w = width * static_cast<float>(inverse);
  const float size = 0.14f + 0.16f * UnitFrom(hash, 24);
  const float ratio = 0.3f + 0.7f * UnitFrom(hash, 32);
  const float reach = size * std::numbers::sqrt2_v<float> + w;
  if (x * x + y * y > reach * reach) return 0.0f;
  const float tint = Signed(hash, 40);
  const float strength = visible * (tint < 0.0f ? -0.45f + 0.55f * tint : 0.45f + 0.55f * tint);
  const int kind = static_cast<int>((hash >> 48) & 7u);
  if (kind == 0) return strength * CoverRect(x, y, size, size * ratio, w);
  if (kind <= 3) {  // a turned bar; cosine and sine by the tangent of the half angle
    const float tangent = Signed(hash, 52);
    const float unit = 1.0f / (1.0f + tangent * tangent);
    const float c = (1.0f - tangent * tangent) * unit;
    const float sn = 2.0f * tangent * unit;
    return strength * CoverRect(c * x + sn * y, c * y - sn * x, size, size * ratio, w);
  }
  const float radius = std::sqrt(x * x + y * y);
  const float disc = Clamp01((size - radius) / w + 0.5f);
  if (kind == 4) return strength * disc;
  if (kind == 5) return strength * disc * Clamp01((radius - 0.6f * size) / w + 0.5f);
  // wedge: a disc cut by two half planes, which leaves sharp corners
  const float cut = Clamp01((x * ratio + y * (1.0f - ratio)) / w + 0.5f);
  return strength * disc * (kind == 6 ? cut : cut * Clamp01((x - y) / w + 0.5f));
}

// Marks at many scales: from `coarse` down, each 2.7 times finer, `gain` as strong.
float Detail(std::uint64_t seed, const Pixel& at, const Scales& scales, float density) {
  float coarse = scales.coarse;
  float sum = 0.0f;
  float amplitude = 1.0f;
  for (int k = 0; k < scales.count; ++k) {
    if (coarse < at.width) break;
    const float shift = 0.37f * static_cast<float>(k);  // so that cells of two scales do not align
    sum += amplitude * Marks(seed + static_cast<std::uint64_t>(k),
                             {at.s + shift * coarse, at.t + shift * coarse, at.width},
                             coarse,
                             density);
    coarse /= 2.7f;
    amplitude *= scales.gain;
  }
  return sum;
}

// Ink, in [0, 1], of lines of letter-like marks: three by five raster cells each, lines `line`
// high.
float Letters(std::uint64_t seed, double s, double t, float width, float line) {
  const float cell = line / 7.0f;
  constexpr float kMeanInk = 0.24f;
  const float visible = Resolved(cell, width);
  if (visible <= 0.0f) return kMeanInk;
  const auto ink = [seed](std::int64_t i, std::int64_t j) {
    const std::int64_t column = FloorDiv(i, 4);
    const std::int64_t row = FloorDiv(j, 7);
    const auto x = static_cast<int>(i - 4 * column);
    const auto y = static_cast<int>(j - 7 * row);
    if (x == 3 || y >= 5) return 0.0f;
    const std::uint64_t hash = HashBits(seed, column, row);
    if ((hash >> 60) < 3) return 0.0f;  // space between words
    return static_cast<float>((hash >> (3 * y + x)) & 1u) * (0.7f + 0.3f * UnitFrom(hash, 32));
  };
  const float value = AverageCells(s / cell, t / cell, width / cell, width / cell, ink);
  return visible * value + (1.0f - visible) * kMeanInk;
}

// Place within a cell and the cell itself, for patterns of repeated elements.
struct Cell {
  std::int64_t i = 0;
  std::int64_t j = 0;
  float x = 0.0f;  // metres from the cell's corner
  float y = 0.0f;
};

Cell CellAt(double s, double t, float size_s, float size_t) {
  const std::int64_t i = Floor(s / size_s);
  const std::int64_t j = Floor(t / size_t);
  return {i,
          j,
          static_cast<float>(s - static_cast<double>(i) * size_s),
          static_cast<float>(t - static_cast<double>(j) * size_t)};
}

// One between the joints of a cell of the given size, zero on them.
float InsideJoints(const Cell& cell, float size_s, float size_t, float joint, float width) {
  return CoverInterval(cell.x, joint, size_s - joint, width) *
         CoverInterval(cell.y, joint, size_t - joint, width);
}

float Plaster(const Material& m, double s, double t, float width) {
  const float stains = Octaves(m.seed, {s, t, width}, {1.3f, 5, 0.6f});
  const float marks = Detail(m.seed + 20, {s, t, width}, {0.46f, 5, 0.92f}, 0.55f);
  return 0.10f * stains + 0.22f * marks;
}

float Bricks(const Material& m, double s, double t, float width) {
  const float scale = 0.9f + 0.5f * UnitFrom(m.seed * 77u, 8);
  const float size_s = 0.25f * scale;
  const float size_t = 0.085f * scale;
  const double offset = (Floor(t / size_t) & 1) != 0 ? 0.5 * size_s : 0.0;
  const Cell cell = CellAt(s + offset, t, size_s, size_t);
  const std::uint64_t hash = HashBits(m.seed, cell.i, cell.j);
  const float inside = InsideJoints(cell, size_s, size_t, 0.006f, width);
  const float visible = Resolved(0.5f * size_t, width);
  const float brick = 0.30f * Signed(hash, 0) + (UnitFrom(hash, 16) < 0.12f ? -0.3f : 0.0f);
  const float joints = 0.22f * (0.85f - inside);
  return visible * (inside * brick + joints) +
         0.12f * Octaves(m.seed + 3, {s, t, width}, {2.7f, 4, 0.6f}) +
         0.14f * Detail(m.seed + 20, {s, t, width}, {1.9f, 6, 0.95f}, 0.40f);
}

float Tiles(const Material& m, double s, double t, float width) {
  const float size = 0.22f + 0.2f * UnitFrom(m.seed * 91u, 16);
  const Cell cell = CellAt(s, t, size, size);
  const std::uint64_t hash = HashBits(m.seed, cell.i, cell.j);
  const float inside = InsideJoints(cell, size, size, 0.005f, width);
  const float checker = ((cell.i + cell.j) & 1) != 0 ? 0.13f : -0.13f;
  const float visible = Resolved(0.5f * size, width);
  const float tile = checker + 0.16f * Signed(hash, 0);
  return visible * (inside * tile - 0.30f * (1.0f - inside)) +
         0.24f * Detail(m.seed + 20, {s, t, width}, {0.5f * size, 4, 0.9f}, 0.55f) +
         0.07f * Octaves(m.seed + 3, {s, t, width}, {0.9f, 4, 0.7f});
}

float Planks(const Material& m, double s, double t, float width) {
  const float size_t = 0.11f;
  const float size_s = 1.1f;
  const std::int64_t row = Floor(t / size_t);
  const double offset = size_s * UnitFrom(HashBits(m.seed + 5, row, 0), 0, 16);
  const Cell cell = CellAt(s + offset, t, size_s, size_t);
  const std::uint64_t hash = HashBits(m.seed, cell.i, cell.j);
  const float inside = InsideJoints(cell, size_s, size_t, 0.003f, width);
  const float visible = Resolved(0.5f * size_t, width);
  const float grain = Octaves(m.seed + (hash & 15u), {0.15 * s, t, width}, {0.05f, 3, 0.8f});
  return visible * (inside * 0.26f * Signed(hash, 0) - 0.32f * (1.0f - inside)) + 0.08f * grain +
         0.22f * Detail(m.seed + 20, {s, t, width}, {0.21f, 4, 0.9f}, 0.50f);
}

float Facade(const Material& m, double s, double t, float width) {
  const std::uint64_t style = HashBits(m.seed, 1, 2);
  const float storey = 2.7f + 0.6f * UnitFrom(style, 0);
  const float num_bays =
      std::max(1.0f, std::round(m.size_s_m / (1.8f + 1.4f * UnitFrom(style, 8))));
  const float bay = m.size_s_m / num_bays;
  const Cell cell = CellAt(s, t, bay, storey);
  const std::uint64_t hash = HashBits(m.seed + 9, cell.i, cell.j);
  // The wall: bricks or plaster, a plinth at the foot, a lettered band over some ground floors.
  const bool brick = UnitFrom(style, 16) < 0.55f;
  float wall = brick ? Bricks(m, s, t, width) : 0.9f * Plaster(m, 0.5 * s, 0.5 * t, 0.5f * width);
  const auto height = static_cast<float>(t);
  const float plinth = CoverInterval(height, -1.0f, 0.55f, width);
  wall += plinth * (-0.18f + 0.2f * Mosaic(m.seed + 30, {s, t, width}, 0.5f, 0.275f));
  if (UnitFrom(style, 24) < 0.45f) {
    const float low = storey - 0.55f;
    const float band = CoverInterval(height, low, storey - 0.05f, width);
    if (band > 0.0f) {
      const float ink = Letters(m.seed + 31, s, storey - 0.12f - t, width, 0.5f);
      wall += band * (0.35f - 0.75f * ink - wall);
    }
  }
  // The opening of this bay: a window, or on the ground floor sometimes a door.
  const bool ground = cell.j == 0;
  const bool door = ground && UnitFrom(hash, 0) < 0.3f;
  if (!door && UnitFrom(hash, 8) < 0.08f) return wall;  // blind bay
  const float half_w = door ? 0.5f : (0.22f + 0.13f * UnitFrom(style, 32)) * bay;
  const float bottom = door ? 0.0f : 0.85f + 0.15f * UnitFrom(style, 40);
  const float top = storey - 0.62f;
  const float half_h = 0.5f * (top - bottom);
  const float x = cell.x - 0.5f * bay;
  const float y = cell.y - 0.5f * (top + bottom);
  const float outer = CoverRect(x, y, half_w + 0.12f, half_h + 0.12f, width);
  if (outer <= 0.0f) return wall;
  const float frame_tone = UnitFrom(style, 48) < 0.7f ? 0.38f : -0.3f;
  const float inner = CoverRect(x, y, half_w, half_h, width);
  float content = 0.0f;
  if (door) {
    content = -0.3f + 0.5f * UnitFrom(hash, 16) +
              0.3f * Mosaic(m.seed + (hash & 1023u), {s, t, width}, 0.25f, 0.45f);
  } else {
    const float bar = 0.035f;
    const float panes = std::max(CoverInterval(x, -bar, bar, width),
                                 CoverInterval(y - 0.25f * half_h, -bar, bar, width));
    const float glass =
        -0.36f + 0.22f * Mosaic(m.seed + (hash & 1023u), {s, t, width}, 0.31f, 0.43f) +
        0.14f * Signed(hash, 24) + 0.16f * Marks(m.seed + 32, {s, t, width}, 0.24f, 0.5f);
    const float curtain =
        UnitFrom(hash, 32) < 0.4f ? CoverInterval(y, half_h * Signed(hash, 40), 9.0f, width) : 0.0f;
    content =
        glass + curtain * (0.5f + 0.2f * Mosaic(m.seed + 33, {s, t, width}, 0.09f, 3.0f) - glass);
    content += panes * (frame_tone - content);
  }
  const float opening = frame_tone + inner * (content - frame_tone);
  return wall + outer * (opening - wall);
}

float Asphalt(const Material& m, double s, double t, float width) {
  const float patches = Marks(m.seed + 1, {s, t, width}, 3.1f, 0.6f);
  return 0.20f * patches + 0.17f * Octaves(m.seed + 3, {s, t, width}, {1.1f, 4, 0.8f}) +
         0.20f * Detail(m.seed + 20, {s, t, width}, {1.3f, 5, 0.95f}, 0.45f);
}

float Poster(const Material& m, double s, double t, float width) {
  const std::uint64_t style = HashBits(m.seed, 3, 4);
  const float x = static_cast<float>(s) - 0.5f * m.size_s_m;
  const float y = static_cast<float>(t) - 0.5f * m.size_t_m;
  const float border = 0.025f + 0.02f * UnitFrom(style, 0);
  const float inside =
      CoverRect(x, y, 0.5f * m.size_s_m - border, 0.5f * m.size_t_m - border, width);
  const float frame = UnitFrom(style, 8) < 0.5f ? -0.42f : 0.42f;
  const float text_top = m.size_t_m * (0.15f + 0.35f * UnitFrom(style, 16));
  const float cell = m.size_s_m / (4.0f + 5.0f * UnitFrom(style, 24));
  const float picture = 0.34f * Mosaic(m.seed + 1, {s, t, width}, cell, 0.8f * cell) +
                        0.22f * Mosaic(m.seed + 2, {s, t, width}, 0.31f * cell, 0.27f * cell) +
                        0.34f * Detail(m.seed + 20, {s, t, width}, {1.6f * cell, 5, 0.9f}, 0.6f);
  const float line = 0.03f + 0.05f * UnitFrom(style, 32);
  const float paper = UnitFrom(style, 40) < 0.75f ? 0.36f : -0.36f;
  const float text = paper - 1.9f * paper * Letters(m.seed + 5, s, text_top - t, width, line);
  const float is_text = CoverInterval(static_cast<float>(t), -1.0f, text_top, width);
  const float content = picture + is_text * (text - picture);
  return frame + inside * (content - frame);
}

float Shelf(const Material& m, double s, double t, float width) {
  const float row_height = 0.29f + 0.08f * UnitFrom(HashBits(m.seed, 5, 6), 0);
  const std::int64_t row = Floor(t / row_height);
  const float y = static_cast<float>(t - static_cast<double>(row) * row_height);
  const float book = 0.035f + 0.02f * UnitFrom(HashBits(m.seed + 2, row, 0), 0);
  const auto value = [&](std::int64_t i, std::int64_t j) {
    const std::uint64_t hash = HashBits(m.seed + 1, i, row);
    const float top = row_height * (0.62f + 0.3f * UnitFrom(hash, 0));
    const float in_book = CoverInterval(y, 0.0f, top, width);
    const std::uint64_t mark = HashBits(m.seed + 4, i, j);
    const float label = UnitFrom(mark, 0) < 0.35f ? Signed(mark, 8) : 0.0f;
    const float cover = 0.5f * Signed(hash, 8) + 0.45f * label;
    return -0.45f + in_book * (cover + 0.45f);
  };
  const float visible = Resolved(book, width);
  const float books =
      visible * AverageCells(s / book, t / 0.03, width / book, width / 0.03f, value) -
      0.15f * (1.0f - visible);
  const float board = CoverInterval(y, -0.01f, 0.022f, width);
  return books + board * (0.3f - books) +
         0.12f * Detail(m.seed + 20, {s, t, width}, {0.1f, 3, 0.9f}, 0.5f);
}

float Fabric(const Material& m, double s, double t, float width) {
  const float cell = 0.10f + 0.08f * UnitFrom(HashBits(m.seed, 7, 8), 0);
  const double a = s + t;  // figures stand on their corners
  const double b = s - t;
  return 0.20f * Mosaic(m.seed + 1, {a, b, 1.4f * width}, cell, cell) +
         0.16f * Mosaic(m.seed + 2, {a, b, 1.4f * width}, 0.33f * cell, 0.33f * cell) +
         0.12f * Mosaic(m.seed + 3, {s, t, width}, 0.012f, 0.012f) +
         0.2f * Detail(m.seed + 20, {s, t, width}, {2.0f * cell, 4, 0.9f}, 0.5f);
}

float Leaves(const Material& m, double s, double t, float width) {
  return 0.22f * Octaves(m.seed, {s, t, width}, {0.9f, 5, 0.75f}) +
         0.40f * Detail(m.seed + 20, {s, t, width}, {0.55f, 4, 0.85f}, 0.8f);
}

float Panel(const Material& m, double s, double t, float width) {
  const std::uint64_t style = HashBits(m.seed, 9, 10);
  const float size_s = m.size_s_m / (1.0f + std::floor(2.99f * UnitFrom(style, 0)));
  const float size_t = m.size_t_m / (1.0f + std::floor(2.99f * UnitFrom(style, 8)));
  const Cell cell = CellAt(s, t, size_s, size_t);
  const std::uint64_t hash = HashBits(m.seed + 1, cell.i, cell.j);
  const float seam = 1.0f - InsideJoints(cell, size_s, size_t, 0.006f, width);
  const float half = 0.1f + 0.25f * UnitFrom(hash, 0);
  const float x = cell.x - size_s * (0.3f + 0.4f * UnitFrom(hash, 8));
  const float y = cell.y - size_t * (0.3f + 0.4f * UnitFrom(hash, 16));
  const float label = CoverRect(x, y, half * size_s, half * size_t * 0.6f, width);
  const float line = std::clamp(0.12f * size_t, 0.03f, 0.2f);
  const float sign = UnitFrom(hash, 24) < 0.5f ? -1.0f : 1.0f;
  const float text = sign * (0.35f - 0.7f * Letters(m.seed + 5, s, -t, width, line));
  return 0.12f * Signed(hash, 32) - 0.4f * seam + label * text +
         0.18f *
             Detail(m.seed + 20, {s, t, width}, {0.5f * std::min(size_s, size_t), 5, 0.9f}, 0.45f);
}

float Sky(const Material& m, double s, double t, float width) {
  return 0.08f * Octaves(m.seed, {s, 2.0 * t, width}, {0.5f, 3, 0.5f});
}

float Figure(const Material& m, double s, double t, float width) {
  switch (m.pattern) {
    case Pattern::kPlaster:
      return Plaster(m, s, t, width);
    case Pattern::kBricks:
      return Bricks(m, s, t, width);
    case Pattern::kTiles:
      return Tiles(m, s, t, width);
    case Pattern::kPlanks:
      return Planks(m, s, t, width);
    case Pattern::kFacade:
      return Facade(m, s, t, width);
    case Pattern::kAsphalt:
      return Asphalt(m, s, t, width);
    case Pattern::kPoster:
      return Poster(m, s, t, width);
    case Pattern::kShelf:
      return Shelf(m, s, t, width);
    case Pattern::kFabric:
      return Fabric(m, s, t, width);
    case Pattern::kLeaves:
      return Leaves(m, s, t, width);
    case Pattern::kPanel:
      return Panel(m, s, t, width);
    case Pattern::kSky:
      return Sky(m, s, t, width);
  }
  return 0.0f;
}

Eigen::Vector3f UnitLuma(const Eigen::Vector3f& bgr) {
  return bgr / bgr.dot(Eigen::Vector3f(0.114f, 0.587f, 0.299f));
}

}  // namespace

float Albedo(const Material& material, double s_m, double t_m, float width_m) {
  const float figure = Figure(material, s_m, t_m, std::max(width_m, 1e-5f));
  return std::clamp(material.tone + material.contrast * figure, 0.02f, 0.98f);
}

Eigen::Vector3f Tint(const Material& material, double s_m, double t_m) {
  const auto color = [&](int which) {
    const std::uint64_t hash = HashBits(material.seed, which, 77);
    return Eigen::Vector3f(0.6f + 0.8f * UnitFrom(hash, 0, 16),
                           0.7f + 0.6f * UnitFrom(hash, 16, 16),
                           0.6f + 0.8f * UnitFrom(hash, 32, 16));
  };
  if (material.pattern == Pattern::kSky) return UnitLuma({1.25f, 1.0f, 0.85f});
  if (material.pattern == Pattern::kLeaves) return UnitLuma({0.6f, 1.2f, 0.8f});
  if (material.pattern == Pattern::kAsphalt) return UnitLuma({1.03f, 1.0f, 0.98f});
  const float weight = 0.5f + 0.5f * Noise(material.seed + 50, s_m / 0.35, t_m / 0.35);
  return UnitLuma(color(0) * (1.0f - weight) + color(1) * weight);
}

}  // namespace rotslam
