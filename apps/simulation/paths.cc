#include "apps/simulation/paths.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <memory>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "apps/simulation/texture.h"

namespace rotslam {
namespace {

using Eigen::Vector3d;

constexpr double kTwoPi = 2.0 * std::numbers::pi;

// Camera looking along `yaw` (from forward towards right), raised by `pitch`, turned by `roll`.
Rotation Heading(double yaw, double pitch, double roll) {
  return Rotation::Exp({0.0, yaw, 0.0}) * Rotation::Exp({pitch, 0.0, 0.0}) *
         Rotation::Exp({0.0, 0.0, roll});
}

// From 0 to 1 over [0, 1] with first and second derivative zero at both ends; constant outside.
double SmoothStep(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (10.0 + x * (-15.0 + 6.0 * x));
}

// From 0 to 1 over [0, 1]: a constant rate between ramps of length `ramp`, twice continuously
// differentiable. The rate within a ramp is 3 y^2 - 2 y^3, whose integral is y^3 - y^4 / 2.
double RampedStep(double x, double ramp) {
  x = std::clamp(x, 0.0, 1.0);
  if (x > 0.5) return 1.0 - RampedStep(1.0 - x, ramp);
  const double rate = 1.0 / (1.0 - ramp);
  if (x >= ramp) return rate * (x - 0.5 * ramp);
  const double y = x / ramp;
  return rate * ramp * y * y * y * (1.0 - 0.5 * y);
}

// Heading of a camera, rad.
struct Angles {
  double yaw = 0.0;
  double pitch = 0.0;
  double roll = 0.0;
};

// Progress along a way over [0, 1]: constant speed, then over the last third down to rest.
double Arrive(double x) {
  constexpr double kBrake = 0.35;
  const double full = 1.0 / (1.0 - 0.5 * kBrake);
  if (x <= 1.0 - kBrake) return full * x;
  const double y = std::min(1.0, (1.0 - x) / kBrake);
  return 1.0 - full * kBrake * y * y * y * (1.0 - 0.5 * y);
}

// A camera that translates, stops, turns in place, and translates on.
struct GimbalMotion {
  double stop_s = 0.0;
  double go_s = 0.0;
  double leave_s = 0.0;  // from `go_s` to the end
  Angles turn;           // in place
  double arm_m = 0.0;    // from the axis of the turn to the camera's centre

  StampedPose PoseAt(double time_s) const {
    const Vector3d stop(0.15, -1.5, -0.3);
    Vector3d axis_in_world = stop;
    Angles angles{kYawBefore, -0.12, 0.0};
    if (time_s < stop_s) {
      const Vector3d start(-1.05, -1.62, -0.55);
      const double x = time_s / stop_s;
      axis_in_world = start + Arrive(x) * (stop - start);
      // The hand's sway ends before the stop.
      Sway(time_s, SmoothStep((1.0 - x) / 0.6), angles, axis_in_world);
    } else {
      Turn((time_s - stop_s) / (go_s - stop_s), angles);
    }
    if (time_s > go_s) {
      const double x = (time_s - go_s) / leave_s;
      axis_in_world += (1.0 - Arrive(1.0 - x)) * WayOnwards();
      Sway(time_s, SmoothStep(x / 0.6), angles, axis_in_world);
    }
    StampedPose pose;
    pose.timestamp_s = time_s;
    pose.world_from_cam = Heading(angles.yaw, angles.pitch, angles.roll);
    pose.center_in_world = axis_in_world;
    if (arm_m != 0.0) pose.center_in_world += pose.world_from_cam * Vector3d(0.0, 0.0, arm_m);
    return pose;
  }

 private:
  static constexpr double kYawBefore = 0.12;

  // Across the view after the turn, backing off a little, over the same length at any turn.
  Vector3d WayOnwards() const {
    const double yaw_after = kYawBefore + turn.yaw;
    return 0.95 * Vector3d(std::cos(yaw_after), 0.0, -std::sin(yaw_after)) -
           0.30 * Vector3d(std::sin(yaw_after), 0.0, std::cos(yaw_after)) +
           Vector3d(0.0, -0.1, 0.0);
  }

  void Turn(double x, Angles& angles) const {
    const double turned = RampedStep(x, 0.25);
    angles.yaw += turn.yaw * turned;
    angles.pitch += turn.pitch * turned;
    angles.roll += turn.roll * turned;
    angles.pitch += 0.10 * (SmoothStep(x / 0.5) - SmoothStep(x / 0.5 - 1.0));
    angles.roll += 0.05 * (SmoothStep(x / 0.4) - SmoothStep((x - 0.6) / 0.4));
  }

  // The hand that carries the camera, at `strength` 0 to 1.
  static void Sway(double time_s, double strength, Angles& angles, Vector3d& place) {
    place.y() += 0.04 * strength * std::sin(kTwoPi * 0.9 * time_s);
    angles.yaw += 0.05 * strength * std::sin(kTwoPi * 0.45 * time_s);
    angles.pitch += 0.03 * strength * std::sin(kTwoPi * 0.6 * time_s + 1.0);
    angles.roll += 0.03 * strength * std::sin(kTwoPi * 0.5 * time_s + 2.0);
  }
};

}  // namespace

const char* Name(MotionKind kind) {
  return kind == MotionKind::kRotating ? "rotating" : "translating";
}

const char* Name(TurnAxis axis) {
  switch (axis) {
    case TurnAxis::kYaw:
      return "yaw";
    case TurnAxis::kPitch:
      return "pitch";
    case TurnAxis::kRoll:
      return "roll";
  }
  return "";
}

CameraPath HandheldPath(const HandheldPathOptions& options) {
  double phase[6];
  for (int k = 0; k < 6; ++k) {
    phase[k] = 0.6 * UnitFrom(HashBits(options.seed, k, 31), 0, 24);
  }
  CameraPath path;
  path.fps = options.fps;
  path.num_frames = options.num_frames;
  path.at = [=, scale = options.speed_scale](double time_s) {
    const double t = scale * time_s;
    const auto wave = [t](double hertz, double shift) {
      return std::sin(kTwoPi * hertz * t + shift);
    };
    StampedPose pose;
    pose.timestamp_s = time_s;
    pose.center_in_world = {
        0.95 * wave(0.071, phase[0] - 0.9) + 0.07 * wave(0.53, phase[1]),
        -1.55 + 0.14 * wave(0.19, phase[2]) + 0.012 * wave(1.7, phase[0]),
        0.45 * wave(0.113, phase[1] + 0.5) + 0.05 * wave(0.61, phase[2]) - 0.25};
    pose.world_from_cam = Heading(
        0.75 * wave(0.083, phase[3]) + 0.12 * wave(0.41, phase[4]) + 0.008 * wave(2.3, phase[5]),
        -0.16 + 0.16 * wave(0.13, phase[4] + 1.0) + 0.03 * wave(0.67, phase[5]),
        0.07 * wave(0.21, phase[5]) + 0.015 * wave(0.9, phase[3]));
    return pose;
  };
  return path;
}

CameraPath GimbalPath(const GimbalPathOptions& options) {
  const int num_frames = options.num_frames;
  const int first_rotating = static_cast<int>(std::lround(0.3 * num_frames));
  const int last_rotating = num_frames - first_rotating - 1;
  CameraPath path;
  path.fps = options.fps;
  path.num_frames = num_frames;
  path.segments = {{0, first_rotating - 1, MotionKind::kTranslating},
                   {first_rotating, last_rotating, MotionKind::kRotating},
                   {last_rotating + 1, num_frames - 1, MotionKind::kTranslating}};
  const auto turn_about = [&](TurnAxis axis) {
    return options.axis == axis ? options.turn_deg * kRadFromDeg : 0.0;
  };
  GimbalMotion motion;
  // The stops lie half a frame outside the turning frames, so that rounding of times cannot matter.
  motion.stop_s = (first_rotating - 0.5) / options.fps;
  motion.go_s = (last_rotating + 0.5) / options.fps;
  motion.leave_s = (num_frames - 1) / options.fps - motion.go_s + 0.5 / options.fps;
  motion.turn = {
      turn_about(TurnAxis::kYaw), turn_about(TurnAxis::kPitch), turn_about(TurnAxis::kRoll)};
  motion.arm_m = options.lever_arm_m;
  path.at = [motion](double time_s) { return motion.PoseAt(time_s); };
  return path;
}

CameraPath StreetPath(const StreetPathOptions& options) {
  // Heading as a function of the way driven: its derivative, the curvature, is smooth.
  constexpr double kBefore = 50.0;
  constexpr double kTurn = 22.0;
  constexpr double kAfter = 40.0;
  constexpr double kSpeed = 7.0;
  constexpr double kStep = 0.25;
  const auto heading = [](double way_m) {
    return 0.5 * std::numbers::pi * RampedStep((way_m - kBefore) / kTurn, 0.35);
  };
  const auto direction = [heading](double way_m) {
    const double yaw = heading(way_m);
    return Vector3d(std::sin(yaw), 0.0, std::cos(yaw));
  };
  const auto advance = [direction](double from_m, double to_m) -> Vector3d {  // Simpson's rule
    return (to_m - from_m) / 6.0 *
           (direction(from_m) + 4.0 * direction(0.5 * (from_m + to_m)) + direction(to_m));
  };
  const auto knots = std::make_shared<std::vector<Vector3d>>(1, Vector3d::Zero());
  for (double way = 0.0; way < kBefore + kTurn + 1.0; way += kStep) {
    knots->push_back(knots->back() + advance(way, way + kStep));
  }
  CameraPath path;
  path.fps = options.fps;
  const double length_s = (kBefore + kTurn + kAfter) / kSpeed;
  path.num_frames = static_cast<int>(length_s * options.fps / options.speed_scale) + 1;
  path.at = [=, scale = options.speed_scale](double time_s) {
    const double t = scale * time_s;
    const double way = kSpeed * t;
    const auto knot = static_cast<std::size_t>(
        std::clamp(std::floor(way / kStep), 0.0, static_cast<double>(knots->size() - 1)));
    const double knot_way = kStep * static_cast<double>(knot);
    StampedPose pose;
    pose.timestamp_s = time_s;
    pose.center_in_world = (*knots)[knot] + advance(knot_way, way);
    pose.center_in_world.y() += 0.015 * std::sin(kTwoPi * 1.1 * t);
    const double yaw = heading(way) + 0.006 * std::sin(kTwoPi * 0.23 * t);
    pose.world_from_cam =
        Heading(yaw, 0.006 * std::sin(kTwoPi * 0.9 * t), 0.008 * std::sin(kTwoPi * 0.31 * t + 0.5));
    return pose;
  };
  return path;
}

CameraPath PathThroughPoses(Trajectory poses, double fps, double speed_scale) {
  if (poses.size() < 2) throw std::invalid_argument("PathThroughPoses: fewer than two poses");
  CameraPath path;
  path.fps = fps;
  const double last = static_cast<double>(poses.size() - 1);
  path.num_frames = static_cast<int>(std::floor(last / speed_scale + 1e-9)) + 1;
  const auto shared = std::make_shared<const Trajectory>(std::move(poses));
  path.at = [=](double time_s) {
    const Trajectory& knots = *shared;
    double place = time_s * fps * speed_scale;
    // Times are whole microseconds; that must not move a frame off its pose.
    if (std::abs(place - std::round(place)) < 1e-4) place = std::round(place);
    const double floor = std::clamp(std::floor(place), 0.0, last - 1.0);
    const double x = place - floor;
    const auto index = static_cast<std::size_t>(floor);
    StampedPose pose = knots[index];
    pose.timestamp_s = time_s;
    if (x == 0.0) return pose;
    if (x == 1.0) {
      pose = knots[index + 1];
      pose.timestamp_s = time_s;
      return pose;
    }
    const Vector3d& b = knots[index].center_in_world;
    const Vector3d& c = knots[index + 1].center_in_world;
    const Vector3d a = index > 0 ? knots[index - 1].center_in_world : Vector3d(2.0 * b - c);
    const Vector3d d =
        index + 2 < knots.size() ? knots[index + 2].center_in_world : Vector3d(2.0 * c - b);
    pose.center_in_world =
        b +
        0.5 * x * ((c - a) + x * ((2.0 * a - 5.0 * b + 4.0 * c - d) + x * (3.0 * (b - c) + d - a)));
    pose.world_from_cam =
        Interpolate(knots[index].world_from_cam, knots[index + 1].world_from_cam, x);
    return pose;
  };
  return path;
}

Trajectory ReadKittiPoses(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    throw std::runtime_error("cannot read " + path + ": name a file of KITTI poses (--poses)");
  }
  Trajectory poses;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::string where = path + ":" + std::to_string(number) + ": ";
    std::istringstream stream(line);
    double values[12];
    int count = 0;
    while (count < 12 && stream >> values[count]) ++count;
    stream >> std::ws;
    if (count < 12 || !stream.eof()) {
      throw std::runtime_error(where + "a KITTI pose is twelve numbers, [R | t] row by row");
    }
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> pose(values);
    StampedPose stamped;
    try {
      stamped.world_from_cam = Rotation::FromMatrix(pose.leftCols<3>());
    } catch (const std::invalid_argument&) {
      throw std::runtime_error(where + "columns 1-3 are not a rotation");
    }
    stamped.center_in_world = pose.col(3);
    if (!stamped.center_in_world.allFinite()) {
      throw std::runtime_error(where + "the position is not finite");
    }
    poses.push_back(stamped);
  }
  if (poses.size() < 2) throw std::runtime_error(path + ": holds fewer than two poses");
  return poses;
}

}  // namespace rotslam
