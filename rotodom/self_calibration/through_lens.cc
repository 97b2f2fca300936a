#include "rotodom/self_calibration/through_lens.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/SVD>

#include "rotodom/averaging/global_averaging.h"
#include "rotodom/types/parallel.h"
#include "rotodom/view_graph/shared_points.h"

namespace rotslam {
namespace {

std::map<FrameId, Features> WithBearings(std::map<FrameId, Features> features,
                                         const Camera& camera,
                                         int num_threads) {
  std::vector<Features*> frames;
  frames.reserve(features.size());
  for (auto& [frame, of_frame] : features) frames.push_back(&of_frame);
  ParallelFor(static_cast<int>(frames.size()), num_threads, [&](int n) {
    Features& of_frame = *frames[n];
    for (std::size_t k = 0; k < of_frame.keypoints_px.size(); ++k) {
      // Beyond the fold of the distortion nothing is seen: the bearing of before is an outlier.
      if (const auto bearing = camera.Unproject(of_frame.keypoints_px[k])) {
        of_frame.bearings[k] = *bearing;
      }
    }
  });
  return features;
}

// The keypoints that an edge's views share: by their tracks, or, of places that were matched by
// descriptors, those of the edge.
std::vector<std::array<int, 2>> SharedKeypoints(const Features& i,
                                                const Features& j,
                                                const EdgeMatches& matches) {
  std::vector<std::array<int, 2>> keypoints = FindCommonPoints(i, j);
  return keypoints.size() < matches.pairs.size() ? matches.pairs : keypoints;
}

// Bearings of a grid of pixels through a lens.
struct GridRay {
  Eigen::Vector3d from;
  Eigen::Vector3d to;
};

std::vector<GridRay> GridRays(const Camera& from, const Camera& to) {
  constexpr int kSteps = 8;
  std::vector<GridRay> rays;
  for (int row = 0; row < kSteps; ++row) {
    for (int column = 0; column < kSteps; ++column) {
      const Eigen::Vector2d pixel((column + 0.5) / kSteps * from.width - 0.5,
                                  (row + 0.5) / kSteps * from.height - 0.5);
      const auto before = from.Unproject(pixel);
      const auto after = to.Unproject(pixel);
      if (before && after) rays.push_back({*before, *after});
    }
  }
  return rays;
}

// The rotation that leads the rays through the lens `to` to the pixels that `j_from_i` leads those
// through `from` to; nullopt: few of them lie in the image.
std::optional<Rotation> TurnedThroughLens(const Rotation& j_from_i,
                                          const std::vector<GridRay>& rays,
                                          const Camera& from,
                                          const Camera& to) {
  constexpr int kLeastRays = 8;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  int num_rays = 0;
  for (const GridRay& ray : rays) {
    const auto pixel = from.Project(j_from_i * ray.from);
    if (!pixel || !(pixel->minCoeff() > -0.5 && pixel->x() < from.width - 0.5 &&
                    pixel->y() < from.height - 0.5)) {
      continue;
    }
    const auto there = to.Unproject(*pixel);
    if (!there) continue;
    sum += *there * ray.to.transpose();
    ++num_rays;
  }
  if (num_rays < kLeastRays) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d V = svd.matrixV();
  if ((svd.matrixU() * V.transpose()).determinant() < 0.0) V.col(2) *= -1.0;
  return Rotation::FromMatrix(svd.matrixU() * V.transpose());
}

}  // namespace

ViewGraph TurnedThroughLens(const ViewGraph& graph, const Camera& from, const Camera& to) {
  const std::vector<GridRay> rays = GridRays(from, to);
  // How far a lens takes parallax for rotation: as far as its rays are off, as a share.
  double square_sum = 0.0;
  for (const GridRay& ray : rays) square_sum += (ray.to - ray.from).squaredNorm();
  const double change = std::sqrt(square_sum / std::max(1.0, static_cast<double>(rays.size())));
  ViewGraph turned;
  for (RelativeRotation edge : graph.edges()) {
    const double error_rad = change * edge.parallax_px / to.MeanFocal();
    edge.covariance += error_rad * error_rad * Eigen::Matrix3d::Identity();
    if (const auto rotation = TurnedThroughLens(edge.j_from_i, rays, from, to)) {
      edge.j_from_i = *rotation;
    }
    turned.AddEdge(edge);
  }
  return turned;
}

OdometryResult ThroughLens(const OdometryResult& tracked,
                           const Camera& camera,
                           const OdometryOptions& options,
                           std::uint64_t seed,
                           int num_threads) {
  OdometryResult result;
  result.features = WithBearings(tracked.features, camera, num_threads);
  result.covariance = tracked.covariance;
  const EdgeOptions edge_options = {options.relative_rotation, seed, 1};
  std::vector<std::optional<EdgeWithMatches>> edges(tracked.edge_matches.size());
  ParallelFor(static_cast<int>(edges.size()), num_threads, [&](int n) {
    const EdgeMatches& matches = tracked.edge_matches[n];
    const Features& i = result.features.at(matches.frame_i);
    const Features& j = result.features.at(matches.frame_j);
    const RelativeRotation* edge = tracked.graph.FindEdge(matches.frame_i, matches.frame_j);
    if (edge == nullptr) return;
    const Rotation predicted =
        edge->i == matches.frame_i ? edge->j_from_i : edge->j_from_i.Inverse();
    const std::vector<std::array<int, 2>> keypoints = SharedKeypoints(i, j, matches);
    edges[n] = EstimateEdge({i, j, keypoints}, predicted, camera.MeanFocal(), edge_options);
  });
  for (std::optional<EdgeWithMatches>& edge : edges) {
    if (!edge) continue;
    result.graph.AddEdge(edge->edge);
    result.edge_matches.push_back(std::move(edge->matches));
  }
  result.cam_from_world = tracked.cam_from_world;
  if (result.graph.edges().empty()) return result;
  for (const auto& [frame, rotation] :
       CloseLoops(result.graph.edges(), tracked.cam_from_world, options.averaging, num_threads)
           .cam_from_world) {
    result.cam_from_world[frame] = rotation;
  }
  return result;
}

}  // namespace rotslam
