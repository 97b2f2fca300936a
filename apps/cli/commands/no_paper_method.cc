// Stands in for paper_rotations.cc in a build without OpenGV (ROTSLAM_WITH_OPENGV=OFF).

#include <stdexcept>

#include "apps/cli/commands/paper_rotations.h"

namespace rotslam {

RunOptions PaperRunOptions() {
  throw std::runtime_error(
      "--method paper: this program was built without OpenGV; configure the build with "
      "-DROTSLAM_WITH_OPENGV=ON");
}

Orientations FindPaperOrientations(TrackedInput&, const OrientationInputs&) {
  PaperRunOptions();  // throws
  return {};
}

}  // namespace rotslam
