#include "apps/cli/run_directory/orientation_files.h"

#include <algorithm>

#include "output/graph/g2o.h"
#include "output/tables/loops_csv.h"
#include "output/tables/rotations_csv.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/averaging/closure.h"

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

// Flags that say where an orientation comes from.
void AddSource(const Orientations& orientations, FrameId frame, std::vector<std::string>& flags) {
  const bool is_given = orientations.given && orientations.given->CountsFor(frame);
  const bool is_matched = !orientations.graph.EdgesOf(frame).empty();
  if (orientations.given && is_matched) flags.emplace_back("images");
  if (is_given) flags.emplace_back("given");
  if (!is_given && !is_matched) flags.emplace_back("predicted");
}

// The lines of rotations.csv, see docs/formats.md.
std::vector<RotationRow> RotationRows(const Orientations& orientations, double closure_variance) {
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
      // With given orientations they contain it already.
      const double variance = orientations.given ? 1.0 : closure_variance;
      row.sigma_deg = (variance * known->second.diagonal()).cwiseSqrt() * kDegFromRad;
    }
    const FrameReport& report = orientations.reports[frame.value];
    AddSource(orientations, frame, row.flags);
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

// The view-graph with the covariances that its edges' errors have.
ViewGraph WithErrors(const ViewGraph& graph, double variance) {
  ViewGraph with_errors;
  for (RelativeRotation edge : graph.edges()) {
    edge.covariance *= variance;
    with_errors.AddEdge(edge);
  }
  return with_errors;
}

}  // namespace

void WriteOrientations(const std::filesystem::path& directory,
                       const Orientations& orientations,
                       const AveragingOptions& averaging) {
  const double closure_variance = ClosureVariance(orientations.graph);
  const double edge_variance =
      averaging.edge_error_factor * averaging.edge_error_factor * closure_variance;
  WriteTumTrajectory(directory / "rotations_tum.txt", RotationTrajectory(orientations));
  WriteRotationsCsv(directory / "rotations.csv", RotationRows(orientations, closure_variance));
  WriteLoopsCsv(directory / "loops.csv", LoopRows(orientations));
  WriteG2o(directory / "view_graph.g2o",
           {WithErrors(orientations.graph, edge_variance), orientations.cam_from_world, {}});
}

void WriteCommonMask(const std::filesystem::path& directory, const FrameMasks& masks) {
  if (!masks.common().IsEmpty()) WriteMask(directory / "mask.png", masks.common());
}

}  // namespace rotslam
