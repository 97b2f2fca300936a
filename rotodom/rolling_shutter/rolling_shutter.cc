#include "rotodom/rolling_shutter/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <vector>

#include <Eigen/LU>

#include "rotodom/types/parallel.h"
#include "rotodom/types/rotation.h"

namespace rotslam {
namespace {

Eigen::Vector3d RotationVector(const AngularMotion& motion, double seconds) {
  const double squared = seconds * seconds;
  const Eigen::Vector4d powers(seconds, squared, squared * seconds, squared * squared);
  return motion.coefficients * powers;
}

}  // namespace

PowerCoefficients PolynomialThrough(std::span<const TimedOffset> offsets) {
  PowerCoefficients coefficients = PowerCoefficients::Zero();
  const auto count = static_cast<int>(offsets.size());
  if (count > coefficients.cols()) throw std::invalid_argument("PolynomialThrough: too many");
  if (count == 0) return coefficients;
  Eigen::Matrix4d powers = Eigen::Matrix4d::Identity();
  Eigen::Matrix<double, 4, 3> rows = Eigen::Matrix<double, 4, 3>::Zero();
  for (int k = 0; k < count; ++k) {
    for (int power = 0; power < count; ++power) {
      powers(k, power) = std::pow(offsets[k].after_s, power + 1);
    }
    rows.row(k) = offsets[k].offset.transpose();
  }
  coefficients = powers.partialPivLu().solve(rows).transpose();
  return coefficients;
}

Rotation AngularMotion::After(double seconds) const {
  return Rotation::Exp(RotationVector(*this, seconds));
}

Eigen::Vector3d AngularMotion::ToMidFrame(double seconds, const Eigen::Vector3d& vector) const {
  // Rodrigues' formula, as a series for small angles.
  const Eigen::Vector3d turn = RotationVector(*this, seconds);
  const double squared_angle = turn.squaredNorm();
  double sine_share = 1.0 - squared_angle / 6.0;
  double versine_share = 0.5 - squared_angle / 24.0;
  if (squared_angle > 1e-4) {
    const double angle = std::sqrt(squared_angle);
    sine_share = std::sin(angle) / angle;
    versine_share = (1.0 - std::cos(angle)) / squared_angle;
  }
  const Eigen::Vector3d moved = vector.cross(turn);
  return vector + sine_share * moved + versine_share * moved.cross(turn);
}

AngularMotion MotionThrough(const TimedOrientation& frame,
                            std::span<const TimedOrientation> others) {
  std::vector<TimedOffset> turns;
  for (const TimedOrientation& other : others) {
    const Rotation turn = other.cam_from_world * frame.cam_from_world.Inverse();
    turns.push_back({other.time_s - frame.time_s, turn.Log()});
  }
  return {PolynomialThrough(turns)};
}

AngularMotion MotionAt(FrameId frame,
                       const RotationMap& cam_from_world,
                       const std::function<double(FrameId)>& time_s,
                       int num_others) {
  const auto here = cam_from_world.find(frame);
  if (here == cam_from_world.end()) {
    throw std::invalid_argument("MotionAt: a frame without orientation");
  }
  const auto timed = [&](RotationMap::const_iterator at) {
    return TimedOrientation{time_s(at->first), at->second};
  };
  std::vector<TimedOrientation> others;
  const auto has_room = [&] { return static_cast<int>(others.size()) < num_others; };
  auto before = here;
  auto behind = std::next(here);
  while (has_room() && (before != cam_from_world.begin() || behind != cam_from_world.end())) {
    if (behind != cam_from_world.end()) others.push_back(timed(behind++));
    if (has_room() && before != cam_from_world.begin()) others.push_back(timed(--before));
  }
  return MotionThrough(timed(here), others);
}

MotionEstimate EstimateMotionAt(FrameId frame,
                                const RotationMap& cam_from_world,
                                const std::function<double(FrameId)>& time_s,
                                double readout_s) {
  constexpr int kOthers = 2;
  MotionEstimate estimate{MotionAt(frame, cam_from_world, time_s, kOthers)};
  const AngularMotion finer = MotionAt(frame, cam_from_world, time_s, kOthers + 1);
  for (const double after_s : {-0.5 * readout_s, 0.5 * readout_s}) {
    const Rotation between = estimate.motion.After(after_s) * finer.After(after_s).Inverse();
    estimate.error_rad = std::max(estimate.error_rad, between.Angle());
  }
  return estimate;
}

Eigen::Vector3d BearingInMidFrame(const AngularMotion& motion, std::span<const TimedBearing> seen) {
  // Lagrange's polynomial at time 0.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const TimedBearing& one : seen) {
    double weight = 1.0;
    for (const TimedBearing& other : seen) {
      if (&other != &one) weight *= other.after_s / (other.after_s - one.after_s);
    }
    sum += weight * motion.ToMidFrame(one.after_s, one.bearing);
  }
  return sum.normalized();
}

void CorrectRollingShutter(const Camera& camera,
                           const AngularMotion& motion,
                           std::span<const View* const> others,
                           int num_threads,
                           View& view) {
  // Observations closer in time differ by noise rather than by motion.
  const double least_distance_s = 0.5 * camera.readout_s;
  const auto add = [&](const View& from, int index, std::vector<TimedBearing>& seen) {
    const Eigen::Vector2d& keypoint_px = from.features.keypoints_px[index];
    const double after_s = from.timestamp_s - view.timestamp_s + camera.ExposureTime(keypoint_px);
    const bool is_apart = std::all_of(seen.begin(), seen.end(), [&](const TimedBearing& other) {
      return std::abs(after_s - other.after_s) > least_distance_s;
    });
    if (!is_apart) return;
    if (!from.seen_bearings.empty()) {
      seen.push_back({after_s, from.seen_bearings[index]});
    } else if (const auto bearing = camera.Unproject(keypoint_px)) {
      seen.push_back({after_s, *bearing});
    }
  };
  constexpr int kChunk = 256;
  Features& features = view.features;
  const int size = features.size();
  ParallelFor((size + kChunk - 1) / kChunk, num_threads, [&](int chunk) {
    std::vector<TimedBearing> seen;
    for (int n = chunk * kChunk; n < std::min((chunk + 1) * kChunk, size); ++n) {
      seen.clear();
      add(view, n, seen);
      if (seen.empty()) continue;
      for (const View* other : others) {
        const int index = FindTrack(other->features, features.tracks[n]);
        if (index >= 0) add(*other, index, seen);
      }
      features.bearings[n] = BearingInMidFrame(motion, seen);
    }
  });
}

void MoveToMidFrame(const Camera& camera, const AngularMotion& motion, Features& corners) {
  if (camera.readout_s == 0.0) return;
  for (int n = 0; n < corners.size(); ++n) {
    const Eigen::Vector2d& keypoint_px = corners.keypoints_px[n];
    const auto bearing = camera.Unproject(keypoint_px);
    if (!bearing) continue;
    const TimedBearing seen{camera.ExposureTime(keypoint_px), *bearing};
    corners.bearings[n] = BearingInMidFrame(motion, {&seen, 1});
    if (const auto moved = camera.Project(corners.bearings[n])) corners.keypoints_px[n] = *moved;
  }
}

}  // namespace rotslam
