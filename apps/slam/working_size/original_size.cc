#include "apps/slam/working_size/original_size.h"

#include <utility>

namespace rotslam {
namespace {

void Scale(double factor, std::vector<Track>& tracks) {
  for (Track& track : tracks) {
    for (Observation& observation : track.observations) {
      observation.keypoint_px = ((observation.keypoint_px.array() + 0.5) * factor - 0.5).matrix();
      observation.sigma_px *= factor;
    }
  }
}

void Scale(double factor, ResidualStatistics& residuals) {
  residuals.mean_px *= factor;
  residuals.rms_px *= factor;
  residuals.median_px *= factor;
  residuals.p90_px *= factor;
}

}  // namespace

void ToOriginalSize(const WorkingSize& working, double level_scale, Features& features) {
  if (!working.IsReduced()) return;
  const double factor = 1.0 / working.scale();
  for (Eigen::Vector2d& keypoint_px : features.keypoints_px) {
    keypoint_px = ((keypoint_px.array() + 0.5) * factor - 0.5).matrix();
  }
  for (Eigen::Matrix2f& covariance : features.covariances_px) {
    covariance *= static_cast<float>(factor * factor);
  }
  for (int& level : features.levels) level += working.NumLevelsBelow(level_scale);
  features.shared_error_px *= factor;
}

void ToOriginalSize(const WorkingSize& working, std::vector<Track>& tracks) {
  if (working.IsReduced()) Scale(1.0 / working.scale(), tracks);
}

void ToWorkingSize(const WorkingSize& working, std::vector<Track>& tracks) {
  if (working.IsReduced()) Scale(working.scale(), tracks);
}

void ToOriginalSize(const WorkingSize& working, ViewGraph& graph) {
  if (!working.IsReduced()) return;
  ViewGraph original;
  for (RelativeRotation edge : graph.edges()) {
    edge.noise_px /= working.scale();
    edge.parallax_px /= working.scale();
    original.AddEdge(std::move(edge));
  }
  graph = std::move(original);
}

void ToOriginalSize(const WorkingSize& working, ReadoutEstimate& readout) {
  readout.shear_px /= working.scale();
  readout.noise_px /= working.scale();
}

void ToOriginalSize(const WorkingSize& working, BundleSummary& bundle) {
  const double factor = 1.0 / working.scale();
  Scale(factor, bundle.before);
  Scale(factor, bundle.after);
  if (bundle.lens_sigmas) ToOriginalSize(working, *bundle.lens_sigmas);
}

void ToOriginalSize(const WorkingSize& working, LensSigmas& sigmas) {
  const double factor = 1.0 / working.scale();
  sigmas.focal_px *= factor;
  sigmas.cx_px *= factor;
  sigmas.cy_px *= factor;
}

}  // namespace rotslam
