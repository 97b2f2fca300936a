#include "apps/slam/given_rotations.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// An orientation within this time of a frame is used as it is, whatever the gap around it, s.
constexpr double kExactS = 1e-4;
// Longest gap in the given orientations over which they are interpolated, s. Motion capture and
// IMUs run at 100 Hz and more, so a longer gap is a dropout.
constexpr double kMaxGapS = 0.2;
// Smallest disagreement at which another convention is considered, deg. Below it noise would
// decide.
constexpr double kMinDisagreementDeg = 0.5;
// Another convention must fit this many times better to be reported.
constexpr double kClearlyBetter = 5.0;

double MedianOverEdges(const ViewGraph& graph,
                       const std::function<double(const RelativeRotation&)>& error) {
  std::vector<double> errors;
  errors.reserve(graph.edges().size());
  for (const RelativeRotation& edge : graph.edges()) errors.push_back(error(edge));
  return Median(std::move(errors));
}

// Median angle between the edges and the orientations after `read` is applied to them, deg.
double Disagreement(const ViewGraph& graph,
                    const RotationMap& cam_from_world,
                    const std::function<Rotation(const Rotation&)>& read) {
  return MedianOverEdges(graph, [&](const RelativeRotation& edge) {
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

void RefuseOtherConventions(const std::string& file,
                            const ViewGraph& graph,
                            const GivenRotations& given) {
  if (given.disagreement_deg < kMinDisagreementDeg) return;
  const RotationMap& rotations = given.cam_from_world;
  const auto refuse = [&](double other_deg, const std::string& hint) {
    if (kClearlyBetter * other_deg > given.disagreement_deg) return;
    throw std::runtime_error(file + ": its rotations disagree with the images by " +
                             FormatNumber("%.2f", given.disagreement_deg) + " deg (median), " +
                             hint + " by " + FormatNumber("%.2f", other_deg) +
                             " deg: orientations must be camera->world, qx qy qz qw, of camera "
                             "axes x right, y down, z forward");
  };
  refuse(Disagreement(graph, rotations, [](const Rotation& r) { return r.Inverse(); }),
         "taken for world->camera");
  refuse(Disagreement(graph, rotations, WithWFirst), "with qw in front");
  refuse(Disagreement(graph, rotations, [](const Rotation& r) { return WithWFirst(r).Inverse(); }),
         "taken for world->camera with qw in front");
  // Relative rotations of a body that is fixed to the camera have the same angles as the camera's,
  // about other axes.
  refuse(MedianOverEdges(graph,
                         [&](const RelativeRotation& edge) {
                           const Rotation j_from_i =
                               rotations.at(edge.j) * rotations.at(edge.i).Inverse();
                           return std::abs(j_from_i.AngleDeg() - edge.j_from_i.AngleDeg());
                         }),
         "their angles alone (as those of another sensor's axes, an IMU's, would)");
}

}  // namespace

GivenRotations MatchGivenRotations(const OrientationsFromElsewhere& elsewhere,
                                   const std::vector<double>& timestamps_s,
                                   const ViewGraph& graph) {
  const std::string& file = elsewhere.name;
  const std::vector<StampedRotation>& given = elsewhere.rotations;
  Trajectory theirs;
  theirs.reserve(given.size());
  for (const StampedRotation& rotation : given) {
    theirs.push_back({rotation.timestamp_s, rotation.world_from_cam, Eigen::Vector3d::Zero()});
  }
  GivenRotations result;
  result.file = file;
  std::size_t num_missing = 0;
  std::size_t first_missing = 0;
  for (std::size_t k = 0; k < timestamps_s.size(); ++k) {
    if (const auto pose = PoseAt(theirs, timestamps_s[k], kExactS, kMaxGapS)) {
      result.cam_from_world[FrameId{static_cast<int>(k)}] = pose->world_from_cam.Inverse();
    } else if (num_missing++ == 0) {
      first_missing = k;
    }
  }
  if (num_missing > 0) {
    throw std::runtime_error(
        file + ": has no orientation for " + std::to_string(num_missing) + " of the " +
        std::to_string(timestamps_s.size()) + " frames, the first being frame " +
        std::to_string(first_missing) + " at " + FormatNumber("%.6f", timestamps_s[first_missing]) +
        " s; the file reaches from " + FormatNumber("%.6f", given.front().timestamp_s) + " to " +
        FormatNumber("%.6f", given.back().timestamp_s) + " s, gaps of up to " +
        FormatNumber("%g", kMaxGapS) + " s are interpolated");
  }
  for (std::size_t k = 0; k < timestamps_s.size(); ++k) {
    const auto at = std::lower_bound(given.begin(),
                                     given.end(),
                                     timestamps_s[k] - kExactS,
                                     [](const StampedRotation& rotation, double time_s) {
                                       return rotation.timestamp_s < time_s;
                                     });
    if (at == given.end() || at->timestamp_s > timestamps_s[k] + kExactS) continue;
    if (!at->sigma_deg) continue;
    const Eigen::Vector3d sigma_rad = *at->sigma_deg * kRadFromDeg;
    result.covariance[FrameId{static_cast<int>(k)}] =
        sigma_rad.array().square().matrix().asDiagonal();
  }
  result.disagreement_deg =
      Disagreement(graph, result.cam_from_world, [](const Rotation& r) { return r; });
  RefuseOtherConventions(file, graph, result);
  return result;
}

}  // namespace rotslam
