#include "apps/report/figures/panel.h"

#include <algorithm>
#include <utility>

#include "apps/report/figures/axes.h"

namespace rotslam {
namespace {

constexpr Color kBand = {0.10, 0.36, 0.72, 0.25};
constexpr Color kShade = {0.85, 0.41, 0.05, 0.16};
constexpr double kMarginLeft = 52.0;
constexpr double kPanelWidth = kStageWidth - kMarginLeft - 12.0;
constexpr std::size_t kMaxSeriesDots = 1500;  // of one series, so that a figure stays below 100 kB

PlotPoints AtMost(std::size_t limit, const PlotPoints& points) {
  const std::size_t step = points.size() / (limit + 1) + 1;
  PlotPoints chosen;
  for (std::size_t k = 0; k < points.size(); k += step) chosen.push_back(points[k]);
  return chosen;
}

}  // namespace

double PageHeight(const Panel& last) { return last.top + last.height + 32.0; }

void DrawPanel(const Panel& panel,
               std::vector<Series> all_series,
               Drawing& drawing,
               const Band& band) {
  Axes axes({kMarginLeft, panel.top, kPanelWidth, panel.height});
  for (const Eigen::Vector2d& point : band.outline) axes.Include(point);
  for (const Series& series : all_series) {
    for (const Eigen::Vector2d& point : series.points) axes.Include(point);
  }
  axes.Settle(panel.equal_scale);
  axes.DrawFrame(panel.x_label, panel.y_label, drawing);
  for (const auto& [begin, end] : panel.shaded) {
    const double left = std::max(axes.OnPage({begin, 0.0}).x(), kMarginLeft);
    const double right = std::min(axes.OnPage({end, 0.0}).x(), kMarginLeft + kPanelWidth);
    const double bottom = panel.top + panel.height;
    drawing.AddArea({{left, panel.top}, {right, panel.top}, {right, bottom}, {left, bottom}},
                    kShade);
  }
  if (!band.outline.empty()) {
    PlotPoints corners;
    for (const Eigen::Vector2d& point : band.outline) corners.push_back(axes.OnPage(point));
    drawing.AddArea(std::move(corners), kBand);
    all_series.push_back({band.name, {}, kBand});
  }
  double legend_x = kMarginLeft;
  for (const Series& series : all_series) {
    if (series.dot_size > 0.0) {
      PlotPoints dots;
      for (const Eigen::Vector2d& point : AtMost(kMaxSeriesDots, series.points)) {
        dots.push_back(axes.OnPage(point));
      }
      drawing.AddDots(std::move(dots), series.dot_size, series.color);
    } else {
      axes.DrawLine(series.points, {series.color, 1.3}, drawing);
    }
    if (series.name.empty()) continue;
    const double baseline = panel.top - 9.0;
    drawing.AddLine({{legend_x, baseline - 3.0}, {legend_x + 16.0, baseline - 3.0}},
                    {series.color, 2.5});
    drawing.AddText(
        {legend_x + 20.0, baseline}, series.name, {TextAnchor::kStart, 9.0, false, false, kInk});
    legend_x += 32.0 + 4.6 * static_cast<double>(series.name.size());
  }
}

Drawing PanelPage(const Panel& panel, std::vector<Series> all_series, const Band& band) {
  Drawing drawing(kStageWidth, PageHeight(panel));
  DrawPanel(panel, std::move(all_series), drawing, band);
  return drawing;
}

double QuantileOf(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[place];
}

PlotPoints Distribution(std::vector<double> values, double end) {
  std::sort(values.begin(), values.end());
  PlotPoints curve;
  for (int k = 0; k <= 200; ++k) {
    const double x = end * k / 200.0;
    const auto below = std::upper_bound(values.begin(), values.end(), x) - values.begin();
    curve.emplace_back(x, static_cast<double>(below) / static_cast<double>(values.size()));
  }
  return curve;
}

double SecondsOf(const RunData& run, int frame) {
  return run.rotations[frame].timestamp_s - run.rotations.front().timestamp_s;
}

bool IsFrame(const RunData& run, FrameId frame) {
  return frame.value >= 0 && frame.value < run.NumFrames();
}

Rotation EstimateOf(const RunData& run, FrameId j, FrameId i) {
  return run.rotations[j.value].world_from_cam.Inverse() * run.rotations[i.value].world_from_cam;
}

}  // namespace rotslam
