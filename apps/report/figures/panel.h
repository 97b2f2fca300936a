#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "apps/report/figures/drawing.h"
#include "apps/report/run_data.h"

namespace rotslam {

using PlotPoints = std::vector<Eigen::Vector2d>;

inline constexpr Color kFirstColor = {0.10, 0.36, 0.72, 0.8};
inline constexpr Color kSecondColor = {0.85, 0.41, 0.05, 0.9};
inline constexpr Color kThirdColor = {0.05, 0.48, 0.32, 0.9};

/// Width of the figures of the stages, points.
inline constexpr double kStageWidth = 504.0;
/// Height of the line above a panel, points.
inline constexpr double kPanelHead = 24.0;

/// One curve, or one set of dots.
struct Series {
  std::string name;  // for the legend; empty: not in it
  PlotPoints points;
  Color color;
  double dot_size = 0.0;  // 0: a line through the points
};

/// A diagram across the page.
struct Panel {
  std::string x_label;
  std::string y_label;
  double top = kPanelHead;
  double height = 150.0;
  bool equal_scale = false;
  std::vector<std::array<double, 2>> shaded = {};  // ranges of x
};

/// An area behind the curves.
struct Band {
  PlotPoints outline;  // empty: none
  std::string name;
};

/// Height of a page that ends with this panel.
double PageHeight(const Panel& last);

/// Draws the panel with its legend.
void DrawPanel(const Panel& panel,
               std::vector<Series> all_series,
               Drawing& drawing,
               const Band& band = {});

/// A page with this one panel.
Drawing PanelPage(const Panel& panel, std::vector<Series> all_series, const Band& band = {});

/// The value that this share of them does not exceed; 0 of none.
double QuantileOf(std::vector<double> values, double share);

/// Share of the values below each of them, up to `end`, in 200 steps.
PlotPoints Distribution(std::vector<double> values, double end);

/// Seconds since the first frame of the run.
double SecondsOf(const RunData& run, int frame);

/// Whether the run has this frame.
bool IsFrame(const RunData& run, FrameId frame);

/// The run's rotation from frame i to frame j.
Rotation EstimateOf(const RunData& run, FrameId j, FrameId i);

}  // namespace rotslam
