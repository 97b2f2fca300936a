#include "apps/report/run_data.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "apps/report/run_summary.h"
#include "output/graph/g2o.h"
#include "output/tables/lens_curve.h"
#include "output/trajectory/trajectory.h"
#include "output/trajectory/trajectory_match.h"
#include "rotodom/camera/camera_file.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// One pose per row of rotations.csv, or none at all.
Trajectory ReadPoses(const fs::path& path, const std::vector<RotationRow>& rotations) {
  Trajectory poses = ReadTrajectory(path);
  if (poses.size() != rotations.size()) {
    throw std::runtime_error(path.string() + ": has " + std::to_string(poses.size()) +
                             " poses, rotations.csv beside it " + std::to_string(rotations.size()) +
                             "; run the sequence again");
  }
  return poses;
}

Trajectory RotationsOnly(const std::vector<RotationRow>& rows) {
  Trajectory poses;
  poses.reserve(rows.size());
  for (const RotationRow& row : rows) {
    poses.push_back({row.timestamp_s, row.world_from_cam, Eigen::Vector3d::Zero()});
  }
  return poses;
}

// KITTI's poses carry no times: those that lie beside them, else the numbers of the frames.
TrajectoryFile ReadTruth(const TruthSource& source, const fs::path& file) {
  if (!source.times.empty()) return ReadTrajectoryFile(file, source.times);
  return ReadTrajectoryFile(file, TimesBeside(file));
}

// The place of each pair's estimate among the frames; both ascend in time.
std::vector<int> PlacesOf(const std::vector<PosePair>& pairs, const Trajectory& estimate) {
  std::vector<int> places;
  places.reserve(pairs.size());
  int place = 0;
  for (const PosePair& pair : pairs) {
    while (estimate[place].timestamp_s != pair.estimate.timestamp_s) ++place;
    places.push_back(place++);
  }
  return places;
}

void AddPositionsOfTruth(const std::vector<PosePair>& pairs, TruthData& truth) {
  if (!truth.trajectory || !truth.trajectory->scale) return;
  const auto num_pairs = static_cast<Eigen::Index>(pairs.size());
  Eigen::Matrix3Xd estimate(3, num_pairs);
  Eigen::Matrix3Xd actual(3, num_pairs);
  for (Eigen::Index k = 0; k < num_pairs; ++k) {
    estimate.col(k) = pairs[k].estimate.center_in_world;
    actual.col(k) = pairs[k].ground_truth.center_in_world;
  }
  const Eigen::Matrix4d truth_from_estimate = Eigen::umeyama(estimate, actual, true);
  const Eigen::Matrix4d estimate_from_truth = truth_from_estimate.inverse();
  for (Eigen::Index k = 0; k < num_pairs; ++k) {
    const Eigen::Vector3d moved = (truth_from_estimate * estimate.col(k).homogeneous()).head<3>();
    truth.position_error_m.push_back((moved - actual.col(k)).norm());
    truth.center_in_world.emplace_back(
        (estimate_from_truth * actual.col(k).homogeneous()).head<3>());
  }
}

// The rotation between the two worlds with the least sum of squared chordal distances.
Rotation BestRotation(const std::vector<PosePair>& pairs) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const PosePair& pair : pairs) {
    sum += pair.estimate.world_from_cam.Matrix() *
           pair.ground_truth.world_from_cam.Matrix().transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return Rotation::FromMatrix(svd.matrixU() * sign * svd.matrixV().transpose());
}

TruthData CompareWith(const TruthSource& source,
                      const fs::path& file,
                      const MetricsOptions& options,
                      const RunData& run) {
  const Trajectory orientations = RotationsOnly(run.rotations);
  MatchOptions matching;
  matching.metrics = options;
  matching.align_axes = source.align_axes;
  matching.is_estimate_known = true;
  const MatchedTrajectories matched =
      MatchTrajectories({ReadTruth(source, file), file.string()},
                        {{orientations, "rotations.csv", {}, true, false}, "the run"},
                        matching);
  const Trajectory& ground_truth = matched.ground_truth;
  const std::vector<PosePair>& pairs = matched.pairs;
  TruthData truth;
  truth.file = file.string();
  truth.notes = matched.notes;
  truth.rotations = ComputeMetrics(pairs, options);
  truth.frames = PlacesOf(pairs, orientations);
  const Rotation estimate_from_truth = BestRotation(pairs);
  truth.world_from_cam.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    truth.world_from_cam.push_back(estimate_from_truth * pair.ground_truth.world_from_cam);
  }
  if (run.poses.empty()) return truth;
  const std::vector<PosePair> pose_pairs = AssociatePoses(ground_truth, run.poses, options);
  if (pose_pairs.size() != pairs.size()) return truth;
  truth.trajectory = ComputeMetrics(pose_pairs, options);
  AddPositionsOfTruth(pose_pairs, truth);
  return truth;
}

std::optional<fs::path> TruthBesideImages(const RunData& run) {
  const auto sequence = run.summary.at("sequence");
  if (!sequence.contains("path") || !fs::exists(sequence.at("path").get<std::string>())) {
    return std::nullopt;
  }
  return OpenSequence(sequence.at("path").get<std::string>(), SequenceOptionsOf(run.summary))
      ->GroundTruthFile();
}

// A camera as summary.json has it; nullopt: none, or not one of ours.
std::optional<Camera> CameraOf(const nlohmann::ordered_json& json) {
  if (!json.is_object()) return std::nullopt;
  const auto number = [&](const char* key) {
    const auto value = json.find(key);
    return value != json.end() && value->is_number() ? value->get<double>() : 0.0;
  };
  const auto name = json.find("model");
  const auto model = name != json.end() && name->is_string()
                         ? FindCameraModel(name->get<std::string>())
                         : std::nullopt;
  if (!model) return std::nullopt;
  Camera camera;
  camera.model = *model;
  camera.fx = number("fx");
  camera.fy = number("fy");
  camera.cx = number("cx");
  camera.cy = number("cy");
  if (const auto list = json.find("distortion"); list != json.end() && list->is_array()) {
    for (std::size_t k = 0; k < std::min(list->size(), camera.distortion.size()); ++k) {
      if ((*list)[k].is_number()) camera.distortion[k] = (*list)[k].get<double>();
    }
  }
  return camera;
}

// The calibration of images of that size: the one that the run was given, else the one that lies
// with the images.
std::optional<Camera> GivenCamera(const RunData& run, bool is_estimated, const Camera& size) {
  if (!is_estimated) return CameraOf(run.summary.at("camera"));
  const auto sequence = run.summary.at("sequence");
  if (!sequence.contains("path") || !fs::exists(sequence.at("path").get<std::string>())) {
    return std::nullopt;
  }
  const auto images =
      OpenSequence(sequence.at("path").get<std::string>(), SequenceOptionsOf(run.summary));
  if (!images->camera_reference()) return images->own_camera();
  const CameraReference& reference = *images->camera_reference();
  return AtSize(ChooseCamera(ReadCameraFile(reference.file), reference, images->image_folder()),
                size.width,
                size.height);
}

// The deviations of the curve's points as the summary has them, for `curve`.
std::vector<double> CurveSigmas(const nlohmann::ordered_json& summary,
                                const std::vector<LensCurvePoint>& curve) {
  const auto path = nlohmann::ordered_json::json_pointer("/ba/lens/sigma_radius_px");
  if (!summary.contains(path) || !summary.at(path).is_object()) return {};
  const nlohmann::ordered_json& steps = summary.at(path);
  std::vector<double> known = {0.0};
  for (int step = 1; steps.contains(std::to_string(step)); ++step) {
    const auto& value = steps.at(std::to_string(step));
    if (!value.is_number()) return {};
    known.push_back(value.get<double>());
  }
  std::vector<double> sigmas;
  for (const LensCurvePoint& point : curve) {
    const double place = kLensCurveSteps * point.radius_px / curve.back().radius_px;
    const auto before = static_cast<std::size_t>(place);
    if (before >= known.size()) return {};
    const double next = known[std::min(before + 1, known.size() - 1)];
    sigmas.push_back(known[before] +
                     (place - static_cast<double>(before)) * (next - known[before]));
  }
  return sigmas;
}

// Where a lens without distortion shows a ray.
double UndistortedRadius(const Camera& camera, double angle_rad) {
  return camera.fx * (camera.model == CameraModel::kEquidistant ? angle_rad : std::tan(angle_rad));
}

// Whether no calibration was used; one that a pure rotation has refuted was.
bool IsLensEstimated(const nlohmann::ordered_json& summary) {
  const auto path = nlohmann::ordered_json::json_pointer("/calibration/source");
  return summary.contains(path) && (summary.at(path) == "images" || summary.at(path) == "guess");
}

bool HaveSameLens(const Camera& a, const Camera& b) {
  return a.model == b.model && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.distortion == b.distortion;
}

LensData LensCurvesOf(const RunData& run, const Camera& camera) {
  constexpr int kSteps = 8 * kLensCurveSteps;
  LensData lens;
  lens.is_estimated = IsLensEstimated(run.summary);
  const std::vector<LensCurvePoint> curve = LensCurve(camera, CurveCovariance::Zero(), kSteps);
  for (const LensCurvePoint& point : curve) {
    lens.radius_px.push_back(point.radius_px);
    lens.displacement_px.push_back(point.radius_px - UndistortedRadius(camera, point.angle_rad));
  }
  if (curve.size() == kSteps) lens.sigma_px = CurveSigmas(run.summary, curve);
  std::optional<Camera> given;
  try {
    given = GivenCamera(run, lens.is_estimated, camera);
  } catch (const std::exception&) {
    // A calibration that cannot be read is not drawn.
    return lens;
  }
  if (!given || !(given->fx > 0.0) || HaveSameLens(*given, camera)) return lens;
  for (const LensCurvePoint& point : curve) {
    const auto radius_px = LensRadius(*given, point.angle_rad);
    lens.given_px.push_back(radius_px ? *radius_px - UndistortedRadius(camera, point.angle_rad)
                                      : std::nan(""));
  }
  return lens;
}

}  // namespace

bool RunData::HasPositions() const {
  for (const StampedPose& pose : poses) {
    if (pose.center_in_world != poses.front().center_in_world) return true;
  }
  return false;
}

RunData ReadRunData(const fs::path& run) {
  RunData data;
  data.directory = run;
  data.summary = ReadSummaryOf(run);
  data.rotations = ReadRotationsCsv(run / "rotations.csv");
  if (data.rotations.empty()) {
    throw std::runtime_error((run / "rotations.csv").string() +
                             ": has no frames; run the sequence again");
  }
  const auto is_there = [&](const char* name) { return fs::exists(run / name); };
  data.check = CheckRun(run);
  if (is_there("loops.csv")) data.loops = ReadLoopsCsv(run / "loops.csv");
  if (is_there("view_graph.g2o")) data.edges = ReadG2o(run / "view_graph.g2o").graph.edges();
  // Other files in the folder are then from an older run.
  if (data.summary.value("command", "") == "rotations" ||
      data.summary.value("interrupted", false)) {
    return data;
  }
  if (is_there("trajectory_tum.txt")) {
    data.poses = ReadPoses(run / "trajectory_tum.txt", data.rotations);
  }
  if (is_there("segments.csv")) data.segments = ReadSegmentsCsv(run / "segments.csv");
  if (is_there("camera.yaml")) {
    data.lens = LensCurvesOf(data, ReadCamera(run / "camera.yaml"));
  }
  if (is_there("map.bin")) data.keyframe_map = ReadRunMap(run / "map.bin");
  if (is_there("map_all_frames.bin")) data.cloud = ReadRunMap(run / "map_all_frames.bin");
  return data;
}

void AddTruth(const TruthSource& source, const MetricsOptions& options, RunData& run) {
  if (!source.file.empty()) {
    run.truth = CompareWith(source, source.file, options, run);
    return;
  }
  try {
    const std::optional<fs::path> file = TruthBesideImages(run);
    if (file) run.truth = CompareWith(source, *file, options, run);
  } catch (const std::exception& error) {
    run.truth_problem = error.what();
  }
}

Eigen::Vector3d ErrorDeg(const Rotation& world_from_cam, const Rotation& true_world_from_cam) {
  return kDegFromRad * (true_world_from_cam.Inverse() * world_from_cam).Log();
}

}  // namespace rotslam
