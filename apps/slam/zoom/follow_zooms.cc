#include "apps/slam/zoom/follow_zooms.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "apps/slam/zoom/without_zoom.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

constexpr int kMostZooms = 10;

// Focal lengths that differ by less are the same: a calibration is refined by less.
constexpr double kSameFocal = 0.01;

// How well the pairs of frames agree that have different focal lengths.
struct Agreement {
  int num_inliers = 0;
  double noise_px = 0.0;  // median of the pairs, in pixels of the images
};

// @param is_without  whether the edges are those of keypoints without the zoom.
Agreement AgreementOf(const ViewGraph& graph, const FocalScales& scales, bool is_without) {
  Agreement agreement;
  std::vector<double> noises_px;
  for (const RelativeRotation& edge : graph.edges()) {
    const double scale_i = ScaleOf(scales, edge.i);
    const double scale_j = ScaleOf(scales, edge.j);
    if (scale_i == scale_j) continue;
    agreement.num_inliers += edge.num_inliers;
    noises_px.push_back(edge.noise_px * (is_without ? std::sqrt(scale_i * scale_j) : 1.0));
  }
  agreement.noise_px = Median(std::move(noises_px));
  return agreement;
}

bool IsBetter(const Agreement& with, const Agreement& without) {
  constexpr double kLessNoise = 0.95;
  constexpr double kInliers = 0.9;
  return with.noise_px < kLessNoise * without.noise_px &&
         with.num_inliers > kInliers * without.num_inliers;
}

}  // namespace

std::optional<ZoomsFollowed> FollowZooms(const OdometryResult& filmed,
                                         const Camera& camera,
                                         const std::vector<Zoom>& zooms,
                                         const MapOfPart& map_of_part,
                                         const ZoomOptions& options) {
  ZoomsFollowed result;
  result.camera = camera;
  std::vector<Zoom> found = zooms;
  std::vector<Zoom> followed;
  while (std::ssize(followed) < kMostZooms) {
    const auto next = std::find_if(found.begin(), found.end(), [&](const Zoom& zoom) {
      return followed.empty() || zoom.first > followed.back().last;
    });
    if (next == found.end()) break;
    const OdometryResult& odometry = followed.empty() ? filmed : result.odometry;
    const auto zoom = FollowZoom(odometry, result.camera, *next, map_of_part);
    if (!zoom) break;
    // The map of the frames before the first zoom knows an estimated lens better.
    const double refined = zoom->camera.MeanFocal() / camera.MeanFocal();
    if (followed.empty() && std::abs(refined - 1.0) > kSameFocal) result.camera = zoom->camera;
    for (const auto& [frame, scale] : zoom->scales) {
      result.scales[frame] = scale * ScaleOf(result.scales, frame);
    }
    followed.push_back(zoom->zoom);
    result.odometry = WithoutZoom(
        filmed, result.camera, result.scales, options.odometry, options.seed, options.num_threads);
    found = FindZooms(result.camera,
                      result.odometry.features,
                      result.odometry.graph,
                      options.odometry.relative_rotation);
  }
  if (followed.empty() || !IsBetter(AgreementOf(result.odometry.graph, result.scales, true),
                                    AgreementOf(filmed.graph, result.scales, false))) {
    return std::nullopt;
  }
  result.zooms = std::move(followed);
  result.zooms.insert(result.zooms.end(), found.begin(), found.end());
  std::sort(result.zooms.begin(), result.zooms.end(), [](const Zoom& a, const Zoom& b) {
    return a.first < b.first;
  });
  return result;
}

bool IsFollowed(const Zoom& zoom, const FocalScales& scales) {
  constexpr double kTolerance = 0.02;
  const double change = ScaleOf(scales, zoom.last) / ScaleOf(scales, FrameId{zoom.first.value - 1});
  return std::abs(std::log(change / zoom.factor)) < kTolerance;
}

}  // namespace rotslam
