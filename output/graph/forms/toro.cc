// TORO: VERTEX3 and EDGE3 lines, angles in place of quaternions.

#include "output/graph/rotation_graph_form.h"

namespace rotslam {
namespace {

bool HasToroTag(const RotationGraphInput& input) {
  if (input.first_words.empty()) return false;
  const std::string& tag = input.first_words.front();
  return tag == "VERTEX3" || tag == "EDGE3" || tag == "VERTEX2" || tag == "EDGE2";
}

RotationList ReadToroGraph(const RotationGraphInput& input, double sigma_rad) {
  return ReadPoseGraphLines(input, sigma_rad, "TORO");
}

}  // namespace

namespace forms {

RotationGraphForm RotationGraphFormToro() {
  return {"TORO", "VERTEX3 and EDGE3 with roll pitch yaw", HasToroTag, ReadToroGraph};
}

}  // namespace forms
}  // namespace rotslam
