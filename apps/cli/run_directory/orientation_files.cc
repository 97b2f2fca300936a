#include "apps/cli/run_directory/orientation_files.h"

#include <algorithm>

#include "output/graph/g2o.h"
#include "output/tables/loops_csv.h"
#include "output/tables/rotations_csv.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {
namespace {

// Camera->world poses from orientations alone, positions zero.
Trajectory RotationTrajectory(const Orientations& orientations) {
  Trajectory trajectory;
  for (const auto& [frame, cam_from_world] : orientations.cam_from_world) {
    trajectory.push_back({orientations.timestamps_s[frame.value],
                          cam_from_world.Inverse(),
                          Eigen::Vector3d::Zero()});
  }
  return trajectory;
}

// The lines of rotations.csv, see docs/formats.md.
std::vector<RotationRow> RotationRows(const Orientations& orientations) {
  std::vector<RotationRow> rows;
  rows.reserve(orientations.cam_from_world.size());
  for (const auto& [frame, cam_from_world] : orientations.cam_from_world) {
    RotationRow& row = rows.emplace_back();
    row.frame = frame.value;
    row.timestamp_s = orientations.timestamps_s[frame.value];
    row.world_from_cam = cam_from_world.Inverse();
    row.inlier_edges = orientations.inlier_edges.at(frame);
    if (const auto known = orientations.covariance.find(frame);
        known != orientations.covariance.end()) {
      row.sigma_deg = known->second.diagonal().cwiseSqrt() * kDegFromRad;
    }
    const FrameReport& report = orientations.reports[frame.value];
    if (orientations.given) {
      row.flags.emplace_back("given");
    } else if (orientations.graph.EdgesOf(frame).empty()) {
      row.flags.emplace_back("predicted");
    }
    if (report.weak) row.flags.emplace_back("weak");
    if (report.searched_wide) row.flags.emplace_back("searched_wide");
    if (std::binary_search(orientations.breaks.begin(), orientations.breaks.end(), frame)) {
      row.flags.emplace_back("break");
    }
    const auto closes_loop = [f = frame](const LoopCheck& check) {
      return check.accepted && check.frame == f;
    };
    if (std::any_of(orientations.loops.begin(), orientations.loops.end(), closes_loop)) {
      row.flags.emplace_back("loop");
    }
  }
  return rows;
}

// The lines of loops.csv.
std::vector<LoopRow> LoopRows(const Orientations& orientations) {
  std::vector<LoopRow> rows;
  rows.reserve(orientations.loops.size());
  for (const LoopCheck& check : orientations.loops) {
    rows.push_back({check.frame.value,
                    check.match.value,
                    check.score,
                    check.num_inliers,
                    check.angle_deg,
                    check.accepted,
                    check.scaled.turn_scale,
                    check.scaled.angle_deg,
                    check.num_edges});
  }
  return rows;
}

}  // namespace

void WriteOrientations(const std::filesystem::path& directory, const Orientations& orientations) {
  WriteTumTrajectory(directory / "rotations_tum.txt", RotationTrajectory(orientations));
  WriteRotationsCsv(directory / "rotations.csv", RotationRows(orientations));
  WriteLoopsCsv(directory / "loops.csv", LoopRows(orientations));
  WriteG2o(directory / "view_graph.g2o", {orientations.graph, orientations.cam_from_world, {}});
}

}  // namespace rotslam
