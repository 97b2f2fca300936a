#pragma once

#include <string>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/section.h"

namespace rotslam {

/// One camera of a Kalibr chain or an EuRoC `sensor.yaml`, which have the same keys but for one.
/// Throws std::runtime_error with file, line and key.
Camera ReadKalibrCamera(const Section& section);

/// A projection through two spheres or a mirror in place of a pinhole ("omni", "ds", "eucm", "ucm",
/// "MEI"): it is a pinhole where its own parameters are zero. Throws
/// std::runtime_error naming `model` where they are not.
void RequirePinhole(const Section& section,
                    const std::string& key,
                    const std::string& model,
                    const std::vector<double>& own_parameters);

}  // namespace rotslam
