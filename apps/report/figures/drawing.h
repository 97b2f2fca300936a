#pragma once

#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// Red, green, blue and opacity, each 0 to 1.
struct Color {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
  double opacity = 1.0;
};

inline constexpr Color kInk = {0.1, 0.1, 0.1};

struct Stroke {
  Color color;
  double width = 1.0;
  double dash = 0.0;  // length of dashes and gaps; 0: a whole line
};

enum class TextAnchor { kStart, kMiddle, kEnd };

struct TextStyle {
  TextAnchor anchor = TextAnchor::kStart;
  double size = 9.0;
  bool upwards = false;  // turned by a quarter, to be read from below
  bool bold = false;
  Color color;
};

/// Lines, areas and text on a white page, in points (1/72 inch) from its top left corner. Writes
/// them as SVG, in which text remains text, and as PNG.
class Drawing {
 public:
  Drawing(double width, double height) : width_(width), height_(height) {}

  double width() const { return width_; }
  double height() const { return height_; }

  void AddLine(std::vector<Eigen::Vector2d> points, const Stroke& stroke);
  void AddArea(std::vector<Eigen::Vector2d> corners, const Color& color);
  /// Adds small squares of side `size` around the points.
  void AddDots(std::vector<Eigen::Vector2d> points, double size, const Color& color);
  /// @param baseline  start, end or middle of the text on its base line.
  void AddText(const Eigen::Vector2d& baseline, std::string text, const TextStyle& style);

  std::string Svg() const;
  /// Draws with Cairo. Throws std::runtime_error when that fails.
  std::string Png(double dots_per_inch) const;

 private:
  struct Line {
    std::vector<Eigen::Vector2d> points;
    Stroke stroke;
  };
  struct Area {
    std::vector<Eigen::Vector2d> corners;
    Color color;
  };
  struct Dots {
    std::vector<Eigen::Vector2d> points;
    double size;
    Color color;
  };
  struct Text {
    Eigen::Vector2d baseline;
    std::string text;
    TextStyle style;
  };
  class SvgWriter;
  class CairoPainter;

  double width_;
  double height_;
  std::vector<std::variant<Line, Area, Dots, Text>> shapes_;
};

struct Figure {
  std::string name;  // of its files, without ending
  Drawing drawing;
};

}  // namespace rotslam
