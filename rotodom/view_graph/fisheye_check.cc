#include "rotodom/view_graph/fisheye_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rotodom/features/view.h"
#include "rotodom/view_graph/shared_points.h"

namespace rotslam {
namespace {

constexpr int kCheckedPairs = 12;
constexpr std::size_t kMostPointsOfFisheyes = 300;  // of a pair
// Points that a pair of views must share.
constexpr int kLeastSharedPoints = 60;
// Share of the points that the right camera explains: outliers are things that move.
constexpr double kExplained = 0.8;

// Between the points that are used.
std::size_t StepOver(const std::vector<SharedPoint>& points) {
  return 1 + points.size() / kMostPointsOfFisheyes;
}

// Number of points that fit one relative pose through `camera`.
int NumExplained(const std::vector<SharedPoint>& points,
                 const Camera& camera,
                 const Rotation& predicted,
                 const RelativeRotationOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  std::vector<BearingPair> bearings;
  for (std::size_t k = 0; k < points.size(); k += StepOver(points)) {
    const auto& [i_px, j_px] = points[k];
    const auto i = camera.Unproject(i_px);
    const auto j = camera.Unproject(j_px);
    if (i && j) bearings.push_back({*i, *j});
  }
  const auto estimate =
      EstimateRelativeRotation({bearings}, predicted, camera.MeanFocal(), options, kSeed);
  return estimate ? static_cast<int>(estimate->inliers.size()) : 0;
}

// Of each part of the sequence, the edge with the largest rotation. Small ones tell nothing: a
// baseline that is not there explains their flow through any lens.
std::vector<const RelativeRotation*> LargestRotations(const std::map<FrameId, Features>& features,
                                                      const ViewGraph& graph) {
  const int num_frames = static_cast<int>(features.size());
  std::vector<const RelativeRotation*> of_parts(kCheckedPairs, nullptr);
  int number = 0;
  for (const auto& [frame, of_frame] : features) {
    const RelativeRotation*& largest = of_parts[number++ * kCheckedPairs / num_frames];
    for (const int position : graph.EdgesOf(frame)) {
      const RelativeRotation& edge = graph.edges()[position];
      if (edge.j != frame || !features.contains(edge.i)) continue;
      if (largest != nullptr && edge.j_from_i.AngleDeg() <= largest->j_from_i.AngleDeg()) continue;
      if (CountCommonTracks(features.at(edge.i), of_frame) < kLeastSharedPoints) continue;
      largest = &edge;
    }
  }
  std::erase(of_parts, nullptr);
  return of_parts;
}

// Whether the corner of the image is so far from the axis that the projections differ there.
bool IsWide(const Camera& camera) {
  constexpr double kLeast = 0.58;  // tan of 30 deg
  const double x = std::max(camera.cx, camera.width - camera.cx) / camera.fx;
  const double y = std::max(camera.cy, camera.height - camera.cy) / camera.fy;
  return std::hypot(x, y) > kLeast;
}

// Equidistant lenses in the place of `camera`.
std::vector<Camera> FisheyesFor(const Camera& camera) {
  // A focal length that was guessed, or fitted by another projection, may be off by as much.
  constexpr std::array<double, 3> kFactors = {0.7, 1.0, 1.4};
  std::vector<Camera> fisheyes;
  for (const double factor : kFactors) {
    Camera fisheye = camera;
    fisheye.model = CameraModel::kEquidistant;
    fisheye.distortion = {};
    fisheye.fx *= factor;
    fisheye.fy *= factor;
    fisheyes.push_back(fisheye);
  }
  return fisheyes;
}

}  // namespace

bool FisheyeCheck::IsFisheye() const {
  constexpr int kLeastPairs = 5;
  constexpr double kMajority = 0.7;  // of the pairs
  constexpr double kBetter = 1.15;   // as many points
  return num_pairs >= kLeastPairs && num_pairs_for_fisheye >= kMajority * num_pairs &&
         num_by_fisheye >= kBetter * num_by_camera;
}

FisheyeCheck CheckForFisheye(const Camera& camera,
                             const std::map<FrameId, Features>& features,
                             const ViewGraph& graph,
                             const RelativeRotationOptions& options) {
  FisheyeCheck check;
  const bool may_be = camera.model == CameraModel::kPinhole ||
                      camera.model == CameraModel::kRadtan ||
                      camera.model == CameraModel::kRational;
  if (!may_be || !IsWide(camera)) return check;
  const std::vector<const RelativeRotation*> edges = LargestRotations(features, graph);
  std::vector<int> by_camera;
  for (const RelativeRotation* edge : edges) {
    const auto points = SharedPoints(features.at(edge->i), features.at(edge->j));
    by_camera.push_back(NumExplained(points, camera, edge->j_from_i, options));
    check.num_points += static_cast<int>((points.size() - 1) / StepOver(points) + 1);
    check.num_by_camera += by_camera.back();
  }
  check.num_pairs = static_cast<int>(edges.size());
  if (check.num_by_camera >= kExplained * check.num_points) return check;
  for (const Camera& fisheye : FisheyesFor(camera)) {
    constexpr double kClearly = 1.1;  // as many points of a pair
    int num_pairs = 0;
    int num_points = 0;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const auto points = SharedPoints(features.at(edges[k]->i), features.at(edges[k]->j));
      const int num = NumExplained(points, fisheye, edges[k]->j_from_i, options);
      num_points += num;
      num_pairs += num > kClearly * by_camera[k] ? 1 : 0;
    }
    if (num_points <= check.num_by_fisheye) continue;
    check.num_by_fisheye = num_points;
    check.num_pairs_for_fisheye = num_pairs;
  }
  return check;
}

}  // namespace rotslam
