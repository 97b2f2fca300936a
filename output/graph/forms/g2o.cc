// g2o: VERTEX_SE3:QUAT and EDGE_SE3:QUAT lines.

#include "output/graph/rotation_graph_form.h"

namespace rotslam {
namespace {

bool HasG2oTag(const RotationGraphInput& input) {
  if (input.first_words.empty()) return false;
  const std::string& tag = input.first_words.front();
  const bool is_toro = tag == "VERTEX3" || tag == "EDGE3" || tag == "VERTEX2" || tag == "EDGE2";
  return !is_toro && IsGraphTag(tag);
}

RotationList ReadG2oGraph(const RotationGraphInput& input, double sigma_rad) {
  return ReadPoseGraphLines(input, sigma_rad, "g2o");
}

}  // namespace

namespace forms {

RotationGraphForm RotationGraphFormG2o() {
  return {"g2o", "VERTEX_SE3:QUAT, EDGE_SE3:QUAT (and :EULER), FIX", HasG2oTag, ReadG2oGraph};
}

}  // namespace forms
}  // namespace rotslam
