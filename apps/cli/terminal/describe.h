#pragma once

#include <string>
#include <vector>

#include "ba/bundle_adjustment.h"
#include "rotodom/camera/camera.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

/// A share of 0 to 1 as "12 %", "0.4 %".
std::string PercentText(double share);

/// `20.3 +- 0.2 ms from the top`.
std::string DescribeReadout(const ReadoutEstimate& readout);

/// The keys of a camera file: `readout_s: 0.0203, readout_from: top`.
std::string CameraLines(const ReadoutEstimate& readout);

/// "mean error 0.524 px", as MeanErrorPx gives it.
std::string DescribeMeanError(const std::vector<BundleSummary>& bundles);

/// Description of a camera with five digits, the accuracy of a refined lens at best.
std::string DescribeRounded(Camera camera);

}  // namespace rotslam
