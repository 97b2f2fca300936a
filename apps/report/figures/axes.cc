#include "apps/report/figures/axes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr Color kGrid = {0.87, 0.87, 0.87};

struct Ticks {
  std::vector<double> values;
  std::string format;
};

// Round steps, so that about `count` fit between the ends.
Ticks TicksBetween(double low, double high, double count) {
  const double rough = (high - low) / std::max(1.0, count);
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {5.0, 2.0, 1.0}) {
    if (factor * power >= rough) step = factor * power;
  }
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  Ticks ticks{{}, "%." + std::to_string(decimals) + "f"};
  const auto first = static_cast<long>(std::ceil(low / step - 1e-9));
  const auto last = static_cast<long>(std::floor(high / step + 1e-9));
  ticks.values.reserve(std::max(0L, last - first + 1));
  for (long k = first; k <= last; ++k) ticks.values.push_back(step * static_cast<double>(k));
  return ticks;
}

}  // namespace

void Axes::Include(const Eigen::Vector2d& point) {
  for (int axis = 0; axis < 2; ++axis) {
    if (std::isnan(point[axis])) continue;
    low_[axis] = std::min(low_[axis], point[axis]);
    high_[axis] = std::max(high_[axis], point[axis]);
  }
}

void Axes::Settle(bool equal_scale) {
  for (int axis = 0; axis < 2; ++axis) {
    if (high_[axis] - low_[axis] > 1e-12) continue;
    low_[axis] = (std::abs(low_[axis]) < 1e299 ? low_[axis] : 0.0) - 0.5;
    high_[axis] = low_[axis] + 1.0;
  }
  Eigen::Vector2d span = high_ - low_;
  const Eigen::Vector2d middle = 0.5 * (low_ + high_);
  if (equal_scale) {
    const Eigen::Vector2d size(box_.width, box_.height);
    span = 1.06 * (span.array() / size.array()).maxCoeff() * size;
  } else {
    span.y() *= 1.1;
  }
  low_ = middle - 0.5 * span;
  high_ = middle + 0.5 * span;
}

Eigen::Vector2d Axes::OnPage(const Eigen::Vector2d& point) const {
  const Eigen::Vector2d share = (point - low_).array() / (high_ - low_).array();
  return {box_.left + box_.width * share.x(), box_.top + box_.height * (1.0 - share.y())};
}

bool Axes::Contains(const Eigen::Vector2d& point) const {
  return (point.array() >= low_.array()).all() && (point.array() <= high_.array()).all();
}

void Axes::DrawFrame(const std::string& x_label,
                     const std::string& y_label,
                     Drawing& drawing) const {
  const double right = box_.left + box_.width;
  const double bottom = box_.top + box_.height;
  const Ticks across = TicksBetween(low_.x(), high_.x(), box_.width / 55.0);
  for (const double value : across.values) {
    const double x = OnPage({value, low_.y()}).x();
    drawing.AddLine({{x, box_.top}, {x, bottom}}, {kGrid, 0.5});
    if (x_label.empty()) continue;
    drawing.AddText({x, bottom + 11.0},
                    FormatNumber(across.format.c_str(), value),
                    {TextAnchor::kMiddle, 8.0, false, false, kInk});
  }
  const Ticks up = TicksBetween(low_.y(), high_.y(), box_.height / 26.0);
  for (const double value : up.values) {
    const double y = OnPage({low_.x(), value}).y();
    drawing.AddLine({{box_.left, y}, {right, y}}, {kGrid, 0.5});
    drawing.AddText({box_.left - 4.0, y + 3.0},
                    FormatNumber(up.format.c_str(), value),
                    {TextAnchor::kEnd, 8.0, false, false, kInk});
  }
  drawing.AddLine({{box_.left, box_.top},
                   {right, box_.top},
                   {right, bottom},
                   {box_.left, bottom},
                   {box_.left, box_.top}},
                  {kInk, 0.7});
  drawing.AddText({0.5 * (box_.left + right), bottom + 24.0},
                  x_label,
                  {TextAnchor::kMiddle, 9.0, false, false, kInk});
  drawing.AddText({box_.left - 36.0, box_.top + 0.5 * box_.height},
                  y_label,
                  {TextAnchor::kMiddle, 9.0, true, false, kInk});
}

void Axes::DrawLine(const std::vector<Eigen::Vector2d>& points,
                    const Stroke& stroke,
                    Drawing& drawing) const {
  std::vector<Eigen::Vector2d> part;
  for (const Eigen::Vector2d& point : points) {
    if (Contains(point)) {
      part.push_back(OnPage(point));
      continue;
    }
    if (part.size() > 1) drawing.AddLine(part, stroke);
    part.clear();
  }
  if (part.size() > 1) drawing.AddLine(std::move(part), stroke);
}

}  // namespace rotslam
