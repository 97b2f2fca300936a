// Stands in for paper_rotations.cc in a build without OpenGV (ROTSLAM_WITH_OPENGV=OFF).

#include <stdexcept>

#include "apps/cli/paper/paper_rotations.h"

namespace rotslam {

RunOptions ReadPaperOptions(const CommonFlags&, const InputFlags&) {
  throw std::runtime_error(
      "--method paper: this program was built without OpenGV; configure the build with "
      "-DROTSLAM_WITH_OPENGV=ON");
}

// Not reached: the options come first.
Orientations FindPaperOrientations(
    FrameSource&, const Camera&, const SlamOptions&, const OrientationInputs&, SlamObserver&) {
  return {};
}

}  // namespace rotslam
