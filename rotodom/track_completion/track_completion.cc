#include "rotodom/track_completion/track_completion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include <Eigen/Dense>
#include <opencv2/imgproc.hpp>

#include "rotodom/features/features.h"
#include "rotodom/matching/patch_alignment.h"
#include "rotodom/motion_blur/blurred_patch.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Sought from where it was found, a patch must come back to within this.
constexpr double kMaxReturnPx = 0.5;
// Patches are compared where both views see the point from about the same side and as near: a plane
// that is turned by more, or larger by more, looks different.
constexpr double kMaxAngleDeg = 30.0;
constexpr double kMaxDistanceRatio = 1.5;

// A view with its pose.
struct PosedView {
  FrameId frame;
  const MapView* view = nullptr;
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world;
  std::vector<int> nearest;  // other views, by the distance of their centres
};

// Projection of a point into a view.
struct Place {
  Eigen::Vector2d mid_frame_px;  // in a global-shutter image
  Eigen::Vector2d image_px;      // in the actual image
  Eigen::Vector3d in_cam;        // at the exposure of its row
  Rotation cam_from_world;       // at the exposure of its row
  Eigen::Vector2d blur_px;       // image motion during the exposure
};

// A patch of one image that is searched in another.
struct SoughtPatch {
  const cv::Mat& image;
  Eigen::Vector2d center_px;
  Eigen::Vector2d blur_px;
};

double AngleRad(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

Eigen::Vector2d HalfPx(const Eigen::Vector2d& px) {
  return (0.5 * (px.array() + 0.5) - 0.5).matrix();
}
Eigen::Vector2d FullPx(const Eigen::Vector2d& half_px) {
  return (2.0 * (half_px.array() + 0.5) - 0.5).matrix();
}

class Completion {
 public:
  Completion(const Reconstruction& map,
             const MapViews& views,
             const Camera& camera,
             const CompletionOptions& options,
             int num_threads)
      : map_(map), camera_(camera), options_(options) {
    for (const auto& [frame, view] : views) {
      const auto rotation = map.cam_from_world.find(frame);
      const auto center = map.center_in_world.find(frame);
      if (rotation == map.cam_from_world.end() || center == map.center_in_world.end()) continue;
      index_[frame] = static_cast<int>(views_.size());
      views_.push_back({frame, &view, rotation->second, center->second, {}});
    }
    ParallelFor(static_cast<int>(views_.size()), num_threads, [&](int k) { ListNearest(k); });
  }

  Track Complete(const Track& track) const {
    const auto point = map_.point_in_world.find(track.id);
    if (point == map_.point_in_world.end()) return track;
    const Observation* reference = FindReference(track, point->second);
    if (reference == nullptr) return track;
    const PosedView& source = views_[index_.at(reference->frame)];
    const auto here = PlaceOf(source, point->second);
    if (!here) return track;
    std::map<FrameId, Observation> observations;
    for (const Observation& observation : track.observations) {
      observations[observation.frame] = observation;
    }
    for (const int to : source.nearest) {
      const auto found_px = Find(*reference, source, *here, views_[to], point->second);
      if (!found_px) continue;
      const auto bearing = camera_.Unproject(*found_px);
      if (!bearing) continue;
      const Observation found = {views_[to].frame, *found_px, *bearing, reference->sigma_px};
      const auto [known, is_new] = observations.try_emplace(found.frame, found);
      if (is_new || (known->second.keypoint_px - *found_px).norm() > kSamePointPx) continue;
      known->second = found;
    }
    Track completed = track;
    completed.observations.clear();
    for (const auto& [frame, observation] : observations) {
      completed.observations.push_back(observation);
    }
    return completed;
  }

 private:
  // The tracker's observation within this distance of the found position is replaced, px.
  static constexpr double kSamePointPx = 2.0;
  // Search range in the half-size image, px.
  static constexpr double kHalfReachPx = 5.0;

  void ListNearest(int k) {
    std::vector<int>& nearest = views_[k].nearest;
    for (int other = 0; other < std::ssize(views_); ++other) {
      if (other != k) nearest.push_back(other);
    }
    const auto by_distance = [&](int a, int b) {
      const double distance_a = (views_[a].center_in_world - views_[k].center_in_world).norm();
      const double distance_b = (views_[b].center_in_world - views_[k].center_in_world).norm();
      return std::pair(distance_a, a) < std::pair(distance_b, b);
    };
    const auto count = std::min<std::ptrdiff_t>(options_.max_views, std::ssize(nearest));
    std::partial_sort(nearest.begin(), nearest.begin() + count, nearest.end(), by_distance);
    nearest.resize(count);
    nearest.shrink_to_fit();
  }

  // The observation whose ray is in the middle of the others.
  const Observation* FindReference(const Track& track, const Eigen::Vector3d& point) const {
    const Observation* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    std::vector<std::pair<const Observation*, Eigen::Vector3d>> rays;
    for (const Observation& observation : track.observations) {
      const auto index = index_.find(observation.frame);
      if (index == index_.end()) continue;
      rays.emplace_back(&observation, (point - views_[index->second].center_in_world).normalized());
    }
    for (const auto& [observation, ray] : rays) {
      double sum = 0.0;
      for (const auto& [other, other_ray] : rays) sum += AngleRad(ray, other_ray);
      if (!(sum < least)) continue;
      least = sum;
      best = observation;
    }
    return best;
  }

  std::optional<Place> PlaceOf(const PosedView& view, const Eigen::Vector3d& point) const {
    Place place;
    place.cam_from_world = view.cam_from_world;
    place.in_cam = view.cam_from_world * Eigen::Vector3d(point - view.center_in_world);
    const auto px = camera_.Project(place.in_cam);
    if (!px) return std::nullopt;
    place.mid_frame_px = place.image_px = *px;
    // With a rolling shutter the pose depends on the row, and the row on the pose: fixed-point
    // iteration.
    const int num_rounds = camera_.readout_s == 0.0 ? 0 : 2;
    for (int k = 0; k < num_rounds; ++k) {
      const double late_s = camera_.ExposureTime(place.image_px);
      place.cam_from_world = view.view->motion.After(late_s) * view.cam_from_world;
      place.in_cam = place.cam_from_world *
                     Eigen::Vector3d(point - view.center_in_world - late_s * view.view->velocity);
      const auto late_px = camera_.Project(place.in_cam);
      if (!late_px) return std::nullopt;
      place.image_px = *late_px;
    }
    place.blur_px =
        BlurVectorOf(camera_, place.in_cam.normalized(), view.view->rotation_while_exposed, 1.0);
    return place;
  }

  // Position of the patch in the other image, with both blurred alike.
  std::optional<PatchAlignment> Align(const SoughtPatch& patch,
                                      const Eigen::Matrix2d& warp,
                                      const SoughtPatch& in) const {
    if (!AreBlurredAlike(warp, patch.blur_px, in.blur_px)) {
      return AlignBlurredPatch({patch.image, patch.center_px, warp, patch.blur_px},
                               in.image,
                               in.center_px,
                               in.blur_px,
                               options_.reach_px);
    }
    const auto sampled = PatchTemplate::Sample(patch.image, patch.center_px, warp);
    if (!sampled) return std::nullopt;
    return AlignPatch(*sampled, in.image, in.center_px, options_.reach_px);
  }

  bool IsInside(const Eigen::Vector2d& px) const {
    constexpr double kBorderPx = 7.0;
    return px.x() >= kBorderPx && px.y() >= kBorderPx && px.x() < camera_.width - 1 - kBorderPx &&
           px.y() < camera_.height - 1 - kBorderPx;
  }

  // Maps offsets in one image to offsets in the other, for a plane that faces both cameras.
  std::optional<Eigen::Matrix2d> Warp(const Place& from, const Place& to) const {
    const Eigen::Vector3d normal = (from.cam_from_world.Inverse() * from.in_cam.normalized() +
                                    to.cam_from_world.Inverse() * to.in_cam.normalized())
                                       .normalized();
    const Eigen::Vector3d u = normal.unitOrthogonal();
    Eigen::Matrix<double, 3, 2> plane;
    plane << u, normal.cross(u);
    Eigen::Matrix<double, 2, 3> J_from;
    Eigen::Matrix<double, 2, 3> J_to;
    if (!camera_.Project(from.in_cam, &J_from) || !camera_.Project(to.in_cam, &J_to)) {
      return std::nullopt;
    }
    const Eigen::Matrix2d from_plane = J_from * from.cam_from_world.Matrix() * plane;
    const Eigen::Matrix2d to_plane = J_to * to.cam_from_world.Matrix() * plane;
    return Eigen::Matrix2d(to_plane * from_plane.inverse());
  }

  // Position in the target, in a global-shutter image, of the patch around the reference's keypoint
  // in the source.
  // @param here  projection of the point into the source.
  std::optional<Eigen::Vector2d> Find(const Observation& reference,
                                      const PosedView& source,
                                      const Place& here,
                                      const PosedView& target,
                                      const Eigen::Vector3d& point) const {
    const Eigen::Vector3d source_ray = point - source.center_in_world;
    const Eigen::Vector3d target_ray = point - target.center_in_world;
    const double ratio = source_ray.norm() / target_ray.norm();
    if (!(ratio <= kMaxDistanceRatio && 1.0 <= ratio * kMaxDistanceRatio)) {
      return std::nullopt;
    }
    if (AngleRad(source_ray, target_ray) > kMaxAngleDeg * kRadFromDeg) {
      return std::nullopt;
    }
    const auto there = PlaceOf(target, point);
    if (!there || !IsInside(there->image_px)) return std::nullopt;
    if (target.view->mask.Covers(there->image_px, kCornerReachPx)) return std::nullopt;
    const Eigen::Vector2d source_px = reference.keypoint_px + (here.image_px - here.mid_frame_px);
    const auto warp = Warp(here, *there);
    if (!warp) return std::nullopt;

    Eigen::Vector2d px = there->image_px;
    if (const auto half = PatchTemplate::Sample(source.view->half, HalfPx(source_px), *warp)) {
      const auto rough = AlignPatch(*half, target.view->half, HalfPx(px), kHalfReachPx);
      if (rough && rough->correlation >= options_.min_correlation) px = FullPx(rough->center_px);
    }
    const SoughtPatch patch{source.view->image, source_px, here.blur_px};
    const auto found = Align(patch, *warp, {target.view->image, px, there->blur_px});
    if (!found || found->correlation < options_.min_correlation) return std::nullopt;
    if ((found->center_px - there->image_px).norm() > options_.reach_px) return std::nullopt;
    if (target.view->mask.Covers(found->center_px, kCornerReachPx)) return std::nullopt;
    const auto returned =
        Align({target.view->image, found->center_px, there->blur_px}, warp->inverse(), patch);
    if (!returned || (returned->center_px - source_px).norm() > kMaxReturnPx) {
      return std::nullopt;
    }
    return Eigen::Vector2d(found->center_px - (there->image_px - there->mid_frame_px));
  }

  const Reconstruction& map_;
  const Camera& camera_;
  const CompletionOptions& options_;
  std::vector<PosedView> views_;
  std::map<FrameId, int> index_;
};

}  // namespace

std::optional<std::string> CompletionOptions::Problem() const {
  if (!(reach_px > 0.0)) return OutOfRange("reach_px", reach_px, "positive");
  if (!(min_correlation > 0.0 && min_correlation < 1.0)) {
    return OutOfRange("min_correlation", min_correlation, "above 0 and below 1");
  }
  if (max_views < 1) return OutOfRange("max_views", max_views, "at least 1");
  return std::nullopt;
}

MapView MakeMapView(const MaskedImage& image) {
  MapView view;
  view.image = ToGrey(image.image);
  view.mask = image.mask;
  // The last row or column of an odd size is dropped.
  const cv::Size half(view.image.cols / 2, view.image.rows / 2);
  cv::resize(view.image(cv::Rect(0, 0, 2 * half.width, 2 * half.height)),
             view.half,
             half,
             0.0,
             0.0,
             cv::INTER_AREA);
  return view;
}

std::vector<Track> CompleteTracks(const Reconstruction& map,
                                  const MapViews& views,
                                  const Camera& camera,
                                  const CompletionOptions& options,
                                  int num_threads) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("CompletionOptions: " + *problem);
  }
  const Completion completion(map, views, camera, options, num_threads);
  std::vector<Track> tracks(map.tracks.size());
  ParallelFor(static_cast<int>(tracks.size()), num_threads, [&](int k) {
    tracks[k] = completion.Complete(map.tracks[k]);
  });
  return tracks;
}

}  // namespace rotslam
