#include "krot/structure/half_spaces.h"

namespace rotslam {

Eigen::VectorXd Packed(const StructureLayout& layout, const MinimaxStructure& structure) {
  Eigen::VectorXd x(layout.size());
  const Eigen::Vector3d origin = structure.center_in_world[0];
  for (int view = 1; view < layout.num_views; ++view) {
    x.segment<3>(layout.Center(view)) = structure.center_in_world[view] - origin;
  }
  for (int i = 0; i < layout.num_points; ++i) {
    x.segment<3>(layout.Point(i)) = structure.point_in_world[i] - origin;
  }
  return x;
}

MinimaxStructure Unpacked(const StructureLayout& layout, const Eigen::VectorXd& x) {
  MinimaxStructure structure;
  structure.center_in_world.assign(layout.num_views, Eigen::Vector3d::Zero());
  for (int view = 1; view < layout.num_views; ++view) {
    structure.center_in_world[view] = x.segment<3>(layout.Center(view));
  }
  structure.point_in_world.reserve(layout.num_points);
  for (int i = 0; i < layout.num_points; ++i) {
    structure.point_in_world.emplace_back(x.segment<3>(layout.Point(i)));
  }
  return structure;
}

}  // namespace rotslam
