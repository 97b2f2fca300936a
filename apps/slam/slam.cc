#include "apps/slam/slam.h"

#include <stdexcept>

namespace rotslam {

SlamResult RunSlam(FrameSource& frames,
                   const Camera& camera,
                   const SlamOptions& given_options,
                   SlamObserver& observer,
                   const SlamInputs& inputs) {
  if (const auto problem = given_options.Problem()) {
    throw std::invalid_argument("SlamOptions: " + *problem);
  }
  SlamOptions options = given_options;
  SlamResult result;
  Camera found = camera;
  if (inputs.find_focal_length) {
    FreeFocalLength(options.ba.lens);
    result.focal_length = FindFocalLength(frames, camera, options, observer);
    found = result.focal_length->camera;
  }
  result.orientations = FindOrientations(frames, found, options, inputs, observer);
  if (result.orientations.interrupted) return result;
  result.map = BuildMap(result.orientations, options, &frames, observer);
  return result;
}

SlamResult RunSlam(FrameSource& frames, const Camera& camera, const SlamOptions& options) {
  SlamObserver nobody;
  return RunSlam(frames, camera, options, nobody);
}

}  // namespace rotslam
