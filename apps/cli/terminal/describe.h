#pragma once

#include <string>
#include <vector>

#include "ba/bundle_adjustment.h"
#include "rotodom/camera/camera.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

/// `20.3 +- 0.2 ms from the top`.
std::string DescribeReadout(const ReadoutEstimate& readout);

/// As a camera file has it: `readout_s: 0.0203, readout_from: top`.
std::string CameraLines(const ReadoutEstimate& readout);

/// "mean error 0.524 px", as MeanErrorPx gives it.
std::string DescribeMeanError(const std::vector<BundleSummary>& bundles);

/// The camera for a person to read: a refined lens is known to five digits at best.
std::string DescribeRounded(Camera camera);

}  // namespace rotslam
