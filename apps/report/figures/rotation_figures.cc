#include "apps/report/figures/rotation_figures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "apps/report/figures/panel.h"

namespace rotslam {
namespace {

// Errors against the ground truth of what the edges measured and of what averaging made of it.
struct EdgeErrors {
  std::vector<FrameId> frames;  // the later one of each edge
  std::vector<double> measured_deg;
  std::vector<double> averaged_deg;
};

EdgeErrors FindEdgeErrors(const RunData& run) {
  std::map<int, Rotation> true_world_from_cam;
  for (std::size_t k = 0; k < run.truth->frames.size(); ++k) {
    true_world_from_cam[run.truth->frames[k]] = run.truth->world_from_cam[k];
  }
  EdgeErrors errors;
  for (const RelativeRotation& edge : run.edges) {
    const auto i = true_world_from_cam.find(edge.i.value);
    const auto j = true_world_from_cam.find(edge.j.value);
    if (i == true_world_from_cam.end() || j == true_world_from_cam.end()) continue;
    if (!IsFrame(run, edge.i) || !IsFrame(run, edge.j)) continue;
    const Rotation true_i_from_j = i->second.Inverse() * j->second;
    errors.frames.push_back(edge.j);
    errors.measured_deg.push_back((edge.j_from_i * true_i_from_j).AngleDeg());
    errors.averaged_deg.push_back((EstimateOf(run, edge.j, edge.i) * true_i_from_j).AngleDeg());
  }
  return errors;
}

Drawing RelativeRotationsFigure(const RunData& run, const EdgeErrors& errors) {
  PlotPoints dots;
  const double highest = QuantileOf(errors.measured_deg, 0.99);
  for (std::size_t k = 0; k < errors.frames.size(); ++k) {
    if (errors.measured_deg[k] > highest) continue;
    dots.emplace_back(SecondsOf(run, errors.frames[k].value), errors.measured_deg[k]);
  }
  const Panel panel = {"time, s", "error, deg"};
  return PanelPage(panel, {{"one relative rotation; 99 % of them", dots, kFirstColor, 1.6}});
}

Drawing AveragingFigure(const EdgeErrors& errors) {
  const double end = QuantileOf(errors.measured_deg, 0.95);
  const Panel panel = {"error of the rotation between two frames, deg", "share of edges"};
  return PanelPage(panel,
                   {{"as measured", Distribution(errors.measured_deg, end), kSecondColor},
                    {"after averaging", Distribution(errors.averaged_deg, end), kFirstColor}});
}

Drawing ViewGraphFigure(const RunData& run) {
  PlotPoints edges, refused, accepted;
  for (const RelativeRotation& edge : run.edges) edges.emplace_back(edge.i.value, edge.j.value);
  for (const LoopRow& loop : run.loops) {
    (loop.accepted ? accepted : refused).emplace_back(loop.match, loop.frame);
  }
  std::vector<Series> series = {{"edge", edges, kFirstColor, 1.6}};
  if (!refused.empty())
    series.push_back({"place that looks alike, refused", refused, kSecondColor, 4.0});
  if (!accepted.empty()) series.push_back({"loop", accepted, kThirdColor, 4.0});
  Panel panel = {"older frame", "newer frame"};
  panel.height = 260.0;
  return PanelPage(panel, series);
}

// Rotation and step from each frame to the next. Segments of pure rotation or rest are shaded.
Drawing MotionFigure(const RunData& run) {
  PlotPoints steps, angles;
  for (int n = 1; n < run.NumFrames(); ++n) {
    const double seconds = SecondsOf(run, n);
    steps.emplace_back(seconds,
                       (run.poses[n].center_in_world - run.poses[n - 1].center_in_world).norm());
    angles.emplace_back(seconds, EstimateOf(run, FrameId{n}, FrameId{n - 1}).AngleDeg());
  }
  Panel panel = {"", "rotation, deg"};
  panel.height = 100.0;
  for (const Segment& segment : run.segments) {
    if (segment.kind == "translating") continue;
    panel.shaded.push_back(
        {SecondsOf(run, segment.first_frame), SecondsOf(run, segment.last_frame)});
  }
  Panel below = panel;
  below.top = 140.0;
  below.x_label = "time, s";
  below.y_label = "step";
  Drawing drawing(kStageWidth, PageHeight(below));
  DrawPanel(panel,
            {{"from frame to frame; shaded: pure rotation or at rest", angles, kFirstColor}},
            drawing);
  DrawPanel(below, {{"", steps, kThirdColor}}, drawing);
  return drawing;
}

// Standard deviations of the orientations, by what they rest on.
Drawing SourcesFigure(const RunData& run) {
  Series images = {"images", {}, kFirstColor, 2.5};
  Series both = {"images and given", {}, kThirdColor, 2.5};
  Series given = {"given alone", {}, kSecondColor, 2.5};
  for (const RotationRow& row : run.rotations) {
    if (!row.sigma_deg) continue;
    const auto has = [&](const char* flag) {
      return std::find(row.flags.begin(), row.flags.end(), flag) != row.flags.end();
    };
    Series& series = !has("given") ? images : has("images") ? both : given;
    series.points.emplace_back(SecondsOf(run, row.frame), row.sigma_deg->norm() / std::sqrt(3.0));
  }
  const Panel panel = {"time, s", "standard deviation, deg"};
  return PanelPage(panel, {images, both, given});
}

bool HasGivenOrientations(const RunData& run) {
  return std::any_of(run.rotations.begin(), run.rotations.end(), [](const RotationRow& row) {
    return std::find(row.flags.begin(), row.flags.end(), "given") != row.flags.end();
  });
}

}  // namespace

void AddRotationFigures(const RunData& run, std::vector<Figure>& figures) {
  if (run.truth) {
    const EdgeErrors errors = FindEdgeErrors(run);
    if (!errors.frames.empty()) {
      figures.push_back({"relative_rotations", RelativeRotationsFigure(run, errors)});
      figures.push_back({"averaging", AveragingFigure(errors)});
    }
  }
  if (!run.edges.empty()) figures.push_back({"view_graph", ViewGraphFigure(run)});
  if (run.HasPositions()) figures.push_back({"motion", MotionFigure(run)});
  if (HasGivenOrientations(run)) figures.push_back({"sources", SourcesFigure(run)});
}

}  // namespace rotslam
