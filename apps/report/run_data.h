#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "apps/report/run_check.h"
#include "output/map/run_map.h"
#include "output/tables/loops_csv.h"
#include "output/tables/rotations_csv.h"
#include "output/tables/segments.h"
#include "output/trajectory/metrics.h"
#include "rotodom/types/trajectory.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Ground truth at the times of a run's frames, moved into the run's world.
struct TruthData {
  std::string file;
  std::vector<std::string> notes;  // what was assumed about it, one line each
  // Of rotations_tum.txt and, where there are positions, of trajectory_tum.txt: the figures of
  // `rotslam eval`.
  TrajectoryMetrics rotations;
  std::optional<TrajectoryMetrics> trajectory;
  std::vector<int> frames;  // with ground truth, as indices in RunData::rotations
  // One per entry of `frames`, aligned by the best-fitting rotation.
  std::vector<Rotation> world_from_cam;
  // After the similarity that fits best; empty without positions. The error is in the ground
  // truth's unit.
  std::vector<Eigen::Vector3d> center_in_world;
  std::vector<double> position_error_m;
};

/// The lens of a run as a curve over the distance from the principal point: one entry per point.
struct LensData {
  bool is_estimated = false;            // no calibration was used
  std::vector<double> radius_px;        // where the lens shows a ray
  std::vector<double> displacement_px;  // from where it would show the ray without distortion
  // One standard deviation of the distance; empty where the run does not know it.
  std::vector<double> sigma_px;
  // Pixels at which the calibration that was given, or that lies with the images, shows the same
  // rays; NaN where it does not. Empty: there is none, or the run has not changed it.
  std::vector<double> given_px;
};

/// Contents of a run's folder; files that are missing leave their fields empty.
// The check does not recognise that moving a JSON value is noexcept.
// NOLINTNEXTLINE(bugprone-exception-escape)
struct RunData {
  std::filesystem::path directory;
  nlohmann::ordered_json summary;       // summary.json
  std::vector<RotationRow> rotations;   // rotations.csv, one per frame
  Trajectory poses;                     // trajectory_tum.txt, one per frame; empty without
  std::vector<Segment> segments;        // segments.csv
  std::vector<LoopRow> loops;           // loops.csv
  std::vector<RelativeRotation> edges;  // view_graph.g2o
  std::optional<RunMap> keyframe_map;   // map.bin
  std::optional<RunMap> cloud;          // map_all_frames.bin
  std::optional<TruthData> truth;
  std::optional<LensData> lens;  // camera.yaml, summary.json
  RunCheck check;                // what in the run to trust
  std::string truth_problem;     // why the ground truth beside the images could not be used

  int NumFrames() const { return static_cast<int>(rotations.size()); }
  /// Whether the camera moved: two frames at least have different positions.
  bool HasPositions() const;
};

/// Reads the folder of `run` or `rotations`. Throws std::runtime_error with path and reason where
/// summary.json or rotations.csv is missing, or any file is damaged.
RunData ReadRunData(const std::filesystem::path& run);

/// The ground truth to compare with.
struct TruthSource {
  std::string file;         // empty: the file beside the images, if there is one
  std::string times;        // of a file without times; empty: the `times.txt` beside it
  bool align_axes = false;  // as in MatchOptions
};

/// Sets `run.truth`. Throws std::runtime_error where a file given by the user cannot be used. For a
/// file found beside the images, the reason is written to `truth_problem` instead.
void AddTruth(const TruthSource& source, const MetricsOptions& options, RunData& run);

/// Difference of two orientations of a camera as a rotation vector in camera axes, deg.
Eigen::Vector3d ErrorDeg(const Rotation& world_from_cam, const Rotation& true_world_from_cam);

}  // namespace rotslam
