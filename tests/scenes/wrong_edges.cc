#include "tests/scenes/wrong_edges.h"

#include <algorithm>
#include <cmath>

#include <Eigen/SVD>

#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr int kChainReach = 4;
constexpr int kViewsPerLoop = 20;
constexpr int kStreetReach = 9;
constexpr int kCrossingEvery = 25;
constexpr int kCrossingReach = 3;

Rotation RandomRotation(SceneRandom& random) {
  const Eigen::Vector3d v = random.NormalVector(1.0);
  return Rotation(Eigen::Quaterniond(random.Normal(1.0), v.x(), v.y(), v.z()));
}

int RandomView(SceneRandom& random, int num_views) {
  return std::min(num_views - 1, static_cast<int>(random.Uniform(0.0, 1.0) * num_views));
}

using NumberPairs = std::vector<std::pair<int, int>>;

NumberPairs RandomPairs(int num_views, double edges_per_view, SceneRandom& random) {
  const int num_edges = static_cast<int>(0.5 * edges_per_view * num_views);
  NumberPairs pairs;
  pairs.reserve(num_edges);
  // A ring joins all.
  for (int k = 0; k < num_views; ++k) pairs.emplace_back(k, (k + 1) % num_views);
  while (static_cast<int>(pairs.size()) < num_edges) {
    const int i = RandomView(random, num_views);
    const int j = RandomView(random, num_views);
    if (i != j) pairs.emplace_back(i, j);
  }
  return pairs;
}

NumberPairs GridPairs(int side) {
  NumberPairs pairs;
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const int view = row * side + column;
      if (column + 1 < side) pairs.emplace_back(view, view + 1);
      if (row + 1 < side) pairs.emplace_back(view, view + side);
    }
  }
  return pairs;
}

NumberPairs ChainPairs(int num_views, SceneRandom& random) {
  NumberPairs pairs;
  for (int j = 1; j < num_views; ++j) {
    for (int i = std::max(0, j - kChainReach); i < j; ++i) pairs.emplace_back(i, j);
  }
  for (int k = 0; k < num_views / kViewsPerLoop; ++k) {
    const int i = RandomView(random, num_views);
    const int j = RandomView(random, num_views);
    if (std::abs(i - j) > kChainReach) pairs.emplace_back(std::min(i, j), std::max(i, j));
  }
  return pairs;
}

// `side` streets from west to east and as many from north to south, which cross at every
// kCrossingEvery-th view. The views of a street follow each other.
NumberPairs CityPairs(int side) {
  const int length = side * kCrossingEvery;
  NumberPairs pairs;
  for (int street = 0; street < 2 * side; ++street) {
    for (int k = 0; k < length; ++k) {
      for (int step = 1; step <= kStreetReach && k + step < length; ++step) {
        pairs.emplace_back(street * length + k, street * length + k + step);
      }
    }
  }
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const int along_row = row * length + column * kCrossingEvery + kCrossingEvery / 2;
      const int along_column = (side + column) * length + row * kCrossingEvery + kCrossingEvery / 2;
      for (int a = -kCrossingReach; a <= kCrossingReach; ++a) {
        for (int b = -kCrossingReach; b <= kCrossingReach; ++b) {
          pairs.emplace_back(along_row + a, along_column + b);
        }
      }
    }
  }
  return pairs;
}

}  // namespace

std::string NameOf(GraphShape shape) {
  switch (shape) {
    case GraphShape::kRandom:
      return "random";
    case GraphShape::kGrid:
      return "grid";
    case GraphShape::kChain:
      return "chain";
    case GraphShape::kCity:
      return "city";
  }
  return "";
}

WrongEdges MakeWrongEdges(const WrongEdgesOptions& options) {
  SceneRandom random(options.seed);
  int num_views = options.num_views;
  NumberPairs pairs;
  if (options.shape == GraphShape::kRandom) {
    pairs = RandomPairs(num_views, options.edges_per_view, random);
  } else if (options.shape == GraphShape::kGrid) {
    const int side = static_cast<int>(std::lround(std::sqrt(num_views)));
    num_views = side * side;
    pairs = GridPairs(side);
  } else if (options.shape == GraphShape::kChain) {
    pairs = ChainPairs(num_views, random);
  } else {
    const int side =
        std::max(1, static_cast<int>(std::lround(std::sqrt(num_views / (2.0 * kCrossingEvery)))));
    num_views = 2 * side * side * kCrossingEvery;
    pairs = CityPairs(side);
  }

  WrongEdges scene;
  std::vector<Rotation> truth(static_cast<std::size_t>(num_views));
  for (int k = 0; k < num_views; ++k) {
    truth[k] = RandomRotation(random);
    scene.true_cam_from_world.emplace_hint(scene.true_cam_from_world.end(), FrameId{k}, truth[k]);
  }
  const double sigma = options.noise_deg * kRadFromDeg;
  scene.edges.reserve(pairs.size());
  scene.is_wrong.reserve(pairs.size());
  for (auto [i, j] : pairs) {
    const bool is_wrong = random.Uniform(0.0, 1.0) < options.wrong_ratio;
    if (is_wrong && options.shape == GraphShape::kCity && random.Uniform(0.0, 1.0) < 0.5) {
      const int other = RandomView(random, num_views);
      if (other != i) j = other;
    }
    RelativeRotation& edge = scene.edges.emplace_back();
    edge.i = FrameId{i};
    edge.j = FrameId{j};
    edge.covariance = (sigma * sigma + 1e-12) * Eigen::Matrix3d::Identity();
    edge.j_from_i = is_wrong
                        ? RandomRotation(random)
                        : Rotation::Exp(random.NormalVector(sigma)) * truth[j] * truth[i].Inverse();
    scene.is_wrong.push_back(is_wrong ? 1 : 0);
  }
  return scene;
}

OrientationErrors CompareOrientations(const RotationMap& estimate, const RotationMap& truth) {
  // The turn of the world that most views agree on, by re-weighted means.
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const auto& [view, cam_from_world] : estimate) {
      const Eigen::Matrix3d here = cam_from_world.Inverse().Matrix() * truth.at(view).Matrix();
      const double distance = iteration == 0 ? 1.0 : (here - turn).norm();
      sum += here / std::max(distance, 1e-3);
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d signs(1.0, 1.0, (svd.matrixU() * svd.matrixV().transpose()).determinant());
    turn = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  }
  const Rotation world_from_true = Rotation::FromMatrix(turn);
  std::vector<double> errors;
  errors.reserve(estimate.size());
  for (const auto& [view, cam_from_world] : estimate) {
    errors.push_back((cam_from_world * world_from_true * truth.at(view).Inverse()).AngleDeg());
  }
  std::sort(errors.begin(), errors.end());
  const std::size_t last = errors.size() - 1;
  return {errors[last / 2], errors[last * 99 / 100], errors[last]};
}

}  // namespace rotslam
