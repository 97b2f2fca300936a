// How exact the odometry's orientations are on sequences with exact truth, and how well their
// covariances say so.
//
//   odometry_accuracy [SEQUENCE ...]
//
// Without an argument: street, handheld and gimbal sequences of three seeds, rendered in memory.
// Otherwise folders with images, calibration and ground truth, as `rotslam simulate` writes them.
// Prints, per sequence, in deg: RPE_1 of the chained (averaging off), the windowed (settled) and
// the online orientations (each as first reported); then the mean squared Mahalanobis distance / 3,
// which is 1 where the covariances are right: of the newest and of the settled orientations against
// the first frame, and of the turns of 1 and 10 frames up to the newest; then for each kind and
// reach of the edges their number, error, reported deviation and normalised error.
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/simulation/simulation.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/odometry.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

struct TestSequence {
  std::string name;
  Camera camera;
  std::function<cv::Mat(int)> image;
  Trajectory truth;
};

TestSequence Simulated(SimulationKind kind, std::uint64_t seed) {
  SimulationOptions options;
  options.kind = kind;
  options.seed = seed;
  const auto simulation = std::make_shared<Simulation>(options);
  return {std::string(Name(kind)) + " " + std::to_string(seed),
          simulation->GetCamera(),
          [simulation](int k) { return simulation->Render(k); },
          simulation->Truth()};
}

TestSequence FromFolder(const std::string& path) {
  const std::shared_ptr<Sequence> sequence = OpenSequence(path, {});
  if (!sequence->camera_reference() || !sequence->GroundTruthFile()) {
    throw std::runtime_error(path + ": no calibration or no ground truth lies with the images");
  }
  TestSequence test;
  test.name = path.substr(path.find_last_of('/') + 1);
  test.camera = MatchToImages(ReadCamera(*sequence->camera_reference()), sequence->image_size());
  test.truth = ReadTrajectory(*sequence->GroundTruthFile());
  if (static_cast<int>(test.truth.size()) != sequence->NumFrames()) {
    throw std::runtime_error(path + ": the ground truth has not one pose a frame");
  }
  test.image = [sequence](int) { return sequence->Next()->image; };
  return test;
}

// Mean squared errors, in variances and in deg^2.
struct Errors {
  int count = 0;
  double normalised = 0.0;
  double squared_deg = 0.0;
  double variance_deg = 0.0;

  void Add(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
    ++count;
    normalised += error.dot(covariance.inverse() * error) / 3.0;
    squared_deg += error.squaredNorm() * kDegFromRad * kDegFromRad;
    variance_deg += covariance.trace() * kDegFromRad * kDegFromRad;
  }
  double Normalised() const { return normalised / count; }
  double ErrorDeg() const { return std::sqrt(squared_deg / count); }
  double DeviationDeg() const { return std::sqrt(variance_deg / count); }
};

struct EdgeErrors {
  Errors errors;
  double noise_px = 0.0;
  double parallax_px = 0.0;
  int num_inliers = 0;
};

struct Accuracy {
  Errors step;  // settled orientations
  Errors online_step;
  Errors newest;
  Errors settled;
  Errors turn_1;
  Errors turn_10;
  // By model (rotation only or not) and reach, those beyond four frames together.
  std::map<std::pair<bool, int>, EdgeErrors> edges;
  double ms_per_frame = 0.0;
};

Rotation TrueTurn(const Trajectory& truth, int i, int j) {
  return truth[j].world_from_cam.Inverse() * truth[i].world_from_cam;
}

Accuracy Measure(const TestSequence& test,
                 const std::vector<cv::Mat>& images,
                 const OdometryOptions& options) {
  const auto error = [&](const Rotation& j_from_i, int i, int j) -> Eigen::Vector3d {
    return (j_from_i * TrueTurn(test.truth, i, j).Inverse()).Log();
  };
  Accuracy accuracy;
  RotationalOdometry odometry(test.camera, options, 1, 2);
  std::optional<Rotation> online_before;
  RotationMap cam_from_world;
  for (int k = 0; k < static_cast<int>(images.size()); ++k) {
    const FrameEstimate estimate =
        odometry.AddFrame(FrameId{k}, test.truth[k].timestamp_s, images[k]);
    for (const auto& [frame, rotation] : estimate.window) cam_from_world[frame] = rotation;
    if (k == 0) {
      online_before = estimate.cam_from_world;
      continue;
    }
    if (estimate.covariance) {
      accuracy.newest.Add(error(estimate.cam_from_world, 0, k), *estimate.covariance);
    }
    if (estimate.settled_covariance && estimate.settled.value > 0) {
      const int settled = estimate.settled.value;
      accuracy.settled.Add(error(cam_from_world.at(estimate.settled), 0, settled),
                           *estimate.settled_covariance);
    }
    for (const int gap : {1, 10}) {
      const auto covariance =
          k < gap ? std::nullopt : odometry.CovarianceBetween(FrameId{k - gap}, FrameId{k});
      if (!covariance || !cam_from_world.contains(FrameId{k - gap})) continue;
      const Rotation turn = estimate.cam_from_world * cam_from_world.at(FrameId{k - gap}).Inverse();
      (gap == 1 ? accuracy.turn_1 : accuracy.turn_10).Add(error(turn, k - gap, k), *covariance);
    }
    accuracy.online_step.Add(error(estimate.cam_from_world * online_before->Inverse(), k - 1, k),
                             Eigen::Matrix3d::Identity());
    online_before = estimate.cam_from_world;
    for (const EdgeWithMatches& connection : estimate.connections) {
      const RelativeRotation& edge = connection.edge;
      EdgeErrors& of_reach = accuracy.edges[{edge.rotation_only, std::min(k - edge.i.value, 5)}];
      of_reach.errors.Add(error(edge.j_from_i, edge.i.value, k), edge.covariance);
      of_reach.noise_px += edge.noise_px;
      of_reach.parallax_px += edge.parallax_px;
      of_reach.num_inliers += edge.num_inliers;
    }
  }
  for (int k = 1; k < static_cast<int>(images.size()); ++k) {
    const Rotation turn =
        cam_from_world.at(FrameId{k}) * cam_from_world.at(FrameId{k - 1}).Inverse();
    accuracy.step.Add(error(turn, k - 1, k), Eigen::Matrix3d::Identity());
  }
  const OdometrySeconds& s = odometry.seconds();
  accuracy.ms_per_frame = 1e3 * (s.pyramid + s.tracking + s.detection + s.edges + s.averaging) /
                          static_cast<double>(images.size());
  return accuracy;
}

void Report(const TestSequence& test) {
  std::vector<cv::Mat> images;
  for (int k = 0; k < static_cast<int>(test.truth.size()); ++k) images.push_back(test.image(k));
  OdometryOptions options;
  const Accuracy windowed = Measure(test, images, options);
  options.averaging.mode = AveragingMode::kOff;
  const Accuracy chained = Measure(test, images, options);
  std::printf("%-12s %4zu frames %5.1f ms | RPE_1 chained %.4f window %.4f online %.4f\n",
              test.name.c_str(),
              images.size(),
              windowed.ms_per_frame,
              chained.step.ErrorDeg(),
              windowed.step.ErrorDeg(),
              windowed.online_step.ErrorDeg());
  for (const auto& [name, accuracy] : {std::pair("window", &windowed), {"chained", &chained}}) {
    std::printf(
        "  %-8s normalised: newest %5.2f settled %5.2f turns of 1 %5.2f of 10 %5.2f   "
        "error / sigma deg: settled %.3f / %.3f\n",
        name,
        accuracy->newest.Normalised(),
        accuracy->settled.Normalised(),
        accuracy->turn_1.Normalised(),
        accuracy->turn_10.Normalised(),
        accuracy->settled.ErrorDeg(),
        accuracy->settled.DeviationDeg());
  }
  for (const auto& [key, edges] : windowed.edges) {
    const auto& [rotation_only, reach] = key;
    const double n = edges.errors.count;
    std::printf(
        "  %s edges, %s: %4d, error %.4f sigma %.4f deg, normalised %6.2f; %4.0f inliers, "
        "noise %.3f px, parallax %6.2f px\n",
        rotation_only ? "rotation" : "epipolar",
        reach < 5 ? ("reach " + std::to_string(reach)).c_str() : "beyond 4",
        edges.errors.count,
        edges.errors.ErrorDeg(),
        edges.errors.DeviationDeg(),
        edges.errors.Normalised(),
        edges.num_inliers / n,
        edges.noise_px / n,
        edges.parallax_px / n);
  }
  std::fflush(stdout);
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  try {
    for (int k = 1; k < argc; ++k) rotslam::Report(rotslam::FromFolder(argv[k]));
    if (argc > 1) return 0;
    for (const rotslam::SimulationKind kind : {rotslam::SimulationKind::kStreet,
                                               rotslam::SimulationKind::kHandheld,
                                               rotslam::SimulationKind::kGimbal}) {
      for (std::uint64_t seed = 1; seed <= 3; ++seed)
        rotslam::Report(rotslam::Simulated(kind, seed));
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "odometry_accuracy: %s\n", error.what());
    return 1;
  }
}
