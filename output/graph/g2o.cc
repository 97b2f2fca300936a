#include "output/graph/g2o.h"

#include <array>
#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Cholesky>

#include "output/files/atomic_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kTranslationInformation = 1e-6;
// Of the rotation vector per that of the quaternion's vector part.
constexpr double kInformationFactor = 4.0;

void Append(std::string& text, double value) { text += ' ' + FormatNumber("%.12g", value); }

void AppendPose(std::string& text, const Eigen::Vector3d& position, const Rotation& rotation) {
  for (const double value : position) Append(text, value);
  for (const double value : rotation.Quaternion().coeffs()) Append(text, value);
}

Eigen::Vector3d CenterOf(const PoseGraph& pose_graph, FrameId view) {
  const auto entry = pose_graph.center_in_world.find(view);
  return entry == pose_graph.center_in_world.end() ? Eigen::Vector3d::Zero().eval() : entry->second;
}

Matrix6d InformationOf(const RelativeRotation& edge) {
  const Eigen::LLT<Eigen::Matrix3d> cholesky(edge.covariance);
  if (!edge.covariance.allFinite() || cholesky.info() != Eigen::Success) {
    throw std::invalid_argument("WriteG2o: the covariance of edge " + std::to_string(edge.i.value) +
                                "-" + std::to_string(edge.j.value) + " is not positive definite");
  }
  Matrix6d information = Matrix6d::Zero();
  information.topLeftCorner<3, 3>().diagonal().setConstant(kTranslationInformation);
  information.bottomRightCorner<3, 3>() =
      kInformationFactor * cholesky.solve(Eigen::Matrix3d::Identity());
  return information;
}

std::array<double, 7> PoseAt(const std::filesystem::path& path,
                             const TextRow& row,
                             std::size_t first) {
  std::array<double, 7> pose;
  for (std::size_t k = 0; k < pose.size(); ++k) pose[k] = NumberAt(path, row, first + k);
  return pose;
}

Rotation RotationIn(const std::array<double, 7>& pose) {
  return Rotation(Eigen::Quaterniond(pose[6], pose[3], pose[4], pose[5]));
}

FrameId IdAt(const std::filesystem::path& path, const TextRow& row, std::size_t position) {
  const double value = NumberAt(path, row, position);
  if (value < 0.0 || value > 1e9 || value != std::floor(value)) {
    throw std::runtime_error(
        AtLine(path, row.line, "expected a vertex id, found \"" + row.words[position] + "\""));
  }
  return FrameId{static_cast<int>(value)};
}

Eigen::Matrix3d CovarianceAt(const std::filesystem::path& path,
                             const TextRow& row,
                             std::size_t first) {
  Matrix6d information;
  std::size_t position = first;
  for (int r = 0; r < 6; ++r) {
    for (int c = r; c < 6; ++c) {
      information(r, c) = information(c, r) = NumberAt(path, row, position++);
    }
  }
  const Eigen::Matrix3d rotation_block = information.bottomRightCorner<3, 3>();
  const Eigen::LLT<Eigen::Matrix3d> cholesky(rotation_block);
  if (cholesky.info() != Eigen::Success) {
    throw std::runtime_error(
        AtLine(path, row.line, "the information of the rotation is not positive definite"));
  }
  return kInformationFactor * cholesky.solve(Eigen::Matrix3d::Identity());
}

}  // namespace

void WriteG2o(const std::filesystem::path& path, const PoseGraph& pose_graph) {
  std::string text;
  for (const auto& [view, cam_from_world] : pose_graph.cam_from_world) {
    text += "VERTEX_SE3:QUAT " + std::to_string(view.value);
    AppendPose(text, CenterOf(pose_graph, view), cam_from_world.Inverse());
    text += '\n';
  }
  for (const RelativeRotation& edge : pose_graph.graph.edges()) {
    const auto cam_i = pose_graph.cam_from_world.find(edge.i);
    const auto cam_j = pose_graph.cam_from_world.find(edge.j);
    if (cam_i == pose_graph.cam_from_world.end() || cam_j == pose_graph.cam_from_world.end()) {
      continue;
    }
    const Eigen::Vector3d cam_j_in_cam_i =
        cam_i->second * (CenterOf(pose_graph, edge.j) - CenterOf(pose_graph, edge.i));
    text += "EDGE_SE3:QUAT " + std::to_string(edge.i.value) + ' ' + std::to_string(edge.j.value);
    AppendPose(text, cam_j_in_cam_i, edge.j_from_i.Inverse());
    const Matrix6d information = InformationOf(edge);
    for (int r = 0; r < 6; ++r) {
      for (int c = r; c < 6; ++c) Append(text, information(r, c));
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

PoseGraph ReadG2o(const std::filesystem::path& path) {
  PoseGraph pose_graph;
  for (const TextRow& row : ReadTextRows(path)) {
    try {
      if (row.words.front() == "VERTEX_SE3:QUAT") {
        const FrameId view = IdAt(path, row, 1);
        const std::array<double, 7> pose = PoseAt(path, row, 2);
        pose_graph.cam_from_world[view] = RotationIn(pose).Inverse();
        pose_graph.center_in_world[view] = Eigen::Vector3d(pose[0], pose[1], pose[2]);
      } else if (row.words.front() == "EDGE_SE3:QUAT") {
        RelativeRotation edge;
        edge.i = IdAt(path, row, 1);
        edge.j = IdAt(path, row, 2);
        edge.j_from_i = RotationIn(PoseAt(path, row, 3)).Inverse();
        edge.covariance = CovarianceAt(path, row, 10);
        pose_graph.graph.AddEdge(edge);
      }
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(AtLine(path, row.line, error.what()));
    }
  }
  if (pose_graph.cam_from_world.empty() && pose_graph.graph.edges().empty()) {
    throw std::runtime_error(path.string() +
                             ": has neither VERTEX_SE3:QUAT nor EDGE_SE3:QUAT lines");
  }
  return pose_graph;
}

}  // namespace rotslam
