#include "apps/report/figures/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "apps/page/camera_angles.h"
#include "apps/report/figures/axes.h"
#include "apps/report/figures/stage_figures.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr Color kBlue = {0.10, 0.36, 0.72};
constexpr Color kOrange = {0.85, 0.41, 0.05};
constexpr Color kGreen = {0.05, 0.48, 0.32};
constexpr Color kTruth = {0.0, 0.0, 0.0};
constexpr Color kCloud = {0.55, 0.58, 0.62, 0.55};
constexpr std::array<Color, 3> kAxisColors = {kBlue, kOrange, kGreen};
constexpr double kWidth = 504.0;  // 7 inches: two columns of a paper
constexpr double kLeft = 52.0;
constexpr double kPlotWidth = kWidth - kLeft - 12.0;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

constexpr Stroke kMeasured = {kBlue, 1.4};
constexpr Stroke kAssumedScale = {kBlue, 1.4, 2.5};

struct LegendEntry {
  std::string text;
  Stroke stroke;
};

void DrawLegend(const std::vector<LegendEntry>& entries, Drawing& drawing) {
  double x = kLeft;
  for (const LegendEntry& entry : entries) {
    drawing.AddLine({{x, 12.0}, {x + 22.0, 12.0}}, entry.stroke);
    drawing.AddText({x + 26.0, 15.0}, entry.text, {TextAnchor::kStart, 9.0, false, false, kInk});
    x += 38.0 + 4.6 * static_cast<double>(entry.text.size());
  }
}

double SecondsAt(const RunData& run, int frame) {
  return run.rotations[frame].timestamp_s - run.rotations.front().timestamp_s;
}

// Axes of a level map: right and forward of the first view, and up, which is against the mean of
// the cameras' downward axes.
Eigen::Matrix3d LevelFromWorld(const Trajectory& poses) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : poses) up -= pose.world_from_cam.Matrix().col(1);
  if (up.norm() < 0.2 * static_cast<double>(poses.size())) up = -Eigen::Vector3d::UnitY();
  up.normalize();
  Eigen::Vector3d forward = poses.front().world_from_cam.Matrix().col(2);
  if (std::abs(forward.dot(up)) > 0.95) forward = poses.front().world_from_cam.Matrix().col(1);
  forward = (forward - forward.dot(up) * up).normalized();
  Eigen::Matrix3d level_from_world;
  level_from_world << forward.cross(up).transpose(), forward.transpose(), up.transpose();
  return level_from_world;
}

bool IsPureRotation(const Segment& segment) { return segment.kind != "translating"; }

bool HasAssumedScale(const Segment& segment) { return segment.scale == "continuity"; }

// Draws the estimated path, dashed where the scale is not measured.
void DrawEstimate(const RunData& run,
                  const std::vector<Eigen::Vector2d>& estimate,
                  const Axes& axes,
                  Drawing& drawing) {
  std::vector<bool> is_assumed(estimate.size(), false);
  for (const Segment& segment : run.segments) {
    if (!HasAssumedScale(segment)) continue;
    const int end = std::min(segment.last_frame + 1, static_cast<int>(estimate.size()));
    for (int n = std::max(0, segment.first_frame); n < end; ++n) is_assumed[n] = true;
  }
  for (std::size_t first = 0; first + 1 < estimate.size();) {
    std::size_t last = first + 1;
    while (last + 1 < estimate.size() && is_assumed[last] == is_assumed[first]) ++last;
    axes.DrawLine({estimate.begin() + first, estimate.begin() + last + 1},
                  is_assumed[first] ? kAssumedScale : kMeasured,
                  drawing);
    first = last;
  }
}

struct Paths {
  std::vector<Eigen::Vector3d> estimate;
  std::vector<Eigen::Vector3d> truth;
  std::vector<Eigen::Vector3d> cloud;
};

Paths LevelPaths(const RunData& run) {
  constexpr std::size_t kMaxDots = 6000;
  const Eigen::Matrix3d level_from_world = LevelFromWorld(run.poses);
  Paths paths;
  paths.estimate.reserve(run.poses.size());
  for (const StampedPose& pose : run.poses) {
    paths.estimate.emplace_back(level_from_world * pose.center_in_world);
  }
  if (run.truth) {
    paths.truth.reserve(run.truth->center_in_world.size());
    for (const Eigen::Vector3d& center : run.truth->center_in_world) {
      paths.truth.emplace_back(level_from_world * center);
    }
  }
  if (!run.cloud) return paths;
  const std::size_t step = run.cloud->tracks.size() / kMaxDots + 1;
  paths.cloud.reserve(kMaxDots);
  for (std::size_t k = 0; k < run.cloud->tracks.size(); k += step) {
    const auto& point = run.cloud->tracks[k].point_in_world;
    if (point) paths.cloud.emplace_back(level_from_world * *point);
  }
  return paths;
}

std::vector<Eigen::Vector2d> Projected(const std::vector<Eigen::Vector3d>& points,
                                       int across,
                                       int up) {
  std::vector<Eigen::Vector2d> projected;
  projected.reserve(points.size());
  for (const Eigen::Vector3d& point : points) projected.emplace_back(point[across], point[up]);
  return projected;
}

// The side from which a map is drawn: the world's axes across and up, and what they are called.
struct MapSide {
  std::array<int, 2> axes = {};
  std::array<std::string, 2> labels;
};

// The range of the axes is that of the path and a margin; points of the cloud outside are left out.
// @return  whether any point of the cloud is drawn.
bool DrawMap(
    const RunData& run, const Paths& paths, const MapSide& side, Axes axes, Drawing& drawing) {
  const auto [across, up] = side.axes;
  const std::vector<Eigen::Vector2d> estimate = Projected(paths.estimate, across, up);
  const std::vector<Eigen::Vector2d> truth = Projected(paths.truth, across, up);
  Eigen::AlignedBox2d path;
  for (const Eigen::Vector2d& point : estimate) path.extend(point);
  for (const Eigen::Vector2d& point : truth) path.extend(point);
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.25 * path.sizes().maxCoeff());
  axes.Include(path.min() - margin);
  axes.Include(path.max() + margin);
  axes.Settle(/*equal_scale=*/true);
  axes.DrawFrame(side.labels[0], side.labels[1], drawing);
  std::vector<Eigen::Vector2d> dots;
  for (const Eigen::Vector2d& point : Projected(paths.cloud, across, up)) {
    if (axes.Contains(point)) dots.push_back(axes.OnPage(point));
  }
  const bool has_dots = !dots.empty();
  drawing.AddDots(std::move(dots), 0.7, kCloud);
  DrawEstimate(run, estimate, axes, drawing);
  axes.DrawLine(truth, {kTruth, 1.0, 3.5}, drawing);
  std::vector<Eigen::Vector2d> rotation_places;
  for (const Segment& segment : run.segments) {
    if (!IsPureRotation(segment)) continue;
    rotation_places.push_back(axes.OnPage(estimate[segment.first_frame]));
  }
  drawing.AddDots(std::move(rotation_places), 5.0, kOrange);
  return has_dots;
}

Drawing TrajectoryFigure(const RunData& run) {
  Drawing drawing(kWidth, 560.0);
  const Paths paths = LevelPaths(run);
  const bool has_dots_above = DrawMap(run,
                                      paths,
                                      {{0, 1}, {"right", "forward, from above"}},
                                      Axes({kLeft, 24.0, kPlotWidth, 320.0}),
                                      drawing);
  const bool has_dots_aside = DrawMap(run,
                                      paths,
                                      {{1, 2}, {"forward", "up, from the side"}},
                                      Axes({kLeft, 384.0, kPlotWidth, 138.0}),
                                      drawing);
  std::vector<LegendEntry> legend = {{"estimate", kMeasured}};
  if (std::any_of(run.segments.begin(), run.segments.end(), HasAssumedScale)) {
    legend.push_back({"scale assumed", kAssumedScale});
  }
  if (!paths.truth.empty()) legend.push_back({"ground truth", {kTruth, 1.0, 3.5}});
  if (std::any_of(run.segments.begin(), run.segments.end(), IsPureRotation)) {
    legend.push_back({"rotating or at rest", {kOrange, 5.0}});
  }
  if (has_dots_above || has_dots_aside) legend.push_back({"points", {kCloud, 2.0}});
  DrawLegend(legend, drawing);
  return drawing;
}

// A curve over time with a band around it.
struct Curve {
  std::vector<Eigen::Vector2d> points;
  std::vector<double> half_widths;  // of the band; NaN where unknown, empty for none
  Stroke stroke;
};

void DrawCurves(const std::vector<Curve>& curves,
                const std::array<std::string, 2>& labels,
                bool band_around_zero,
                Axes axes,
                Drawing& drawing) {
  const auto band_at = [&](const Curve& curve, std::size_t k, double side) -> Eigen::Vector2d {
    const double middle = band_around_zero ? 0.0 : curve.points[k].y();
    const double half = curve.half_widths.empty() ? 0.0 : curve.half_widths[k];
    return {curve.points[k].x(), std::isnan(half) ? kNaN : middle + side * half};
  };
  for (const Curve& curve : curves) {
    for (std::size_t k = 0; k < curve.points.size(); ++k) {
      axes.Include(curve.points[k]);
      axes.Include(band_at(curve, k, 1.0));
      axes.Include(band_at(curve, k, -1.0));
    }
  }
  axes.Settle(/*equal_scale=*/false);
  axes.DrawFrame(labels[0], labels[1], drawing);
  for (const Curve& curve : curves) {
    std::vector<Eigen::Vector2d> outline;
    for (const double side : {1.0, -1.0}) {
      const std::size_t begin = outline.size();
      for (std::size_t k = 0; k < curve.half_widths.size(); ++k) {
        const Eigen::Vector2d corner = band_at(curve, k, side);
        if (!std::isnan(corner.y())) outline.push_back(axes.OnPage(corner));
      }
      if (side < 0.0)
        std::reverse(outline.begin() + static_cast<std::ptrdiff_t>(begin), outline.end());
    }
    Color light = curve.stroke.color;
    light.opacity = 0.22;
    if (outline.size() > 2) drawing.AddArea(std::move(outline), light);
    axes.DrawLine(curve.points, curve.stroke, drawing);
  }
}

// The sigma of roll, pitch and yaw: about z, x and y.
double SigmaOf(const RotationRow& row, int angle) {
  constexpr std::array<int, 3> kAxisOfAngle = {2, 0, 1};
  return row.sigma_deg ? (*row.sigma_deg)[kAxisOfAngle[angle]] : kNaN;
}

Drawing OrientationFigure(const RunData& run) {
  Drawing drawing(kWidth, 420.0);
  std::vector<Rotation> estimate;
  estimate.reserve(run.rotations.size());
  for (const RotationRow& row : run.rotations) estimate.push_back(row.world_from_cam);
  const std::vector<Eigen::Vector3d> angles_deg = RollPitchYawDeg(estimate);
  const std::vector<Eigen::Vector3d> true_deg =
      run.truth ? RollPitchYawDeg(run.truth->world_from_cam) : std::vector<Eigen::Vector3d>();
  std::vector<LegendEntry> legend = {{"estimate, band: one standard deviation", {kBlue, 1.3}}};
  if (run.truth) legend.push_back({"ground truth, turned to fit best", {kTruth, 1.0, 3.5}});
  DrawLegend(legend, drawing);
  const std::array<std::string, 3> kNames = {"roll, deg", "pitch, deg", "yaw, deg"};
  for (int angle = 0; angle < 3; ++angle) {
    std::vector<Curve> curves(1);
    curves[0].stroke = {kAxisColors[angle], 1.3};
    for (int n = 0; n < run.NumFrames(); ++n) {
      curves[0].points.emplace_back(SecondsAt(run, n), angles_deg[n][angle]);
      curves[0].half_widths.push_back(SigmaOf(run.rotations[n], angle));
    }
    if (run.truth) {
      Curve& truth = curves.emplace_back();
      truth.stroke = {kTruth, 1.0, 3.5};
      for (std::size_t k = 0; k < true_deg.size(); ++k) {
        const int n = run.truth->frames[k];
        const double turns = std::round((angles_deg[n][angle] - true_deg[k][angle]) / 360.0);
        truth.points.emplace_back(SecondsAt(run, n), true_deg[k][angle] + 360.0 * turns);
      }
    }
    DrawCurves(curves,
               {angle == 2 ? "time, s" : "", kNames[angle]},
               false,
               Axes({kLeft, 24.0 + 122.0 * angle, kPlotWidth, 110.0}),
               drawing);
  }
  return drawing;
}

Drawing ErrorFigure(const RunData& run) {
  const TruthData& truth = *run.truth;
  const bool has_positions = !truth.position_error_m.empty();
  Drawing drawing(kWidth, has_positions ? 540.0 : 420.0);
  DrawLegend({{"error of the orientation, band: one standard deviation as claimed", {kBlue, 1.3}}},
             drawing);
  const std::array<std::string, 3> kNames = {"roll, deg", "pitch, deg", "yaw, deg"};
  constexpr std::array<int, 3> kAxisOfAngle = {2, 0, 1};
  for (int angle = 0; angle < 3; ++angle) {
    Curve curve;
    curve.stroke = {kAxisColors[angle], 1.3};
    for (std::size_t k = 0; k < truth.frames.size(); ++k) {
      const RotationRow& row = run.rotations[truth.frames[k]];
      const Eigen::Vector3d error_deg = ErrorDeg(row.world_from_cam, truth.world_from_cam[k]);
      curve.points.emplace_back(SecondsAt(run, truth.frames[k]), error_deg[kAxisOfAngle[angle]]);
      curve.half_widths.push_back(SigmaOf(row, angle));
    }
    DrawCurves({curve},
               {angle == 2 && !has_positions ? "time, s" : "", kNames[angle]},
               true,
               Axes({kLeft, 24.0 + 122.0 * angle, kPlotWidth, 110.0}),
               drawing);
  }
  if (!has_positions) return drawing;
  Curve curve;
  curve.stroke = {kInk, 1.3};
  for (std::size_t k = 0; k < truth.frames.size(); ++k) {
    curve.points.emplace_back(SecondsAt(run, truth.frames[k]), truth.position_error_m[k]);
  }
  DrawCurves(
      {curve}, {"time, s", "position, m"}, false, Axes({kLeft, 390.0, kPlotWidth, 110.0}), drawing);
  return drawing;
}

Drawing RuntimeFigure(const RunData& run) {
  std::vector<std::pair<std::string, double>> stages;
  if (run.summary.contains("seconds")) {
    for (const auto& [name, seconds] : run.summary.at("seconds").items()) {
      if (seconds.is_number()) stages.emplace_back(name, seconds.get<double>());
    }
  }
  constexpr double kRow = 17.0;
  constexpr double kNameWidth = 128.0;
  Drawing drawing(kWidth, 48.0 + kRow * static_cast<double>(stages.size()));
  drawing.AddText({8.0, 18.0},
                  "seconds per stage; lighter: parts of stages; lightest: of bundle adjustment",
                  {TextAnchor::kStart, 10.0, false, true, kInk});
  double longest = 1e-9;
  for (const auto& [name, seconds] : stages) longest = std::max(longest, seconds);
  double y = 32.0;
  for (auto [name, seconds] : stages) {
    std::replace(name.begin(), name.end(), '_', ' ');
    drawing.AddText(
        {kNameWidth - 6.0, y + 10.0}, name, {TextAnchor::kEnd, 9.0, false, false, kInk});
    const double length = std::max(0.5, (kWidth - kNameWidth - 60.0) * seconds / longest);
    const bool is_whole =
        name == "total" || name == "lens" || name == "orientations" || name == "positions";
    Color color = kBlue;
    const bool is_round = name.starts_with("bundle ") && name != "bundle adjustment";
    if (!is_whole) color.opacity = is_round ? 0.25 : 0.55;
    drawing.AddArea({{kNameWidth, y + 2.0},
                     {kNameWidth + length, y + 2.0},
                     {kNameWidth + length, y + 12.0},
                     {kNameWidth, y + 12.0}},
                    color);
    drawing.AddText({kNameWidth + length + 5.0, y + 10.0},
                    FormatNumber("%.2f", seconds),
                    {TextAnchor::kStart, 9.0, false, false, kInk});
    y += kRow;
  }
  return drawing;
}

}  // namespace

std::vector<Figure> MakeFigures(const RunData& run) {
  std::vector<Figure> figures;
  if (run.HasPositions()) figures.push_back({"trajectory", TrajectoryFigure(run)});
  figures.push_back({"orientation", OrientationFigure(run)});
  if (run.truth) figures.push_back({"errors", ErrorFigure(run)});
  figures.push_back({"runtime", RuntimeFigure(run)});
  std::vector<Figure> of_stages = MakeStageFigures(run);
  std::move(of_stages.begin(), of_stages.end(), std::back_inserter(figures));
  return figures;
}

}  // namespace rotslam
