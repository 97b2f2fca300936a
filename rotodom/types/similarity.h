#pragma once

#include <Eigen/Core>

#include "rotodom/types/rotation.h"

namespace rotslam {

/// A transform to a world that may differ in scale: x_new = scale * turn * x_old + shift.
struct Similarity {
  double scale = 1.0;
  Rotation turn;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();

  /// A point or a centre in the new world.
  Eigen::Vector3d Move(const Eigen::Vector3d& position) const {
    return scale * (turn * position) + shift;
  }
  /// An orientation in the new world.
  Rotation Move(const Rotation& cam_from_world) const { return cam_from_world * turn.Inverse(); }

  Similarity Inverse() const {
    const Rotation back = turn.Inverse();
    return {1.0 / scale, back, -(back * shift) / scale};
  }
  /// First `other`, then this one.
  Similarity operator*(const Similarity& other) const {
    return {scale * other.scale, turn * other.turn, Move(other.shift)};
  }
};

}  // namespace rotslam
