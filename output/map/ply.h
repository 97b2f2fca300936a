#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// One point of the map as people look at it.
struct CloudPoint {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  std::array<std::uint8_t, 3> rgb = {128, 128, 128};
  // Unit vector towards the cameras that saw the point, their mean: on a surface it lies within
  // the visible half of the normal, which is what shading and meshing need of a normal.
  Eigen::Vector3d normal_in_world = Eigen::Vector3d::Zero();
  int num_observations = 0;
  double mean_error_px = 0.0;  // mean distance of the keypoints from where the point projects to
};

/// The points of a reconstruction in the order of its tracks. Observations by cameras without a
/// pose are not counted; a point that none of its cameras can project is left out.
/// Throws std::invalid_argument when `camera.Problem()` says so.
std::vector<CloudPoint> MakeCloud(const Reconstruction& reconstruction, const Camera& camera);

enum class PlyForm { kBinary, kAscii };

/// Writes a PLY through PCL, binary little-endian or text: float x y z, uchar red green blue, float
/// nx ny nz, int observations, float error_px. An empty cloud is a valid file. Throws
/// std::runtime_error when the file cannot be written.
void WritePly(const std::filesystem::path& path,
              const std::vector<CloudPoint>& cloud,
              PlyForm form = PlyForm::kBinary);

/// One camera as a pyramid: its centre and the corners of its image at `size` from it.
struct Frustum {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  double size = 1.0;
};

/// Half the median distance between neighbours that do not share a place; 1 without any.
double FrustumSize(const CenterMap& centers);

/// Writes cameras as a PLY mesh, every viewer's way to show lines and faces: five vertices (centre,
/// then the corners clockwise from the top left) and four triangles each, coloured from blue to red
/// in their order. Throws std::invalid_argument when `camera.Problem()`, std::runtime_error when
/// the file cannot be written.
void WriteFrustaPly(const std::filesystem::path& path,
                    const std::vector<Frustum>& frusta,
                    const Camera& camera,
                    PlyForm form = PlyForm::kBinary);

}  // namespace rotslam
