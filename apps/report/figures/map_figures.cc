#include "apps/report/figures/map_figures.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "apps/report/figures/panel.h"
#include "apps/report/run_summary.h"

namespace rotslam {
namespace {

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
  const double scale = (kStageWidth - 24.0) / camera.width;
  const double bottom = kPanelHead + scale * camera.height;
  Drawing drawing(kStageWidth, bottom + 12.0);
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
                        kPanelHead + scale * observation.keypoint_px.y());
      if (observation.frame.value == shown) dots.push_back(path.back());
    }
    if (path.size() > 1) drawing.AddLine(std::move(path), {kFirstColor, 0.7});
  }
  drawing.AddDots(std::move(dots), 2.4, kSecondColor);
  const double right = kStageWidth - 12.0;
  drawing.AddLine({{12.0, kPanelHead},
                   {right, kPanelHead},
                   {right, bottom},
                   {12.0, bottom},
                   {12.0, kPanelHead}},
                  {kInk, 0.7});
  return drawing;
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
  return PanelPage(panel,
                   {{"points of the last keyframe that are still seen", shares, kFirstColor},
                    {"next keyframe", keyframes, kSecondColor, 4.0}});
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
  const double reach = QuantileOf(SizesOf(residuals), 0.99);
  PlotPoints shown;
  for (const Eigen::Vector2d& residual : residuals) {
    if (residual.lpNorm<Eigen::Infinity>() <= reach) shown.push_back(residual);
  }
  Panel panel = {"across, px", "down, px"};
  panel.height = 260.0;
  panel.equal_scale = true;
  return PanelPage(panel, {{"residuals of observations; 99 % of them", shown, kFirstColor, 1.4}});
}

// The bracket of the least possible largest residual, and the residuals after bundle adjustment.
Drawing KnownRotationFigure(const PlotPoints& residuals, const std::array<double, 2>& bracket_px) {
  Panel panel = {"residual, px", "share"};
  panel.shaded.push_back(bracket_px);
  return PanelPage(panel,
                   {{"observations below, after bundle adjustment",
                     Distribution(SizesOf(residuals), 1.15 * bracket_px[1]),
                     kFirstColor},
                    {"bracket of the largest residual",
                     {{bracket_px[0], 0.0}, {bracket_px[0], 1.0}},
                     kSecondColor},
                    {"", {{bracket_px[1], 0.0}, {bracket_px[1], 1.0}}, kSecondColor}});
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
  return PanelPage(panel,
                   {{"trajectory_tum.txt against rotations_tum.txt", angles, kFirstColor},
                    {"keyframe", keyframes, kSecondColor, 4.0}});
}

}  // namespace

void AddMapFigures(const RunData& run, std::vector<Figure>& figures) {
  if (run.cloud && !run.cloud->tracks.empty()) {
    // A BAL file does not say how large its images are; the figure needs their size.
    if (run.cloud->camera.width > 0) figures.push_back({"tracks", TracksFigure(run)});
    figures.push_back({"keyframes", KeyframesFigure(run)});
    if (run.HasPositions()) figures.push_back({"registration", RegistrationFigure(run)});
  }
  if (!run.keyframe_map) return;
  const PlotPoints residuals = Residuals(*run.keyframe_map);
  if (residuals.empty()) return;
  const double high_px = SummaryNumber(run.summary, "krot", "gamma_high_px");
  if (high_px > 0.0) {
    const double low_px = SummaryNumber(run.summary, "krot", "gamma_low_px");
    figures.push_back({"known_rotation", KnownRotationFigure(residuals, {low_px, high_px})});
  }
  figures.push_back({"residuals", ResidualsFigure(residuals)});
}

}  // namespace rotslam
