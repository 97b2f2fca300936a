#include "apps/slam/zoom/follow_zooms.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "apps/slam/zoom/without_zoom.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

constexpr int kMostZooms = 10;

// A zoom out of a camera that moves ahead is noticed late: it is followed from so many frames
// before, too.
constexpr std::array kFramesEarlier = {0, 20};

// Focal lengths that differ by less are the same: a calibration is refined by less.
constexpr double kSameFocal = 0.01;

// How well the pairs of frames agree that have different focal lengths.
struct Agreement {
  int num_inliers = 0;
  double noise_px = 0.0;  // median of the pairs, in pixels of the images
};

// @param changes    focal lengths that tell these pairs.
// @param taken_out  of the zooms that are taken out of the keypoints.
Agreement AgreementOf(const ViewGraph& graph,
                      const FocalScales& changes,
                      const FocalScales& taken_out) {
  Agreement agreement;
  std::vector<double> noises_px;
  for (const RelativeRotation& edge : graph.edges()) {
    if (ScaleOf(changes, edge.i) == ScaleOf(changes, edge.j)) continue;
    agreement.num_inliers += edge.num_inliers;
    noises_px.push_back(edge.noise_px *
                        std::sqrt(ScaleOf(taken_out, edge.i) * ScaleOf(taken_out, edge.j)));
  }
  agreement.noise_px = Median(std::move(noises_px));
  return agreement;
}

bool IsBetter(const Agreement& with, const Agreement& without) {
  constexpr double kInliers = 0.9;
  return with.noise_px < without.noise_px && with.num_inliers > kInliers * without.num_inliers;
}

// Follows one zoom more than before. Five parameters: those of FollowZooms, with what was followed.
// @return  nullopt where it cannot be, or where pairs of frames do not agree better then.
std::optional<ZoomsFollowed> FollowNext(const OdometryResult& filmed,
                                        const ZoomsFollowed& before,
                                        const Zoom& zoom,
                                        const MapOfPart& map_of_part,
                                        const ZoomOptions& options) {
  const auto one = FollowZoom(before.odometry, before.camera, zoom, map_of_part);
  if (!one) return std::nullopt;
  ZoomsFollowed after;
  after.camera = before.camera;
  // The map of the frames before the first zoom knows an estimated lens better.
  const double refined = one->camera.MeanFocal() / before.camera.MeanFocal();
  if (before.zooms.empty() && std::abs(refined - 1.0) > kSameFocal) after.camera = one->camera;
  after.scales = before.scales;
  for (const auto& [frame, scale] : one->scales) {
    after.scales[frame] = scale * ScaleOf(before.scales, frame);
  }
  after.odometry = WithoutZoom(
      filmed, after.camera, after.scales, options.odometry, options.seed, options.num_threads);
  if (!IsBetter(AgreementOf(after.odometry.graph, one->scales, after.scales),
                AgreementOf(before.odometry.graph, one->scales, before.scales))) {
    return std::nullopt;
  }
  after.zooms = before.zooms;
  after.zooms.push_back(one->zoom);
  return after;
}

}  // namespace

std::optional<ZoomsFollowed> FollowZooms(const OdometryResult& filmed,
                                         const Camera& camera,
                                         const std::vector<Zoom>& zooms,
                                         const MapOfPart& map_of_part,
                                         const ZoomOptions& options) {
  ZoomsFollowed result = {camera, {}, filmed, {}};
  std::vector<Zoom> found = zooms;
  while (std::ssize(result.zooms) < kMostZooms) {
    const auto next = std::find_if(found.begin(), found.end(), [&](const Zoom& zoom) {
      return result.zooms.empty() || zoom.first > result.zooms.back().last;
    });
    if (next == found.end()) break;
    std::optional<ZoomsFollowed> followed;
    for (const int frames_earlier : kFramesEarlier) {
      Zoom zoom = *next;
      zoom.first.value -= frames_earlier;
      followed = FollowNext(filmed, result, zoom, map_of_part, options);
      if (followed) break;
    }
    if (!followed) break;
    result = *std::move(followed);
    found = FindZooms(result.camera,
                      result.odometry.features,
                      result.odometry.graph,
                      options.odometry.relative_rotation);
  }
  if (result.zooms.empty()) return std::nullopt;
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
