#pragma once

#include <vector>

#include "rotodom/sensor_orientations/orientation_pairing.h"
#include "rotodom/sensor_orientations/sensor_types.h"

namespace rotslam {

/// Finds offset and mounting of a sensor as FuseOrientations() says.
/// @return  what differs from zero and identity by no more than chance is estimated, but not taken
///          into account for the other (has_offset, has_mounting).
SensorAlignment AlignSensor(const OrientationPairing& pairing,
                            const std::vector<double>& step_variance,
                            double max_offset_s);

}  // namespace rotslam
