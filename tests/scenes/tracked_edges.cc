#include "tests/scenes/tracked_edges.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Dense>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr double kFocalPx = 600.0;
constexpr double kHalfWidthPx = 400.0;
constexpr double kHalfHeightPx = 240.0;
constexpr int kPointsInView = 250;

struct Motion {
  RotationMap cam_from_world;
  std::vector<Eigen::Vector3d> centers;
};

Motion Move(const TrackedEdgesOptions& options, SceneRandom& random) {
  Motion motion;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  const double phase = random.Uniform(0.0, 6.0);
  for (int k = 0; k < options.num_views; ++k) {
    Rotation cam_from_world;
    if (options.path == TrackedPath::kStreet) {
      const double heading = 0.4 * std::sin(0.05 * k + phase);
      cam_from_world = Rotation::Exp({random.Normal(0.003), 0.0, random.Normal(0.003)}) *
                       Rotation::Exp({0.0, -heading, 0.0});
      center += random.Uniform(0.8, 1.2) * Eigen::Vector3d(std::sin(heading), 0, std::cos(heading));
    } else {
      cam_from_world = Rotation::Exp({0.2 * std::sin(0.11 * k + phase), 0.0, 0.0}) *
                       Rotation::Exp({0.0, 0.03 * k, 0.1 * std::sin(0.07 * k)});
      if (options.path == TrackedPath::kHandheld) {
        center = {1.2 * std::sin(0.031 * k + phase),
                  0.3 * std::sin(0.053 * k),
                  1.2 * std::sin(0.043 * k + 2.0 * phase)};
      }
    }
    motion.cam_from_world[FrameId{k}] = cam_from_world;
    motion.centers.push_back(center);
  }
  return motion;
}

// A point that frame k begins to track: inside the image, somewhere in depth.
Eigen::Vector3d NewPoint(const TrackedEdgesOptions& options,
                         const Motion& motion,
                         int k,
                         SceneRandom& random) {
  const Eigen::Vector3d ray(random.Uniform(-kHalfWidthPx, kHalfWidthPx) / kFocalPx,
                            random.Uniform(-kHalfHeightPx, kHalfHeightPx) / kFocalPx,
                            1.0);
  double depth = random.Uniform(1.5, 5.0);
  if (options.path == TrackedPath::kStreet) {
    // House fronts 6 to 12 to the side, the road 1.6 below, and no end.
    depth = std::min(random.Uniform(6.0, 12.0) / std::max(0.01, std::abs(ray.x())), 60.0);
    if (ray.y() > 0.0) depth = std::min(depth, 1.6 / std::max(0.01, ray.y()));
    depth = std::max(depth, 3.0);
  }
  return motion.centers[k] + motion.cam_from_world.at(FrameId{k}).Inverse() * (depth * ray);
}

using Bearings = std::map<int, Eigen::Vector3d>;  // by point

std::vector<Bearings> Observe(const TrackedEdgesOptions& options,
                              const Motion& motion,
                              SceneRandom& random) {
  struct Point {
    int id;
    int last;
    Eigen::Vector3d in_world;
  };
  std::vector<Bearings> seen(options.num_views);
  std::vector<Point> alive;
  int next_id = 0;
  const bool is_street = options.path == TrackedPath::kStreet;
  for (int k = 0; k < options.num_views; ++k) {
    const auto pixel = [&](const Point& point) -> Eigen::Vector3d {
      return motion.cam_from_world.at(FrameId{k}) * (point.in_world - motion.centers[k]);
    };
    std::erase_if(alive, [&](const Point& point) {
      const Eigen::Vector3d p = pixel(point);
      return point.last < k || p.z() < 0.5 || std::abs(p.x()) * kFocalPx > kHalfWidthPx * p.z() ||
             std::abs(p.y()) * kFocalPx > kHalfHeightPx * p.z();
    });
    while (static_cast<int>(alive.size()) < kPointsInView) {
      const int length = is_street ? 3 + random.Index(8) : 4 + random.Index(27);
      // At the start there are tracks of any age.
      const int age = k == 0 ? random.Index(length) : 0;
      alive.push_back({next_id++, k + length - 1 - age, NewPoint(options, motion, k, random)});
    }
    for (const Point& point : alive) {
      const Eigen::Vector3d p = pixel(point);
      const double sigma = options.noise_px / kFocalPx;
      const double x = p.x() / p.z() + random.Normal(sigma);
      const double y = p.y() / p.z() + random.Normal(sigma);
      seen[k][point.id] = Eigen::Vector3d(x, y, 1.0);
    }
  }
  return seen;
}

struct Pair {
  Eigen::Vector3d i;  // image points at unit depth
  Eigen::Vector3d j;
};

// Gauss-Newton on Sampson distances over rotation and direction, from the truth.
struct Fit {
  Rotation j_from_i;
  Eigen::Matrix3d covariance;
};

double Sampson(const Pair& pair, const Eigen::Matrix3d& E) {
  const Eigen::Vector3d line_j = E * pair.i;
  const Eigen::Vector3d line_i = E.transpose() * pair.j;
  return pair.j.dot(line_j) /
         std::sqrt(line_j.head<2>().squaredNorm() + line_i.head<2>().squaredNorm());
}

Fit FitEpipolar(const std::vector<Pair>& pairs,
                Rotation j_from_i,
                Eigen::Vector3d direction,
                double sigma) {
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> H;
  for (int iteration = 0; iteration < 3; ++iteration) {
    const Eigen::Vector3d u = direction.unitOrthogonal();
    const Eigen::Vector3d v = direction.cross(u);
    const auto turned = [&](const Vector5& delta) -> Eigen::Matrix3d {
      const Eigen::Vector3d t = (direction + delta[3] * u + delta[4] * v).normalized();
      return Skew(t) * (Rotation::Exp(delta.head<3>()) * j_from_i).Matrix();
    };
    H.setZero();
    Vector5 gradient = Vector5::Zero();
    const double h = 1e-5;
    std::array<Eigen::Matrix3d, 5> ahead;
    std::array<Eigen::Matrix3d, 5> back;
    for (int k = 0; k < 5; ++k) {
      ahead[k] = turned(h * Vector5::Unit(k));
      back[k] = turned(-h * Vector5::Unit(k));
    }
    const Eigen::Matrix3d E = turned(Vector5::Zero());
    for (const Pair& pair : pairs) {
      Vector5 J;
      for (int k = 0; k < 5; ++k)
        J[k] = (Sampson(pair, ahead[k]) - Sampson(pair, back[k])) / (2 * h);
      H += J * J.transpose();
      gradient += J * Sampson(pair, E);
    }
    const Vector5 step = -H.ldlt().solve(gradient);
    j_from_i = Rotation::Exp(step.head<3>()) * j_from_i;
    direction = (direction + step[3] * u + step[4] * v).normalized();
  }
  const Eigen::Matrix<double, 5, 5> covariance = sigma * sigma * H.inverse();
  return {j_from_i, covariance.topLeftCorner<3, 3>()};
}

Fit FitRotation(const std::vector<Pair>& pairs, Rotation j_from_i, double sigma) {
  Eigen::Matrix3d H;
  for (int iteration = 0; iteration < 3; ++iteration) {
    H.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const Pair& pair : pairs) {
      const Eigen::Vector3d p = j_from_i * pair.i;
      Eigen::Matrix<double, 2, 3> projection;
      projection << 1 / p.z(), 0, -p.x() / (p.z() * p.z()), 0, 1 / p.z(), -p.y() / (p.z() * p.z());
      const Eigen::Matrix<double, 2, 3> J = -projection * Skew(p);
      const Eigen::Vector2d r = p.head<2>() / p.z() - pair.j.head<2>();
      H += J.transpose() * J;
      gradient += J.transpose() * r;
    }
    j_from_i = Rotation::Exp(-H.ldlt().solve(gradient)) * j_from_i;
  }
  return {j_from_i, 2.0 * sigma * sigma * H.inverse()};
}

}  // namespace

TrackedEdges MakeTrackedEdges(const TrackedEdgesOptions& options) {
  SceneRandom random(options.seed);
  const Motion motion = Move(options, random);
  const std::vector<Bearings> seen = Observe(options, motion, random);
  TrackedEdges scene;
  const Rotation first = motion.cam_from_world.at(FrameId{0});
  for (const auto& [view, cam_from_world] : motion.cam_from_world) {
    scene.true_cam_from_world[view] = cam_from_world * first.Inverse();
  }
  scene.edges.resize(options.num_views);
  for (int j = 1; j < options.num_views; ++j) {
    std::vector<int> partners;
    for (int i = std::max(0, j - options.reach); i < j; ++i) partners.push_back(i);
    if (options.keyframe_every > 0 && partners.front() > 0) {
      partners.push_back((partners.front() - 1) / options.keyframe_every * options.keyframe_every);
    }
    for (const int i : partners) {
      TrackedEdge tracked;
      std::vector<Pair> pairs;
      for (const auto& [point, bearing] : seen[i]) {
        const auto other = seen[j].find(point);
        if (other == seen[j].end()) continue;
        pairs.push_back({bearing, other->second});
        // Points are numbered through; one frame's lie close together.
        tracked.keypoint_pairs.push_back({point, point});
      }
      if (static_cast<int>(pairs.size()) < options.min_common) continue;
      const Rotation cam_j_from_world = motion.cam_from_world.at(FrameId{j});
      const Rotation j_from_i = cam_j_from_world * motion.cam_from_world.at(FrameId{i}).Inverse();
      const double sigma = options.noise_px / kFocalPx;
      const Eigen::Vector3d baseline = cam_j_from_world * (motion.centers[i] - motion.centers[j]);
      const Fit fit = options.path == TrackedPath::kPan
                          ? FitRotation(pairs, j_from_i, sigma)
                          : FitEpipolar(pairs, j_from_i, baseline.normalized(), sigma);
      tracked.edge.i = FrameId{i};
      tracked.edge.j = FrameId{j};
      tracked.edge.j_from_i = fit.j_from_i;
      tracked.edge.covariance = fit.covariance;
      tracked.edge.num_inliers = static_cast<int>(pairs.size());
      tracked.edge.rotation_only = options.path == TrackedPath::kPan;
      scene.edges[j].push_back(std::move(tracked));
    }
  }
  return scene;
}

}  // namespace rotslam
