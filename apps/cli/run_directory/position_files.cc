#include "apps/cli/run_directory/position_files.h"

#include <iterator>
#include <utility>

#include "apps/cli/run_directory/map_segments.h"
#include "output/export/known_rotation_file.h"
#include "output/tables/focal_lengths_csv.h"
#include "output/tables/pose_covariance_csv.h"
#include "output/tables/poses_csv.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {
namespace {

// Camera->world poses of all frames of `centers`.
Trajectory MakeTrajectory(const std::vector<double>& timestamps_s,
                          const RotationMap& cam_from_world,
                          const CenterMap& centers) {
  Trajectory trajectory;
  for (const auto& [frame, center] : centers) {
    trajectory.push_back({timestamps_s[frame.value], cam_from_world.at(frame).Inverse(), center});
  }
  return trajectory;
}

std::vector<PoseRow> PoseRows(const Orientations& orientations, const MapResult& positions) {
  std::vector<PoseRow> rows;
  rows.reserve(positions.center_in_world.size());
  for (const auto& [frame, center] : positions.center_in_world) {
    PoseRow& row = rows.emplace_back();
    row.frame = frame.value;
    row.pose = {orientations.timestamps_s[frame.value],
                positions.cam_from_world.at(frame).Inverse(),
                center};
    const FramePose& pose = positions.frame_poses.at(frame);
    row.sigma = pose.position_sigma;
    row.state = pose.state;
    row.component = pose.component;
    row.note = pose.note;
  }
  return rows;
}

}  // namespace

void WritePositions(const std::filesystem::path& directory,
                    const Orientations& orientations,
                    const MapResult& positions,
                    PlyForm form) {
  const Trajectory trajectory = MakeTrajectory(
      orientations.timestamps_s, positions.cam_from_world, positions.center_in_world);
  const std::vector<Segment> segments = SegmentsOf(positions);
  const std::vector<std::string> comments = CommentsOn(segments);
  std::vector<std::string> all_comments = comments;
  for (std::string& comment : CommentsOn(positions.frame_poses)) {
    all_comments.push_back(std::move(comment));
  }
  WriteTumTrajectory(directory / "trajectory_tum.txt", trajectory, all_comments);
  WritePosesCsv(directory / "poses.csv", PoseRows(orientations, positions));
  WriteKittiTrajectory(directory / "trajectory_kitti.txt", trajectory);
  CenterMap keyframe_centers = positions.center_in_world;
  std::erase_if(keyframe_centers,
                [&](const auto& entry) { return !positions.keyframes.contains(entry.first); });
  WriteTumTrajectory(
      directory / "keyframes_tum.txt",
      MakeTrajectory(orientations.timestamps_s, positions.cam_from_world, keyframe_centers),
      comments);
  WritePly(directory / "cloud.ply", MakeCloud(positions.cloud, positions.camera), form);
  std::vector<Frustum> frusta;
  frusta.reserve(keyframe_centers.size());
  const double size = FrustumSize(keyframe_centers);
  for (const auto& [frame, center] : keyframe_centers) {
    frusta.push_back({positions.cam_from_world.at(frame), center, size});
  }
  WriteFrustaPly(directory / "cameras.ply", frusta, positions.camera, form);
  WriteSegments(directory / "segments.csv", segments);
  if (positions.pose_covariance.empty()) return;
  std::vector<PoseCovarianceRow> rows;
  rows.reserve(positions.pose_covariance.size());
  for (const auto& [frame, covariance] : positions.pose_covariance) {
    rows.push_back({frame.value, orientations.timestamps_s[frame.value], covariance});
  }
  WritePoseCovarianceCsv(directory / "pose_covariance.csv", rows);
}

void WriteKnownRotationInput(const std::filesystem::path& directory,
                             const Orientations& orientations,
                             const MapResult& positions,
                             const Camera& camera) {
  KnownRotationInput input;
  input.camera = camera;
  for (const FrameId frame : positions.keyframes) {
    input.cam_from_world[frame] = orientations.cam_from_world.at(frame);
    input.timestamp_s[frame] = orientations.timestamps_s[frame.value];
  }
  input.sigma_rad = OrientationSigmas(orientations);
  input.tracks = positions.keyframe_tracks;
  WriteKnownRotation(directory / "known_rotation.txt", input);
}

void WriteFocalLengths(const std::filesystem::path& directory,
                       const Orientations& orientations,
                       const MapResult& positions,
                       const Camera& taken_out) {
  if (orientations.focal_scales.empty()) return;
  const Camera& camera = positions.camera;
  std::vector<FocalLengthRow> rows;
  for (int k = 0; k < std::ssize(orientations.timestamps_s); ++k) {
    const double scale = ScaleOf(orientations.focal_scales, FrameId{k});
    // Zooms were taken out about the principal point of before.
    const Eigen::Vector2d center = Zoomed(Eigen::Vector2d(camera.cx, camera.cy), taken_out, scale);
    rows.push_back({k,
                    orientations.timestamps_s[k],
                    scale * camera.fx,
                    scale * camera.fy,
                    center.x(),
                    center.y()});
  }
  WriteFocalLengthsCsv(directory / "focal_lengths.csv", rows);
}

}  // namespace rotslam
