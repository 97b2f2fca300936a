#include "tests/scenes/scene.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace rotslam {
namespace {

Camera SceneCamera(ScenePath path) {
  Camera camera;
  camera.width = path == ScenePath::kStreet ? 1241 : 1280;
  camera.height = path == ScenePath::kStreet ? 376 : 960;
  camera.fx = camera.fy = 700.0;
  camera.cx = 0.5 * (camera.width - 1);
  camera.cy = 0.5 * (camera.height - 1);
  return camera;
}

// Camera at `center` looking at `target`, image y as far down (+y) as possible.
Rotation LookAt(const Eigen::Vector3d& center, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - center).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Eigen::Matrix3d R_c_w;
  R_c_w << x.transpose(), z.cross(x).transpose(), z.transpose();
  return Rotation::FromMatrix(R_c_w);
}

void PlaceCameras(const SceneOptions& options, SceneRandom& random, Scene& scene) {
  const int n = options.num_views;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double heading = 0.0;
  for (int k = 0; k < n; ++k) {
    const FrameId frame{k};
    Rotation cam_from_world;
    switch (options.path) {
      case ScenePath::kRing:
      case ScenePath::kOrbit: {
        const double angle = 2.0 * std::numbers::pi * k / n;
        center = Eigen::Vector3d(
            6.0 * std::cos(angle), random.Uniform(-0.5, 0.5), 6.0 * std::sin(angle));
        cam_from_world = LookAt(center, {0.0, random.Uniform(-0.3, 0.3), 0.0});
        break;
      }
      case ScenePath::kStreet: {
        const Eigen::Vector3d forward(std::sin(heading), 0.0, std::cos(heading));
        cam_from_world = LookAt(center, center + forward + Eigen::Vector3d(0, 0.01, 0)) *
                         Rotation::Exp({0.0, 0.0, random.Normal(0.005)});
        scene.true_center_in_world[frame] = center;
        center += random.Uniform(0.8, 1.2) * forward;
        center.y() += random.Normal(0.01);
        heading = 0.4 * std::sin(0.05 * k);
        scene.true_cam_from_world[frame] = cam_from_world;
        continue;
      }
      case ScenePath::kRandom:
        center =
            Eigen::Vector3d(random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-2, 2));
        cam_from_world = LookAt(center, {random.Uniform(-1, 1), random.Uniform(-1, 1), 7.0});
        break;
      case ScenePath::kPivot:
        cam_from_world = Rotation::Exp({0.0, -0.5 * k / std::max(1, n - 1), 0.0});
        break;
    }
    scene.true_center_in_world[frame] = center;
    scene.true_cam_from_world[frame] = cam_from_world;
  }
}

Eigen::Vector3d DrawPoint(const SceneOptions& options, SceneRandom& random, const Scene& scene) {
  switch (options.path) {
    case ScenePath::kRing:
      return {random.Uniform(-2, 2), random.Uniform(-1.5, 1.5), random.Uniform(-2, 2)};
    case ScenePath::kStreet: {
      // House fronts, trees and the road, up to 40 ahead of some view.
      const FrameId frame{random.Index(options.num_views)};
      const double side = random.Uniform(0, 1) < 0.5 ? -1.0 : 1.0;
      const bool road = random.Uniform(0, 1) < 0.2;
      const Eigen::Vector3d offset(road ? random.Uniform(-4, 4) : side * random.Uniform(4, 12),
                                   road ? 1.6 : random.Uniform(-5, 1.6),
                                   random.Uniform(5, 40));
      return scene.true_center_in_world.at(frame) +
             scene.true_cam_from_world.at(frame).Inverse() * offset;
    }
    case ScenePath::kRandom:
      return {random.Uniform(-2.5, 2.5), random.Uniform(-2, 2), random.Uniform(5, 10)};
    case ScenePath::kOrbit:
      return {random.Uniform(-1.5, 1.5), random.Uniform(-1.2, 1.2), random.Uniform(-1.5, 1.5)};
    case ScenePath::kPivot:
      return {random.Uniform(-6, 8), random.Uniform(-3, 3), random.Uniform(4, 12)};
  }
  return Eigen::Vector3d::Zero();
}

bool InImage(const Camera& camera, const Eigen::Vector2d& px) {
  return px.x() >= 0.0 && px.y() >= 0.0 && px.x() <= camera.width - 1 &&
         px.y() <= camera.height - 1;
}

Eigen::Vector2d PinholePixel(const Camera& camera, const Eigen::Vector3d& p) {
  return {camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy};
}

Eigen::Vector3d PinholeBearing(const Camera& camera, const Eigen::Vector2d& px) {
  return Eigen::Vector3d((px.x() - camera.cx) / camera.fx, (px.y() - camera.cy) / camera.fy, 1.0)
      .normalized();
}

struct ViewPose {
  FrameId frame;
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world;
};

std::vector<ViewPose> TruePoses(const Scene& scene) {
  std::vector<ViewPose> poses;
  for (const auto& [frame, rotation] : scene.true_cam_from_world) {
    poses.push_back({frame, rotation, scene.true_center_in_world.at(frame)});
  }
  return poses;
}

// Views that can see the point with their distances, nearest first.
std::vector<std::pair<double, FrameId>> ViewsThatCanSee(const Camera& camera,
                                                        const std::vector<ViewPose>& poses,
                                                        const Eigen::Vector3d& point) {
  constexpr double kNear = 2.0;
  constexpr double kFar = 45.0;
  // Twice the farthest depth is beyond any corner of the image; most views of a long street are.
  constexpr double kTooFar = 2.0 * kFar;
  std::vector<std::pair<double, FrameId>> seen_by;
  for (const ViewPose& pose : poses) {
    const Eigen::Vector3d offset = point - pose.center_in_world;
    if (offset.squaredNorm() > kTooFar * kTooFar) continue;
    const Eigen::Vector3d in_cam = pose.cam_from_world * offset;
    if (in_cam.z() < kNear || in_cam.z() > kFar) continue;
    if (!InImage(camera, PinholePixel(camera, in_cam))) continue;
    seen_by.emplace_back(in_cam.norm(), pose.frame);
  }
  std::sort(seen_by.begin(), seen_by.end());
  return seen_by;
}

// An orbit's sights: every third of the nearest on average, of all views for every tenth point;
// the number has an exponential tail.
void KeepOrbitSights(SceneRandom& random, std::vector<std::pair<double, FrameId>>& seen_by) {
  constexpr double kMeanBeyondThree = 8.9;
  const int length =
      3 + static_cast<int>(-kMeanBeyondThree * std::log(1.0 - random.Uniform(0.0, 1.0)));
  const bool from_anywhere = random.Index(10) == 0;
  const std::size_t reach = from_anywhere ? seen_by.size() : static_cast<std::size_t>(3 * length);
  seen_by.resize(std::min(seen_by.size(), reach));
  while (static_cast<int>(seen_by.size()) > length) {
    seen_by.erase(seen_by.begin() + random.Index(static_cast<int>(seen_by.size())));
  }
}

// Cuts the sights of one point, nearest first, to those its track has; sorted by view.
void KeepSome(const SceneOptions& options,
              SceneRandom& random,
              std::vector<std::pair<double, FrameId>>& seen_by) {
  int length = static_cast<int>(seen_by.size());
  if (options.max_track_length > 0) length = std::min(length, options.max_track_length);
  // Street tracks die young now and then, as real ones do.
  if (options.path == ScenePath::kStreet) length = std::min(length, 3 + random.Index(8));
  seen_by.resize(length);
  if (options.path == ScenePath::kOrbit) KeepOrbitSights(random, seen_by);
  std::sort(seen_by.begin(), seen_by.end(), [](const auto& a, const auto& b) {
    return a.second < b.second;
  });
}

}  // namespace

SceneOptions DrivingOptions(int num_views, int num_points, std::uint64_t seed) {
  SceneOptions options;
  options.num_views = num_views;
  options.num_points = num_points;
  options.noise_px = 0.7;
  options.rotation_noise_deg = 0.03;
  options.path = ScenePath::kStreet;
  options.seed = seed;
  return options;
}

SceneOptions DenseOrbitOptions(std::uint64_t seed) {
  SceneOptions options = DrivingOptions(172, 14828, seed);
  options.path = ScenePath::kOrbit;
  return options;
}

double SceneRandom::Uniform(double low, double high) {
  return low + (high - low) * (static_cast<double>(random_.Next() >> 11) * 0x1.0p-53);
}

double SceneRandom::Normal(double sigma) {  // Box-Muller
  const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform(0.0, 1.0)));
  return sigma * radius * std::cos(2.0 * std::numbers::pi * Uniform(0.0, 1.0));
}

Eigen::Vector3d SceneRandom::NormalVector(double sigma) {
  const double x = Normal(sigma);
  const double y = Normal(sigma);
  return {x, y, Normal(sigma)};
}

int SceneRandom::Index(int count) { return random_.Index(count); }

Scene MakeScene(const SceneOptions& options) {
  Scene scene;
  SceneRandom random(options.seed);
  scene.camera = SceneCamera(options.path);
  PlaceCameras(options, random, scene);
  for (const auto& [frame, rotation] : scene.true_cam_from_world) {
    const double sigma = options.rotation_noise_deg * kRadFromDeg;
    scene.cam_from_world[frame] =
        sigma == 0.0
            ? rotation
            : Rotation::Exp({random.Normal(sigma), random.Normal(sigma), random.Normal(sigma)}) *
                  rotation;
  }
  const std::vector<ViewPose> poses = TruePoses(scene);
  for (int i = 0; i < options.num_points; ++i) {
    const TrackId id{i};
    const Eigen::Vector3d point = DrawPoint(options, random, scene);
    std::vector<std::pair<double, FrameId>> seen_by = ViewsThatCanSee(scene.camera, poses, point);
    KeepSome(options, random, seen_by);
    if (seen_by.size() < 2) continue;
    Track track;
    track.id = id;
    for (const auto& [distance, frame] : seen_by) {
      const Eigen::Vector3d in_cam =
          scene.true_cam_from_world.at(frame) * (point - scene.true_center_in_world.at(frame));
      Observation observation;
      observation.frame = frame;
      observation.keypoint_px = PinholePixel(scene.camera, in_cam);
      if (options.noise_px > 0.0) {
        observation.keypoint_px +=
            Eigen::Vector2d(random.Normal(options.noise_px), random.Normal(options.noise_px));
        observation.sigma_px = options.noise_px;
      }
      if (options.outlier_ratio > 0.0 && random.Uniform(0, 1) < options.outlier_ratio) {
        observation.keypoint_px = {random.Uniform(0, scene.camera.width - 1),
                                   random.Uniform(0, scene.camera.height - 1)};
        scene.outliers.emplace(id, frame);
      }
      observation.bearing = PinholeBearing(scene.camera, observation.keypoint_px);
      track.observations.push_back(observation);
    }
    scene.true_point_in_world[id] = point;
    scene.tracks.push_back(std::move(track));
  }
  return scene;
}

}  // namespace rotslam
