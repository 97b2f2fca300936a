#include "apps/slam/input/given_rotations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "rotodom/averaging/closure.h"
#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// An orientation within this time of a frame is used as it is, whatever the gap around it, s.
constexpr double kExactS = 1e-4;
// Longest gap in the given orientations over which they are interpolated to find their convention,
// s.
constexpr double kMaxGapS = 0.2;
// Smallest disagreement at which another convention is considered, deg. Below it noise would
// decide.
constexpr double kMinDisagreementDeg = 0.5;
// The same with offset and mounting taken out, which are fitted, too: a mounting by half a turn
// explains much of an inversion where the rotation is about one axis.
constexpr double kMinAlignedDisagreementDeg = 0.1;
// Another convention must fit this many times better to be reported.
constexpr double kClearlyBetter = 5.0;
// Edges needed to tell conventions apart.
constexpr std::size_t kLeastEdges = 10;
// A sensor that is turned by more than this has other axes, deg; less is a mounting error.
constexpr double kOtherAxesDeg = 20.0;
// Edges over more frames than this are loops, which do not connect a frame with the next one.
constexpr int kLongestEdge = 100;
// Least variance of a step, of that of its edge: windows settle, and covariances with them.
constexpr double kLeastShareOfEdge = 0.1;

// Over edges between frames with orientations; zero where these are too few to tell.
double MedianOverEdges(const ViewGraph& graph,
                       const RotationMap& cam_from_world,
                       const std::function<double(const RelativeRotation&)>& error) {
  std::vector<double> errors;
  errors.reserve(graph.edges().size());
  for (const RelativeRotation& edge : graph.edges()) {
    if (cam_from_world.contains(edge.i) && cam_from_world.contains(edge.j)) {
      errors.push_back(error(edge));
    }
  }
  if (errors.size() < kLeastEdges) return 0.0;
  return Median(std::move(errors));
}

// Median angle between the edges and the orientations after `read` is applied to them, deg.
double Disagreement(const ViewGraph& graph,
                    const RotationMap& cam_from_world,
                    const std::function<Rotation(const Rotation&)>& read) {
  return MedianOverEdges(graph, cam_from_world, [&](const RelativeRotation& edge) {
    const Rotation j_from_i =
        read(cam_from_world.at(edge.j)) * read(cam_from_world.at(edge.i)).Inverse();
    return (j_from_i.Inverse() * edge.j_from_i).AngleDeg();
  });
}

// Undoes the reading of a camera->world quaternion with qw first as one with qw last.
Rotation WithWFirst(const Rotation& cam_from_world) {
  const Eigen::Vector4d wrong = cam_from_world.Inverse().Quaternion().coeffs();
  return Rotation(Eigen::Quaterniond(wrong[0], wrong[1], wrong[2], wrong[3])).Inverse();
}

// Another way to read an orientation, and how messages name it.
struct Reading {
  const char* name;
  Rotation (*read)(const Rotation& cam_from_world);
};
constexpr std::array<Reading, 3> kOtherReadings = {{
    {"taken for world->camera", [](const Rotation& r) { return r.Inverse(); }},
    {"with qw in front", WithWFirst},
    {"taken for world->camera with qw in front",
     [](const Rotation& r) { return WithWFirst(r).Inverse(); }},
}};

// The given orientations at the times of frames.
RotationMap AtFrames(const std::vector<StampedRotation>& given,
                     const std::vector<double>& timestamps_s) {
  Trajectory theirs;
  theirs.reserve(given.size());
  for (const StampedRotation& rotation : given) {
    theirs.push_back({rotation.timestamp_s, rotation.world_from_cam, Eigen::Vector3d::Zero()});
  }
  RotationMap cam_from_world;
  for (std::size_t k = 0; k < timestamps_s.size(); ++k) {
    if (const auto pose = PoseAt(theirs, timestamps_s[k], kExactS, kMaxGapS)) {
      cam_from_world[FrameId{static_cast<int>(k)}] = pose->world_from_cam.Inverse();
    }
  }
  return cam_from_world;
}

[[noreturn]] void Refuse(const OrientationsFromElsewhere& given,
                         double as_given_deg,
                         double other_deg,
                         const std::string& hint) {
  throw std::runtime_error(given.name + ": its rotations disagree with the images by " +
                           FormatNumber("%.2f", as_given_deg) + " deg (median), " + hint + " by " +
                           FormatNumber("%.2f", other_deg) +
                           " deg: orientations must be camera->world, qx qy qz qw, of camera "
                           "axes x right, y down, z forward");
}

void RefuseOtherConventions(const OrientationsFromElsewhere& given,
                            const RotationMap& rotations,
                            const ViewGraph& graph) {
  const double as_given_deg = Disagreement(graph, rotations, [](const Rotation& r) { return r; });
  if (as_given_deg < kMinDisagreementDeg) return;
  for (const Reading& other : kOtherReadings) {
    const double other_deg = Disagreement(graph, rotations, other.read);
    if (kClearlyBetter * other_deg <= as_given_deg) {
      Refuse(given, as_given_deg, other_deg, other.name);
    }
  }
}

// Median angle between the edges and the orientations with an alignment taken out, deg.
double AlignedDisagreement(const ViewGraph& graph,
                           const std::vector<StampedRotation>& given,
                           std::vector<double> timestamps_s,
                           const SensorAlignment& alignment) {
  for (double& timestamp_s : timestamps_s) timestamp_s += alignment.offset_s;
  return Disagreement(graph, AtFrames(given, timestamps_s), [&](const Rotation& sensor_from_world) {
    return alignment.cam_from_sensor * sensor_from_world;
  });
}

// The same for a sensor that is late or mounted otherwise: both are estimated for each convention.
// Inverse and qw in front are the same but for a mounting by a quarter turn or more, so that the
// smallest mounting tells which it is.
void RefuseOtherAlignedConventions(const OrientationsFromElsewhere& given,
                                   const ImageOrientations& images,
                                   const ViewGraph& graph,
                                   const SensorAlignment& alignment) {
  const double as_given_deg =
      AlignedDisagreement(graph, given.rotations, images.timestamps_s, alignment);
  if (as_given_deg < kMinAlignedDisagreementDeg) return;
  const char* best = nullptr;
  double best_deg = 0.0;
  double best_mounting_deg = std::numeric_limits<double>::infinity();
  for (const Reading& other : kOtherReadings) {
    std::vector<StampedRotation> rotations = given.rotations;
    for (StampedRotation& one : rotations) {
      one.world_from_cam = other.read(one.world_from_cam.Inverse()).Inverse();
    }
    const auto fused = FuseOrientations(images, rotations, {});
    if (!fused) continue;
    const double other_deg =
        AlignedDisagreement(graph, rotations, images.timestamps_s, fused->alignment);
    const double mounting_deg = fused->alignment.cam_from_sensor.AngleDeg();
    if (kClearlyBetter * other_deg > as_given_deg || mounting_deg >= best_mounting_deg) continue;
    best = other.name;
    best_deg = other_deg;
    best_mounting_deg = mounting_deg;
  }
  if (best == nullptr) return;
  Refuse(given,
         as_given_deg,
         best_deg,
         std::string(best) + ", and turned by " + FormatNumber("%.1f", best_mounting_deg) +
             " deg against the camera,");
}

// Without alignment a sensor with axes of its own is of no use.
void RefuseOtherAxes(const GivenRotations& result) {
  const SensorFusion& fusion = result.fusion;
  const double as_given_deg = fusion.disagreement_rad * kDegFromRad;
  const double aligned_deg = fusion.aligned_disagreement_rad * kDegFromRad;
  if (result.is_aligned || !fusion.alignment.has_mounting) return;
  if (fusion.alignment.cam_from_sensor.AngleDeg() < kOtherAxesDeg) return;
  if (as_given_deg < kMinDisagreementDeg || kClearlyBetter * aligned_deg > as_given_deg) return;
  throw std::runtime_error(result.file + ": its rotations disagree with the images by " +
                           FormatNumber("%.2f", as_given_deg) +
                           " deg from frame to frame (median), in another sensor's " +
                           "axes, turned by " +
                           FormatNumber("%.1f", fusion.alignment.cam_from_sensor.AngleDeg()) +
                           " deg against the camera's, by " + FormatNumber("%.2f", aligned_deg) +
                           " deg: --align takes that out");
}

double MeanVariance(const Eigen::Matrix3d& covariance) { return covariance.trace() / 3.0; }

}  // namespace

ImageOrientations OrientationsOfImages(const std::vector<double>& timestamps_s,
                                       const OdometryResult& images) {
  const auto num_frames = static_cast<int>(timestamps_s.size());
  ImageOrientations result;
  result.timestamps_s = timestamps_s;
  result.cam_from_world.reserve(num_frames);
  for (const auto& [frame, rotation] : images.cam_from_world) {
    result.cam_from_world.push_back(rotation);
    result.is_known.push_back(!images.graph.EdgesOf(frame).empty());
  }
  // By step: the best edge across it.
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<double> by_edge(num_frames - 1, kNone);
  for (const RelativeRotation& edge : images.graph.edges()) {
    const int length = edge.j.value - edge.i.value;
    if (length > kLongestEdge) continue;
    for (int k = edge.i.value; k < edge.j.value; ++k) {
      by_edge[k] = std::min(by_edge[k], MeanVariance(edge.covariance));
    }
  }
  const auto variance_of = [&](int frame) -> std::optional<double> {
    const auto known = images.covariance.find(FrameId{frame});
    if (known == images.covariance.end()) return std::nullopt;
    return MeanVariance(known->second);
  };
  const double closure_variance = ClosureVariance(images.graph);
  result.step_variance.reserve(num_frames - 1);
  for (int k = 0; k + 1 < num_frames; ++k) {
    double variance = by_edge[k];
    const auto before = variance_of(k);
    const auto after = variance_of(k + 1);
    if (before && after && std::isfinite(variance)) {
      variance = std::max(kLeastShareOfEdge * variance, *after - *before);
    }
    result.step_variance.push_back(closure_variance * variance);
  }
  return result;
}

GivenRotations MatchGivenRotations(const OrientationsFromElsewhere& given,
                                   const std::vector<double>& timestamps_s,
                                   const OdometryResult& images) {
  RefuseOtherConventions(given, AtFrames(given.rotations, timestamps_s), images.graph);
  SensorFusionOptions options;
  options.use_alignment = given.use_alignment;
  std::optional<SensorFusion> fusion;
  if (given.rotations.size() >= 2) {
    const ImageOrientations of_images = OrientationsOfImages(timestamps_s, images);
    fusion = FuseOrientations(of_images, given.rotations, options);
    if (fusion) RefuseOtherAlignedConventions(given, of_images, images.graph, fusion->alignment);
  }
  if (!fusion) {
    throw std::runtime_error(given.name + ": has orientations for fewer than 3 of the " +
                             std::to_string(timestamps_s.size()) + " frames; these reach from " +
                             FormatNumber("%.6f", timestamps_s.front()) + " to " +
                             FormatNumber("%.6f", timestamps_s.back()) + " s, the file from " +
                             FormatNumber("%.6f", given.rotations.front().timestamp_s) + " to " +
                             FormatNumber("%.6f", given.rotations.back().timestamp_s) + " s");
  }
  GivenRotations result = {given.name, given.use_alignment, given.rotations, std::move(*fusion)};
  RefuseOtherAxes(result);
  return result;
}

SensorAlignment AlignmentWithMap(const GivenRotations& given,
                                 const std::vector<double>& timestamps_s,
                                 const RotationMap& cam_from_world,
                                 const std::map<FrameId, FramePose>& poses) {
  // (0.0001 deg)^2: the sensor's walk is estimated, and is the sum of both.
  constexpr double kNoStep = 3e-12;
  const auto is_good = [&](int frame) {
    const auto pose = poses.find(FrameId{frame});
    return pose != poses.end() &&
           (pose->second.state == PoseState::kMeasured || pose->second.state == PoseState::kHeld);
  };
  ImageOrientations map;
  map.timestamps_s = timestamps_s;
  map.cam_from_world.reserve(cam_from_world.size());
  map.step_variance.reserve(cam_from_world.size());
  for (const auto& [frame, rotation] : cam_from_world) {
    map.cam_from_world.push_back(rotation);
    if (frame.value == 0) continue;
    map.step_variance.push_back(is_good(frame.value - 1) && is_good(frame.value)
                                    ? kNoStep
                                    : std::numeric_limits<double>::infinity());
  }
  const SensorAlignment& first = given.fusion.alignment;
  const auto fusion = FuseOrientations(map, given.rotations, {});
  if (!fusion) return first;
  const SensorAlignment& second = fusion->alignment;
  const bool is_better = second.mounting_covariance.trace() < first.mounting_covariance.trace() ||
                         second.offset_sigma_s < first.offset_sigma_s;
  return is_better ? second : first;
}

}  // namespace rotslam
