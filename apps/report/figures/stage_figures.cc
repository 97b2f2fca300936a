#include "apps/report/figures/stage_figures.h"

#include <cmath>
#include <string>

#include "apps/report/figures/map_figures.h"
#include "apps/report/figures/panel.h"
#include "apps/report/figures/rotation_figures.h"
#include "apps/report/run_summary.h"

namespace rotslam {
namespace {

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
  return PanelPage(panel, {{name, lengths, kFirstColor}});
}

// The lens' distortion over the image's radius, with a band of one standard deviation.
Drawing LensFigure(const LensData& lens) {
  const Panel panel = {"distance from the principal point, px", "distortion, px"};
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
  std::vector<Series> series = {
      {lens.is_estimated ? "by the images" : "as used", curve, kFirstColor}};
  if (!given.empty()) series.push_back({"calibration", given, kSecondColor});
  return PanelPage(panel, series, {band, "one standard deviation"});
}

}  // namespace

std::vector<Figure> MakeStageFigures(const RunData& run) {
  std::vector<Figure> figures;
  AddRotationFigures(run, figures);
  if (run.lens && !run.lens->radius_px.empty()) figures.push_back({"lens", LensFigure(*run.lens)});
  AddMapFigures(run, figures);
  const double readout_s = SummaryNumber(run.summary, "camera", "readout_s");
  if (readout_s > 0.0) {
    figures.push_back(
        {"rolling_shutter",
         MotionWithinFrame(run, readout_s, "motion of the image during its readout")});
  }
  const double exposure_s = SummaryNumber(run.summary, "rotodom", "exposure_s");
  if (exposure_s > 0.0) {
    figures.push_back(
        {"motion_blur", MotionWithinFrame(run, exposure_s, "length of the blur vector")});
  }
  return figures;
}

}  // namespace rotslam
