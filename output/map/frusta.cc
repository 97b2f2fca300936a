#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"
#include "output/map/ply.h"
#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

constexpr int kNumVertices = 5;
constexpr std::array<std::array<int, 3>, 4> kTriangles = {
    {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}}};

// Directions of the image's corners, clockwise from the top left; unit, in the camera frame.
std::array<Eigen::Vector3d, 4> CornerBearings(const Camera& camera) {
  const double right = camera.width - 0.5;
  const double bottom = camera.height - 0.5;
  const std::array<Eigen::Vector2d, 4> corners_px = {
      {{-0.5, -0.5}, {right, -0.5}, {right, bottom}, {-0.5, bottom}}};
  std::array<Eigen::Vector3d, 4> bearings;
  for (std::size_t k = 0; k < bearings.size(); ++k) {
    const Eigen::Vector2d& corner = corners_px[k];
    const Eigen::Vector3d pinhole(
        (corner.x() - camera.cx) / camera.fx, (corner.y() - camera.cy) / camera.fy, 1.0);
    // A lens whose polynomial does not reach the corner: without distortion it is near enough.
    bearings[k] = camera.Unproject(corner).value_or(pinhole.normalized());
  }
  return bearings;
}

std::array<std::uint8_t, 3> Colour(std::size_t k, std::size_t count) {
  const double share = count < 2 ? 0.0 : static_cast<double>(k) / static_cast<double>(count - 1);
  const auto red = static_cast<std::uint8_t>(std::lround(255.0 * share));
  return {red, 64, static_cast<std::uint8_t>(255 - red)};
}

std::string Header(std::size_t count, PlyForm form) {
  return std::string("ply\nformat ") +
         (form == PlyForm::kAscii ? "ascii" : "binary_little_endian") + " 1.0\nelement vertex " +
         std::to_string(kNumVertices * count) +
         "\nproperty float x\nproperty float y\nproperty float z\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face " +
         std::to_string(kTriangles.size() * count) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
}

struct Vertex {
  Eigen::Vector3f position;
  std::array<std::uint8_t, 3> rgb;
};

std::string BinaryBody(const std::vector<Vertex>& vertices) {
  BinaryWriter writer;
  for (const Vertex& vertex : vertices) {
    for (const float value : vertex.position) writer.Put(value);
    for (const std::uint8_t value : vertex.rgb) writer.Put(value);
  }
  for (std::size_t first = 0; first < vertices.size(); first += kNumVertices) {
    for (const auto& triangle : kTriangles) {
      writer.Put(std::uint8_t{3});
      for (const int corner : triangle) writer.Put(static_cast<std::int32_t>(first) + corner);
    }
  }
  return writer.bytes();
}

std::string TextBody(const std::vector<Vertex>& vertices) {
  std::string text;
  for (const Vertex& vertex : vertices) {
    for (const float value : vertex.position) text += FormatNumber("%.9g ", value);
    text += std::to_string(vertex.rgb[0]) + " " + std::to_string(vertex.rgb[1]) + " " +
            std::to_string(vertex.rgb[2]) + "\n";
  }
  for (std::size_t first = 0; first < vertices.size(); first += kNumVertices) {
    for (const auto& triangle : kTriangles) {
      text += "3";
      for (const int corner : triangle) text += " " + std::to_string(first + corner);
      text += "\n";
    }
  }
  return text;
}

}  // namespace

double FrustumSize(const CenterMap& centers) {
  std::vector<double> steps;
  const Eigen::Vector3d* before = nullptr;
  for (const auto& [frame, center] : centers) {
    const double step = before == nullptr ? 0.0 : (center - *before).norm();
    if (step > 0.0) steps.push_back(step);
    before = &center;
  }
  return 0.5 * Median(std::move(steps), 2.0);
}

void WriteFrustaPly(const std::filesystem::path& path,
                    const std::vector<Frustum>& frusta,
                    const Camera& camera,
                    PlyForm form) {
  if (const auto problem = camera.Problem()) {
    throw std::invalid_argument("WriteFrustaPly: camera: " + *problem);
  }
  const std::array<Eigen::Vector3d, 4> bearings = CornerBearings(camera);
  std::vector<Vertex> vertices;
  vertices.reserve(kNumVertices * frusta.size());
  for (std::size_t k = 0; k < frusta.size(); ++k) {
    const Frustum& frustum = frusta[k];
    const std::array<std::uint8_t, 3> rgb = Colour(k, frusta.size());
    vertices.push_back({frustum.center_in_world.cast<float>(), rgb});
    for (const Eigen::Vector3d& bearing : bearings) {
      const Eigen::Vector3d corner =
          frustum.center_in_world + frustum.size * (frustum.cam_from_world.Inverse() * bearing);
      vertices.push_back({corner.cast<float>(), rgb});
    }
  }
  ReplaceFile(path,
              Header(frusta.size(), form) +
                  (form == PlyForm::kAscii ? TextBody(vertices) : BinaryBody(vertices)));
}

}  // namespace rotslam
