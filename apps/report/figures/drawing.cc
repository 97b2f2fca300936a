#include "apps/report/figures/drawing.h"

#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <cairo.h>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

std::string Number(double value) { return FormatNumber("%.6g", std::round(100.0 * value) / 100.0); }

// The four characters that end or begin something in XML.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '"') {
      escaped += "&quot;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Rgb(const Color& color) {
  const auto byte = [](double value) { return std::to_string(std::lround(255.0 * value)); };
  return "rgb(" + byte(color.red) + "," + byte(color.green) + "," + byte(color.blue) + ")";
}

std::string Points(const std::vector<Eigen::Vector2d>& points) {
  std::string text;
  for (const Eigen::Vector2d& point : points) {
    if (!text.empty()) text += ' ';
    text.append(Number(point.x())).append(",").append(Number(point.y()));
  }
  return text;
}

const char* Name(TextAnchor anchor) {
  if (anchor == TextAnchor::kStart) return "start";
  return anchor == TextAnchor::kMiddle ? "middle" : "end";
}

struct CairoDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};

cairo_status_t AppendBytes(void* text, const unsigned char* bytes, unsigned int length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), length);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

class Drawing::SvgWriter {
 public:
  void operator()(const Line& line) {
    svg_ += "<polyline fill=\"none\" stroke-linejoin=\"round\" stroke=\"" + Rgb(line.stroke.color) +
            "\" stroke-opacity=\"" + Number(line.stroke.color.opacity) + "\" stroke-width=\"" +
            Number(line.stroke.width) + "\"";
    if (line.stroke.dash > 0.0) svg_ += " stroke-dasharray=\"" + Number(line.stroke.dash) + "\"";
    svg_ += " points=\"" + Points(line.points) + "\"/>\n";
  }
  void operator()(const Area& area) {
    svg_ += "<polygon" + Fill(area.color) + " points=\"" + Points(area.corners) + "\"/>\n";
  }
  void operator()(const Dots& dots) {
    const std::string side = Number(dots.size);
    svg_ += "<path" + Fill(dots.color) + " d=\"";
    const std::string square = "h" + side + "v" + side + "h-" + side + "z";
    for (const Eigen::Vector2d& point : dots.points) {
      svg_.append("M").append(Number(point.x() - 0.5 * dots.size));
      svg_.append(" ").append(Number(point.y() - 0.5 * dots.size)).append(square);
    }
    svg_ += "\"/>\n";
  }
  void operator()(const Text& text) {
    const std::string x = Number(text.baseline.x());
    const std::string y = Number(text.baseline.y());
    svg_ += "<text x=\"" + x + "\" y=\"" + y + "\" font-size=\"" + Number(text.style.size) +
            "\" text-anchor=\"" + Name(text.style.anchor) + "\"" + Fill(text.style.color);
    if (text.style.bold) svg_ += " font-weight=\"bold\"";
    if (text.style.upwards) svg_ += " transform=\"rotate(-90 " + x + " " + y + ")\"";
    svg_ += ">" + Escaped(text.text) + "</text>\n";
  }
  const std::string& svg() const { return svg_; }

 private:
  static std::string Fill(const Color& color) {
    return " fill=\"" + Rgb(color) + "\" fill-opacity=\"" + Number(color.opacity) + "\"";
  }

  std::string svg_;
};

class Drawing::CairoPainter {
 public:
  explicit CairoPainter(cairo_t* context) : context_(context) {}

  void operator()(const Line& line) {
    Trace(line.points);
    Use(line.stroke.color);
    cairo_set_line_width(context_, line.stroke.width);
    cairo_set_dash(context_, &line.stroke.dash, line.stroke.dash > 0.0 ? 1 : 0, 0.0);
    cairo_stroke(context_);
  }
  void operator()(const Area& area) {
    Trace(area.corners);
    Use(area.color);
    cairo_fill(context_);
  }
  void operator()(const Dots& dots) {
    Use(dots.color);
    for (const Eigen::Vector2d& point : dots.points) {
      cairo_rectangle(
          context_, point.x() - 0.5 * dots.size, point.y() - 0.5 * dots.size, dots.size, dots.size);
      cairo_fill(context_);
    }
  }
  void operator()(const Text& text) {
    cairo_save(context_);
    Use(text.style.color);
    cairo_select_font_face(context_,
                           "sans-serif",
                           CAIRO_FONT_SLANT_NORMAL,
                           text.style.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(context_, text.style.size);
    cairo_text_extents_t extents;
    cairo_text_extents(context_, text.text.c_str(), &extents);
    const double share = text.style.anchor == TextAnchor::kStart    ? 0.0
                         : text.style.anchor == TextAnchor::kMiddle ? 0.5
                                                                    : 1.0;
    cairo_translate(context_, text.baseline.x(), text.baseline.y());
    if (text.style.upwards) cairo_rotate(context_, -0.5 * std::numbers::pi);
    cairo_move_to(context_, -share * extents.x_advance, 0.0);
    cairo_show_text(context_, text.text.c_str());
    cairo_restore(context_);
  }

 private:
  void Use(const Color& color) {
    cairo_set_source_rgba(context_, color.red, color.green, color.blue, color.opacity);
  }
  void Trace(const std::vector<Eigen::Vector2d>& points) {
    cairo_new_path(context_);
    for (const Eigen::Vector2d& point : points) cairo_line_to(context_, point.x(), point.y());
  }

  cairo_t* context_;
};

void Drawing::AddLine(std::vector<Eigen::Vector2d> points, const Stroke& stroke) {
  shapes_.emplace_back(Line{std::move(points), stroke});
}

void Drawing::AddArea(std::vector<Eigen::Vector2d> corners, const Color& color) {
  shapes_.emplace_back(Area{std::move(corners), color});
}

void Drawing::AddDots(std::vector<Eigen::Vector2d> points, double size, const Color& color) {
  shapes_.emplace_back(Dots{std::move(points), size, color});
}

void Drawing::AddText(const Eigen::Vector2d& baseline, std::string text, const TextStyle& style) {
  shapes_.emplace_back(Text{baseline, std::move(text), style});
}

std::string Drawing::Svg() const {
  SvgWriter writer;
  for (const auto& shape : shapes_) std::visit(writer, shape);
  const std::string size = Number(width_) + " " + Number(height_);
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
         "width=\"" +
         Number(width_) + "pt\" height=\"" + Number(height_) + "pt\" viewBox=\"0 0 " + size +
         "\" font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n" +
         writer.svg() + "</svg>\n";
}

std::string Drawing::Png(double dots_per_inch) const {
  const double scale = dots_per_inch / 72.0;
  const std::unique_ptr<cairo_surface_t, CairoDeleter> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24,
                                 static_cast<int>(std::ceil(scale * width_)),
                                 static_cast<int>(std::ceil(scale * height_))));
  const std::unique_ptr<cairo_t, CairoDeleter> context(cairo_create(surface.get()));
  cairo_scale(context.get(), scale, scale);
  cairo_set_line_join(context.get(), CAIRO_LINE_JOIN_ROUND);
  cairo_set_source_rgb(context.get(), 1.0, 1.0, 1.0);
  cairo_paint(context.get());
  CairoPainter painter(context.get());
  for (const auto& shape : shapes_) std::visit(painter, shape);
  std::string png;
  const cairo_status_t status = cairo_surface_write_to_png_stream(surface.get(), AppendBytes, &png);
  if (status != CAIRO_STATUS_SUCCESS) {
    throw std::runtime_error(std::string("Cairo cannot draw: ") + cairo_status_to_string(status));
  }
  return png;
}

}  // namespace rotslam
