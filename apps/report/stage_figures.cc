#include "apps/report/stage_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "apps/report/axes.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

using PlotPoints = std::vector<Eigen::Vector2d>;

constexpr Color kFirst = {0.10, 0.36, 0.72, 0.8};
constexpr Color kSecond = {0.85, 0.41, 0.05, 0.9};
constexpr Color kThird = {0.05, 0.48, 0.32, 0.9};
constexpr Color kGrey = {0.45, 0.48, 0.52, 0.6};
constexpr Color kBand = {0.10, 0.36, 0.72, 0.25};
constexpr Color kShade = {0.85, 0.41, 0.05, 0.16};
constexpr double kPageWidth = 504.0;
constexpr double kMarginLeft = 52.0;
constexpr double kPanelWidth = kPageWidth - kMarginLeft - 12.0;
constexpr double kHeadHeight = 24.0;
constexpr std::size_t kMaxDots = 1500;  // of one series, so that a figure stays below 100 kB

struct Series {
  std::string name;  // for the legend; empty: not in it
  PlotPoints points;
  Color color;
  double dot_size = 0.0;  // 0: a line through the points
};

struct Panel {
  std::string x_label;
  std::string y_label;
  double top = kHeadHeight;
  double height = 150.0;
  bool equal_scale = false;
  std::vector<std::array<double, 2>> shaded = {};  // ranges of x
};

double PageHeight(const Panel& last) { return last.top + last.height + 32.0; }

PlotPoints AtMost(std::size_t limit, const PlotPoints& points) {
  const std::size_t step = points.size() / (limit + 1) + 1;
  PlotPoints chosen;
  for (std::size_t k = 0; k < points.size(); k += step) chosen.push_back(points[k]);
  return chosen;
}

// The outline of an area behind the curves; empty: none.
struct Band {
  PlotPoints outline;
  std::string name;
};

void DrawPanel(const Panel& panel,
               std::vector<Series> all_series,
               Drawing& drawing,
               const Band& band = {}) {
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
      for (const Eigen::Vector2d& point : AtMost(kMaxDots, series.points)) {
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

double SecondsOf(const RunData& run, int frame) {
  return run.rotations[frame].timestamp_s - run.rotations.front().timestamp_s;
}

bool IsFrame(const RunData& run, FrameId frame) {
  return frame.value >= 0 && frame.value < run.NumFrames();
}

Rotation EstimateOf(const RunData& run, FrameId j, FrameId i) {
  return run.rotations[j.value].world_from_cam.Inverse() * run.rotations[i.value].world_from_cam;
}

// The value that this share of them does not exceed.
double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[place];
}

// Share of the values below each of them, up to `end`, in 200 steps.
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

// Ids of the tracks that each frame sees, ascending.
std::vector<std::vector<int>> TracksOfFrames(const RunMap& map, int num_frames) {
  std::vector<std::vector<int>> tracks(num_frames);
  for (std::size_t k = 0; k < map.tracks.size(); ++k) {
    for (const Observation& observation : map.tracks[k].track.observations) {
      const int frame = observation.frame.value;
      if (frame >= 0 && frame < num_frames) tracks[frame].push_back(static_cast<int>(k));
    }
  }
  return tracks;
}

// Paths through the image of the tracks of one frame, from so many frames before it to as many
// behind.
Drawing TracksFigure(const RunData& run) {
  constexpr int kReach = 8;  // frames
  constexpr std::size_t kMaxPaths = 240;
  const std::vector<std::vector<int>> tracks = TracksOfFrames(*run.cloud, run.NumFrames());
  const auto most =
      std::max_element(tracks.begin(), tracks.end(), [](const auto& a, const auto& b) {
        return a.size() < b.size();
      });
  const auto shown = static_cast<int>(most - tracks.begin());
  const Camera& camera = run.cloud->camera;
  const double scale = (kPageWidth - 24.0) / camera.width;
  const double bottom = kHeadHeight + scale * camera.height;
  Drawing drawing(kPageWidth, bottom + 12.0);
  drawing.AddText({12.0, 15.0},
                  "frame " + std::to_string(shown) +
                      ": features, and their paths through eight frames before and behind",
                  {TextAnchor::kStart, 9.0, false, false, kInk});
  PlotPoints dots;
  const std::size_t step = most->size() / kMaxPaths + 1;
  for (std::size_t k = 0; k < most->size(); k += step) {
    PlotPoints path;
    for (const Observation& observation : run.cloud->tracks[(*most)[k]].track.observations) {
      if (std::abs(observation.frame.value - shown) > kReach) continue;
      path.emplace_back(12.0 + scale * observation.keypoint_px.x(),
                        kHeadHeight + scale * observation.keypoint_px.y());
      if (observation.frame.value == shown) dots.push_back(path.back());
    }
    if (path.size() > 1) drawing.AddLine(std::move(path), {kFirst, 0.7});
  }
  drawing.AddDots(std::move(dots), 2.4, kSecond);
  const double right = kPageWidth - 12.0;
  drawing.AddLine({{12.0, kHeadHeight},
                   {right, kHeadHeight},
                   {right, bottom},
                   {12.0, bottom},
                   {12.0, kHeadHeight}},
                  {kInk, 0.7});
  return drawing;
}

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
  const double highest = Quantile(errors.measured_deg, 0.99);
  for (std::size_t k = 0; k < errors.frames.size(); ++k) {
    if (errors.measured_deg[k] > highest) continue;
    dots.emplace_back(SecondsOf(run, errors.frames[k].value), errors.measured_deg[k]);
  }
  const Panel panel = {"time, s", "error, deg"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel, {{"one relative rotation; 99 % of them", dots, kFirst, 1.6}}, drawing);
  return drawing;
}

Drawing AveragingFigure(const EdgeErrors& errors) {
  const double end = Quantile(errors.measured_deg, 0.95);
  const Panel panel = {"error of the rotation between two frames, deg", "share of edges"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel,
            {{"as measured", Distribution(errors.measured_deg, end), kSecond},
             {"after averaging", Distribution(errors.averaged_deg, end), kFirst}},
            drawing);
  return drawing;
}

Drawing ViewGraphFigure(const RunData& run) {
  PlotPoints edges, refused, accepted;
  for (const RelativeRotation& edge : run.edges) edges.emplace_back(edge.i.value, edge.j.value);
  for (const LoopRow& loop : run.loops) {
    (loop.accepted ? accepted : refused).emplace_back(loop.match, loop.frame);
  }
  std::vector<Series> series = {{"edge", edges, kFirst, 1.6}};
  if (!refused.empty())
    series.push_back({"place that looks alike, refused", refused, kSecond, 4.0});
  if (!accepted.empty()) series.push_back({"loop", accepted, kThird, 4.0});
  Panel panel = {"older frame", "newer frame"};
  panel.height = 260.0;
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel, series, drawing);
  return drawing;
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
  Drawing drawing(kPageWidth, PageHeight(below));
  DrawPanel(
      panel, {{"from frame to frame; shaded: pure rotation or at rest", angles, kFirst}}, drawing);
  DrawPanel(below, {{"", steps, kThird}}, drawing);
  return drawing;
}

// Standard deviations of the orientations, by what they rest on.
Drawing SourcesFigure(const RunData& run) {
  Series images = {"images", {}, kFirst, 2.5};
  Series both = {"images and given", {}, kThird, 2.5};
  Series given = {"given alone", {}, kSecond, 2.5};
  for (const RotationRow& row : run.rotations) {
    if (!row.sigma_deg) continue;
    const auto has = [&](const char* flag) {
      return std::find(row.flags.begin(), row.flags.end(), flag) != row.flags.end();
    };
    Series& series = !has("given") ? images : has("images") ? both : given;
    series.points.emplace_back(SecondsOf(run, row.frame), row.sigma_deg->norm() / std::sqrt(3.0));
  }
  const Panel panel = {"time, s", "standard deviation, deg"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel, {images, both, given}, drawing);
  return drawing;
}

bool HasGivenOrientations(const RunData& run) {
  return std::any_of(run.rotations.begin(), run.rotations.end(), [](const RotationRow& row) {
    return std::find(row.flags.begin(), row.flags.end(), "given") != row.flags.end();
  });
}

Drawing KeyframesFigure(const RunData& run) {
  const std::vector<std::vector<int>> tracks = TracksOfFrames(*run.cloud, run.NumFrames());
  PlotPoints shares, keyframes;
  const std::vector<int>* last = nullptr;
  for (const MapFrame& frame : run.cloud->frames) {
    if (!IsFrame(run, frame.id)) continue;
    const std::vector<int>& seen = tracks[frame.id.value];
    std::vector<int> common;
    if (last != nullptr && !last->empty()) {
      std::set_intersection(
          last->begin(), last->end(), seen.begin(), seen.end(), std::back_inserter(common));
      const double share = static_cast<double>(common.size()) / static_cast<double>(last->size());
      shares.emplace_back(SecondsOf(run, frame.id.value), share);
      if (frame.is_keyframe) keyframes.push_back(shares.back());
    }
    if (frame.is_keyframe) last = &seen;
  }
  const Panel panel = {"time, s", "share"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel,
            {{"points of the last keyframe that are still seen", shares, kFirst},
             {"next keyframe", keyframes, kSecond, 4.0}},
            drawing);
  return drawing;
}

// Residuals of the observations that bundle adjustment kept, px.
PlotPoints Residuals(const RunMap& map) {
  std::map<FrameId, const MapFrame*> frames;
  for (const MapFrame& frame : map.frames) frames[frame.id] = &frame;
  PlotPoints residuals;
  for (const MapTrack& track : map.tracks) {
    if (!track.point_in_world) continue;
    for (std::size_t k = 0; k < track.track.observations.size(); ++k) {
      const Observation& observation = track.track.observations[k];
      const auto frame = frames.find(observation.frame);
      if (!track.fits[k] || frame == frames.end()) continue;
      const std::optional<Eigen::Vector2d> pixel = map.camera.Project(
          frame->second->cam_from_world * (*track.point_in_world - frame->second->center_in_world));
      if (pixel) residuals.push_back(*pixel - observation.keypoint_px);
    }
  }
  return residuals;
}

// The larger component of each residual, px: what the bracket bounds.
std::vector<double> SizesOf(const PlotPoints& residuals) {
  std::vector<double> sizes;
  for (const Eigen::Vector2d& residual : residuals) {
    sizes.push_back(residual.lpNorm<Eigen::Infinity>());
  }
  return sizes;
}

Drawing ResidualsFigure(const PlotPoints& residuals) {
  const double reach = Quantile(SizesOf(residuals), 0.99);
  PlotPoints shown;
  for (const Eigen::Vector2d& residual : residuals) {
    if (residual.lpNorm<Eigen::Infinity>() <= reach) shown.push_back(residual);
  }
  Panel panel = {"across, px", "down, px"};
  panel.height = 260.0;
  panel.equal_scale = true;
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel, {{"residuals of observations; 99 % of them", shown, kFirst, 1.4}}, drawing);
  return drawing;
}

// The bracket of the least possible largest residual, and the residuals after bundle adjustment.
Drawing KnownRotationFigure(const PlotPoints& residuals, const std::array<double, 2>& bracket_px) {
  Panel panel = {"residual, px", "share"};
  panel.shaded.push_back(bracket_px);
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(
      panel,
      {{"observations below, after bundle adjustment",
        Distribution(SizesOf(residuals), 1.15 * bracket_px[1]),
        kFirst},
       {"bracket of the largest residual", {{bracket_px[0], 0.0}, {bracket_px[0], 1.0}}, kSecond},
       {"", {{bracket_px[1], 0.0}, {bracket_px[1], 1.0}}, kSecond}},
      drawing);
  return drawing;
}

Drawing RegistrationFigure(const RunData& run) {
  PlotPoints angles, keyframes;
  for (const MapFrame& frame : run.cloud->frames) {
    if (!IsFrame(run, frame.id)) continue;
    const int n = frame.id.value;
    const Rotation change = run.poses[n].world_from_cam.Inverse() * run.rotations[n].world_from_cam;
    angles.emplace_back(SecondsOf(run, n), change.AngleDeg());
    if (frame.is_keyframe) keyframes.push_back(angles.back());
  }
  const Panel panel = {"time, s", "angle, deg"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel,
            {{"trajectory_tum.txt against rotations_tum.txt", angles, kFirst},
             {"keyframe", keyframes, kSecond, 4.0}},
            drawing);
  return drawing;
}

// How far the middle of the image moves in `seconds` by rotation, px.
Drawing MotionWithinFrame(const RunData& run, double seconds, const std::string& name) {
  const double focal_px = run.summary.at("camera").at("fx").get<double>();
  PlotPoints lengths;
  for (int n = 1; n + 1 < run.NumFrames(); ++n) {
    const Eigen::Vector3d turn = EstimateOf(run, FrameId{n + 1}, FrameId{n - 1}).Log();
    const double rate = turn.head<2>().norm() / (SecondsOf(run, n + 1) - SecondsOf(run, n - 1));
    lengths.emplace_back(SecondsOf(run, n), focal_px * rate * seconds);
  }
  const Panel panel = {"time, s", "length, px"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  DrawPanel(panel, {{name, lengths, kFirst}}, drawing);
  return drawing;
}

// The lens' distortion over the image's radius, with a band of one standard deviation.
Drawing LensFigure(const LensData& lens) {
  const Panel panel = {"distance from the principal point, px", "distortion, px"};
  Drawing drawing(kPageWidth, PageHeight(panel));
  PlotPoints curve, given, band;
  for (std::size_t k = 0; k < lens.radius_px.size(); ++k) {
    curve.emplace_back(lens.radius_px[k], lens.displacement_px[k]);
    if (!lens.given_px.empty() && std::isfinite(lens.given_px[k])) {
      given.emplace_back(lens.radius_px[k], lens.given_px[k]);
    }
  }
  for (std::size_t k = 0; k < lens.sigma_px.size(); ++k) {
    band.emplace_back(curve[k].x(), curve[k].y() + lens.sigma_px[k]);
  }
  for (std::size_t k = lens.sigma_px.size(); k-- > 0;) {
    band.emplace_back(curve[k].x(), curve[k].y() - lens.sigma_px[k]);
  }
  std::vector<Series> series = {{lens.is_estimated ? "by the images" : "as used", curve, kFirst}};
  if (!given.empty()) series.push_back({"calibration", given, kSecond});
  DrawPanel(panel, series, drawing, {band, "one standard deviation"});
  return drawing;
}

// A number of the summary, 0 where it has none.
double SummaryNumber(const RunData& run, const std::string& group, const std::string& key) {
  if (!run.summary.contains(group) || !run.summary.at(group).is_object()) return 0.0;
  const auto& values = run.summary.at(group);
  return values.contains(key) && values.at(key).is_number() ? values.at(key).get<double>() : 0.0;
}

void AddMapFigures(const RunData& run, std::vector<Figure>& figures) {
  if (run.cloud && !run.cloud->tracks.empty()) {
    figures.push_back({"tracks", TracksFigure(run)});
    figures.push_back({"keyframes", KeyframesFigure(run)});
    if (run.HasPositions()) figures.push_back({"registration", RegistrationFigure(run)});
  }
  if (!run.keyframe_map) return;
  const PlotPoints residuals = Residuals(*run.keyframe_map);
  if (residuals.empty()) return;
  const double high_px = SummaryNumber(run, "krot", "gamma_high_px");
  if (high_px > 0.0) {
    const double low_px = SummaryNumber(run, "krot", "gamma_low_px");
    figures.push_back({"known_rotation", KnownRotationFigure(residuals, {low_px, high_px})});
  }
  figures.push_back({"residuals", ResidualsFigure(residuals)});
}

}  // namespace

std::vector<Figure> MakeStageFigures(const RunData& run) {
  std::vector<Figure> figures;
  if (run.truth) {
    const EdgeErrors errors = FindEdgeErrors(run);
    if (!errors.frames.empty()) {
      figures.push_back({"relative_rotations", RelativeRotationsFigure(run, errors)});
      figures.push_back({"averaging", AveragingFigure(errors)});
    }
  }
  if (!run.edges.empty()) figures.push_back({"view_graph", ViewGraphFigure(run)});
  if (run.HasPositions()) figures.push_back({"motion", MotionFigure(run)});
  if (run.lens && !run.lens->radius_px.empty()) figures.push_back({"lens", LensFigure(*run.lens)});
  if (HasGivenOrientations(run)) figures.push_back({"sources", SourcesFigure(run)});
  AddMapFigures(run, figures);
  const double readout_s = SummaryNumber(run, "camera", "readout_s");
  if (readout_s > 0.0) {
    figures.push_back(
        {"rolling_shutter",
         MotionWithinFrame(run, readout_s, "motion of the image during its readout")});
  }
  const double exposure_s = SummaryNumber(run, "rotodom", "exposure_s");
  if (exposure_s > 0.0) {
    figures.push_back(
        {"motion_blur", MotionWithinFrame(run, exposure_s, "length of the blur vector")});
  }
  return figures;
}

}  // namespace rotslam
