#include "krot/rotation_convention.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

constexpr std::size_t kMaxConventionPairs = 60;
// Pairs with fewer common tracks fit any rotation.
constexpr std::size_t kMinConventionTracks = 15;
constexpr std::size_t kMaxConventionTracks = 200;
// Below this noise would decide: three pixels at a focal length of 1,700.
constexpr double kMinConventionDeg = 0.1;
// Another convention must fit this many times better.
constexpr double kClearlyBetterConvention = 4.0;

struct BearingPair {
  FrameId i;
  FrameId j;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> bearings;
};

// Pairs of views with many common tracks, spread over all of them: of each view the partner with
// which rotations differ most, since two that are alike fit in any convention.
std::vector<BearingPair> PairsOf(const RotationMap& cam_from_world,
                                 const std::vector<Track>& tracks) {
  std::map<std::pair<FrameId, FrameId>, std::size_t> shared;
  for (const Track& track : tracks) {
    const auto& seen = track.observations;
    constexpr std::size_t kMaxSpan = 8;  // of a track, so that long ones stay linear
    for (std::size_t a = 0; a < seen.size(); ++a) {
      for (std::size_t b = a + 1; b < std::min(seen.size(), a + kMaxSpan); ++b) {
        if (!cam_from_world.contains(seen[a].frame) || !cam_from_world.contains(seen[b].frame)) {
          continue;
        }
        ++shared[std::minmax(seen[a].frame, seen[b].frame)];
      }
    }
  }
  std::map<FrameId, std::pair<double, FrameId>> best;
  for (const auto& [pair, count] : shared) {
    if (count < kMinConventionTracks) continue;
    const double angle =
        (cam_from_world.at(pair.second) * cam_from_world.at(pair.first).Inverse()).Angle();
    const auto [entry, is_new] = best.try_emplace(pair.first, angle, pair.second);
    if (!is_new && angle > entry->second.first) entry->second = {angle, pair.second};
  }
  std::map<std::pair<FrameId, FrameId>, std::size_t> place;
  std::vector<BearingPair> pairs;
  const std::size_t stride = best.size() / kMaxConventionPairs + 1;
  std::size_t number = 0;
  for (const auto& [view, partner] : best) {
    if (number++ % stride != 0) continue;
    place[{view, partner.second}] = pairs.size();
    pairs.push_back({view, partner.second, {}});
  }
  for (const Track& track : tracks) {
    for (const Observation& a : track.observations) {
      for (const Observation& b : track.observations) {
        const auto pair = place.find({a.frame, b.frame});
        if (pair == place.end()) continue;
        auto& bearings = pairs[pair->second].bearings;
        if (bearings.size() < kMaxConventionTracks) bearings.emplace_back(a.bearing, b.bearing);
      }
    }
  }
  return pairs;
}

// The normals of the epipolar planes lie in a plane, across the baseline, where the rotation is
// right: the root of their smallest second moment.
double MissRad(const BearingPair& pair, const Rotation& j_from_i) {
  const Eigen::Matrix3d R = j_from_i.Matrix();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const auto& [in_i, in_j] : pair.bearings) {
    const Eigen::Vector3d normal = in_j.cross(R * in_i);
    moments += normal * normal.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, eigen.eigenvalues()[0]) /
                   static_cast<double>(pair.bearings.size()));
}

double MedianMissDeg(const std::vector<BearingPair>& pairs, const RotationMap& cam_from_world) {
  std::vector<double> misses;
  misses.reserve(pairs.size());
  for (const BearingPair& pair : pairs) {
    misses.push_back(
        kDegFromRad *
        MissRad(pair, cam_from_world.at(pair.j) * cam_from_world.at(pair.i).Inverse()));
  }
  return Median(std::move(misses));
}

Rotation WithOtherOrder(const Rotation& cam_from_world) {
  const Eigen::Vector4d q = cam_from_world.Inverse().Quaternion().coeffs();
  return Rotation(Eigen::Quaterniond(q[0], q[1], q[2], q[3])).Inverse();
}

// All 24 rotations that turn axes into axes.
std::vector<Eigen::Matrix3d> AxisRotations() {
  std::vector<Eigen::Matrix3d> rotations;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
      for (int row = 0; row < 3; ++row) R(row, order[row]) = (signs >> row & 1) != 0 ? -1.0 : 1.0;
      if (R.determinant() > 0.0) rotations.push_back(R);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return rotations;
}

// "x right, y down, z forward" of the camera in the body's axes: "camera x, y, z are the body's -y,
// -z, x".
std::string NameOfAxes(const Eigen::Matrix3d& cam_from_body) {
  std::string name;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (cam_from_body(row, column) == 0.0) continue;
      name += (row == 0 ? "" : ", ") + std::string(cam_from_body(row, column) < 0.0 ? "-" : "") +
              "xyz"[column];
    }
  }
  return name;
}

}  // namespace

ConventionCheck CheckConvention(const RotationMap& cam_from_world,
                                const std::vector<Track>& tracks) {
  ConventionCheck check;
  std::vector<BearingPair> pairs = PairsOf(cam_from_world, tracks);
  std::erase_if(
      pairs, [](const BearingPair& pair) { return pair.bearings.size() < kMinConventionTracks; });
  check.num_pairs = static_cast<int>(pairs.size());
  if (pairs.empty()) return check;
  check.given_deg = check.other_deg = MedianMissDeg(pairs, cam_from_world);
  if (check.given_deg < kMinConventionDeg) return check;
  const std::vector<Eigen::Matrix3d> axes = AxisRotations();
  const auto try_reading = [&](bool is_inverted, bool has_other_order, const Eigen::Matrix3d& R) {
    const Rotation cam_from_body = Rotation::FromMatrix(R);
    RotationMap read;
    for (const auto& [view, rotation] : cam_from_world) {
      const Rotation ordered = has_other_order ? WithOtherOrder(rotation) : rotation;
      read[view] = cam_from_body * (is_inverted ? ordered.Inverse() : ordered);
    }
    const double deg = MedianMissDeg(pairs, read);
    // Of two that fit alike the one that was tried first stands.
    if (deg >= 0.999 * check.other_deg) return;
    check.other_deg = deg;
    check.other = is_inverted ? "taken for world->camera" : "taken for camera->world";
    if (has_other_order) check.other += " with qw in front";
    if (!R.isIdentity()) {
      check.other += " of a body whose axes " + NameOfAxes(R) + " are the camera's x, y, z";
    }
    check.cam_from_world = std::move(read);
  };
  // The camera's own axes first: some other ones come to the same as another order of the numbers.
  for (const bool has_own_axes : {true, false}) {
    for (const bool has_other_order : {false, true}) {
      for (const bool is_inverted : {false, true}) {
        for (const Eigen::Matrix3d& R : axes) {
          if (R.isIdentity() == has_own_axes) try_reading(is_inverted, has_other_order, R);
        }
      }
    }
  }
  if (kClearlyBetterConvention * check.other_deg > check.given_deg) {
    check.other.clear();
    check.cam_from_world.clear();
    check.other_deg = check.given_deg;
  }
  return check;
}

}  // namespace rotslam
