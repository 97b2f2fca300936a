#include "apps/cli/terminal/describe.h"

#include <array>
#include <cstdio>
#include <cstdlib>

#include "apps/slam/map/refinement.h"

namespace rotslam {

std::string DescribeReadout(const ReadoutEstimate& readout) {
  std::array<char, 96> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%.1f +- %.1f ms from the %s",
                1e3 * readout.readout_s,
                1e3 * readout.sigma_s,
                Name(readout.readout_from));
  return text.data();
}

std::string CameraLines(const ReadoutEstimate& readout) {
  std::array<char, 96> text = {};
  std::snprintf(text.data(),
                text.size(),
                "readout_s: %.4f, readout_from: %s",
                readout.readout_s,
                Name(readout.readout_from));
  return text.data();
}

std::string DescribeMeanError(const std::vector<BundleSummary>& bundles) {
  std::array<char, 48> text = {};
  std::snprintf(text.data(), text.size(), "mean error %.3g px", MeanErrorPx(bundles));
  return text.data();
}

std::string DescribeRounded(Camera camera) {
  const auto round = [](double& value) {
    std::array<char, 32> text = {};
    std::snprintf(text.data(), text.size(), "%.5g", value);
    value = std::strtod(text.data(), nullptr);
  };
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) round(*value);
  for (double& coefficient : camera.distortion) round(coefficient);
  return Describe(camera);
}

std::string PercentText(double share) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), share < 0.0995 ? "%.1f %%" : "%.0f %%", 100.0 * share);
  return text.data();
}

}  // namespace rotslam
