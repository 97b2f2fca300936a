#include "rotodom/tracking/tracking.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include <Eigen/Dense>

#include "rotodom/matching/patch_alignment.h"
#include "rotodom/motion_blur/blurred_patch.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/relative_rotation/align_bearings.h"
#include "rotodom/types/median.h"
#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Search range of a patch on a coarse and on the finest level, in pixels of that level.
constexpr double kCoarseReachPx = 5.0;
constexpr double kFineReachPx = 3.0;
// Largest distance of the positions from two references. Beyond it the older reference shows
// something else.
constexpr double kSamePointPx = 1.0;
// Rotations below this do not warp a patch visibly.
constexpr double kVisibleRotationDeg = 1.0;
// Flow below this, beside that of the rotation, does not warp it visibly.
constexpr double kVisibleFlowPx = 2.0;
// Typical stretch and shear of a patch by parallax are its flow divided by this distance from the
// epipole, in focal lengths.
constexpr double kDepthScale = 0.15;
constexpr int kPatchBorderPx = 6;  // half a patch and a pixel for gradients

struct Candidate {
  TrackId track;
  int view = 0;
  int index = 0;
};

// Every point that is still tracked, with the newest view that sees it; ascending in `track`.
std::vector<Candidate> FindCandidates(std::span<const OrientedView> views, int max_points) {
  std::vector<Candidate> candidates;
  for (int view = 0; view < static_cast<int>(views.size()); ++view) {
    const Features& features = views[view].view->features;
    for (int index = 0; index < features.size(); ++index) {
      candidates.push_back({features.tracks[index], view, index});
    }
  }
  std::stable_sort(candidates.begin(),
                   candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.track < b.track; });
  const auto last =
      std::unique(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
        return a.track == b.track;
      });
  candidates.erase(last, candidates.end());
  std::erase_if(candidates, [&](const Candidate& candidate) {
    return views[candidate.view].view->is_lost[candidate.index];
  });
  auto room = max_points - std::count_if(candidates.begin(), candidates.end(), [](const auto& c) {
                return c.view == 0;
              });
  std::erase_if(candidates,
                [&](const Candidate& candidate) { return candidate.view > 0 && --room < 0; });
  return candidates;
}

struct Location {
  Eigen::Vector2d px;
  Eigen::Matrix2d covariance_px;
};

class Search {
 public:
  Search(std::span<const OrientedView> views,
         const TrackingTarget& target,
         const Camera& camera,
         const TrackingOptions& options)
      : views_(views), target_(target), camera_(camera), options_(options) {
    const int num_levels = static_cast<int>(target.pyramid->levels.size());
    coarsest_ = num_levels - 1;
    middle_ = num_levels / 2;
    SetOrientation(target.cam_from_world);
  }

  void SetOrientation(const Rotation& cam_from_world) {
    target_from_view_.clear();
    turns_patches_.clear();
    for (const OrientedView& view : views_) {
      target_from_view_.push_back(cam_from_world * view.cam_from_world.Inverse());
      turns_patches_.push_back(target_from_view_.back().AngleDeg() > kVisibleRotationDeg);
    }
    if (target_.exposure_s > 0.0) SetRates(cam_from_world);
  }

  // Predicted position of the point; nullopt outside the image and where it is masked.
  std::optional<Eigen::Vector2d> Expect(const Candidate& candidate) const {
    const View& view = *views_[candidate.view].view;
    std::optional<Eigen::Vector2d> px = Turn(candidate.view, candidate.index);
    if (!px) return std::nullopt;
    double ahead_s = target_.timestamp_s - view.timestamp_s;
    if (camera_.readout_s > 0.0) ahead_s += camera_.ExposureTime(*px);
    const Eigen::Vector2d flow = target_.flow
                                     ? target_.flow->At(view.features.keypoints_px[candidate.index])
                                     : view.flow_px_per_s[candidate.index];
    *px += flow * ahead_s;
    if (!IsVisible(*px, candidate)) return std::nullopt;
    return px;
  }

  // Rough position of a probe, with a larger search range.
  std::optional<Eigen::Vector2d> Probe(const Candidate& candidate, Eigen::Vector2d px) const {
    bool found = false;
    for (const int level : {coarsest_, middle_}) {
      const auto alignment = Align(candidate.view, candidate.index, level, px, kCoarseReachPx);
      found = alignment.has_value();
      if (alignment) px = alignment->px;
    }
    if (!found) return std::nullopt;
    return px;
  }

  std::optional<Location> Locate(const Candidate& candidate, Eigen::Vector2d px) const {
    if (const auto rough = Align(candidate.view, candidate.index, middle_, px, kCoarseReachPx)) {
      px = rough->px;
    }
    const auto first = Align(candidate.view, candidate.index, 0, px, kFineReachPx);
    if (!first) return std::nullopt;
    Eigen::Vector2d sum = first->px;
    int count = 1;
    for (int view = static_cast<int>(views_.size()) - 1;
         view > candidate.view && count < options_.num_references;
         --view) {
      const int index = FindTrack(views_[view].view->features, candidate.track);
      if (index < 0) continue;
      const auto again = Align(view, index, 0, first->px, kSamePointPx);
      if (!again) continue;
      sum += again->px;
      ++count;
    }
    const Eigen::Vector2d mean = sum / count;
    if (!IsVisible(mean, candidate)) return std::nullopt;
    return Location{mean, first->covariance_px};
  }

 private:
  bool IsInside(const Eigen::Vector2d& px) const {
    const cv::Mat& image = target_.pyramid->levels.front();
    return px.x() >= kPatchBorderPx && px.y() >= kPatchBorderPx &&
           px.x() < image.cols - 1 - kPatchBorderPx && px.y() < image.rows - 1 - kPatchBorderPx;
  }

  // Inside the image and not masked.
  bool IsVisible(const Eigen::Vector2d& px, const Candidate& candidate) const {
    const int level = views_[candidate.view].view->features.levels[candidate.index];
    return IsInside(px) && !target_.pyramid->IsMasked(px, level);
  }

  // Position of a view's point after the rotation alone, exposed at the time of the given pixel;
  // for nullopt at the time of its own row.
  std::optional<Eigen::Vector2d> Turn(
      int view_index,
      int index,
      const std::optional<Eigen::Vector2d>& shown_px = std::nullopt) const {
    const Eigen::Vector3d bearing =
        target_from_view_[view_index] * views_[view_index].view->features.bearings[index];
    std::optional<Eigen::Vector2d> px = camera_.Project(bearing);
    if (!px || camera_.readout_s == 0.0) return px;
    const double late_s = camera_.ExposureTime(shown_px.value_or(*px));
    return camera_.Project(target_.motion.After(late_s) * bearing);
  }

  // Corrects for the deformation of the patch by the flow that the rotation does not explain.
  PatchAlignment CorrectParallax(const PatchTemplate& patch,
                                 int view_index,
                                 int index,
                                 const PatchAlignment& found) const {
    const auto turned_px = Turn(view_index, index, found.center_px);
    if (!turned_px) return found;
    const Eigen::Vector2d flow_px = found.center_px - *turned_px;
    if (flow_px.norm() < kVisibleFlowPx) return found;
    const PatchParallax parallax{flow_px, flow_px.norm() / (kDepthScale * camera_.MeanFocal())};
    const auto corrected =
        CorrectForParallax(patch, target_.pyramid->levels.front(), found, parallax);
    if (!corrected || (corrected->center_px - found.center_px).norm() > kSamePointPx) return found;
    return *corrected;
  }

  void SetRates(const Rotation& cam_from_world) {
    std::vector<TimedOrientation> all = {{target_.timestamp_s, cam_from_world}};
    for (const OrientedView& view : views_) {
      all.push_back({view.view->timestamp_s, view.cam_from_world});
    }
    const auto rate_of = [&](const TimedOrientation& frame) {
      return RateThrough(frame, all, kFarthestFrameForBlur_s);
    };
    target_rate_ = rate_of(all.front());
    view_rates_.clear();
    std::transform(all.begin() + 1, all.end(), std::back_inserter(view_rates_), rate_of);
  }

  // Motion of a point during the exposure of either image, in pixels of a level.
  struct BlurVectors {
    Eigen::Vector2d in_view;
    Eigen::Vector2d in_target;
  };

  // nullopt where both are blurred alike, or the motion is not known.
  std::optional<BlurVectors> BlurVectorsOf(int view_index,
                                           int index,
                                           int level,
                                           const Eigen::Matrix2d& target_from_view_px) const {
    if (!target_rate_ || !view_rates_[view_index]) return std::nullopt;
    const Eigen::Vector3d& bearing = views_[view_index].view->features.bearings[index];
    const auto blur_vector = [&](const Eigen::Vector3d& shown, const Eigen::Vector3d& rate) {
      return Eigen::Vector2d(target_.pyramid->scales[level].cwiseInverse().asDiagonal() *
                             BlurVectorOf(camera_, shown, rate, target_.exposure_s));
    };
    const BlurVectors blur_vectors{
        blur_vector(bearing, *view_rates_[view_index]),
        blur_vector(target_from_view_[view_index] * bearing, *target_rate_)};
    if (AreBlurredAlike(target_from_view_px, blur_vectors.in_view, blur_vectors.in_target)) {
      return std::nullopt;
    }
    return blur_vectors;
  }

  bool IsAlike(const std::optional<PatchAlignment>& found) const {
    return found && found->correlation >= options_.min_correlation;
  }

  // Aligns the patch on one level; positions are in pixels of the level.
  std::optional<PatchAlignment> AlignAtLevel(int view_index,
                                             int index,
                                             int level,
                                             const Eigen::Vector2d& start_px,
                                             double reach_px) const {
    const View& view = *views_[view_index].view;
    const cv::Mat& image = view.pyramid.levels[level];
    const cv::Mat& target = target_.pyramid->levels[level];
    const Eigen::Vector2d center_px =
        view.pyramid.ToLevel(view.features.keypoints_px[index], level);
    const Eigen::Matrix2d warp =
        turns_patches_[view_index]
            ? PatchWarp(camera_, view.features.bearings[index], target_from_view_[view_index])
            : Eigen::Matrix2d(Eigen::Matrix2d::Identity());
    if (const auto blur_vectors = BlurVectorsOf(view_index, index, level, warp)) {
      return AlignBlurredPatch({image, center_px, warp, blur_vectors->in_view},
                               target,
                               start_px,
                               blur_vectors->in_target,
                               reach_px);
    }
    const auto patch = PatchTemplate::Sample(image, center_px, warp);
    if (!patch) return std::nullopt;
    const auto found = AlignPatch(*patch, target, start_px, reach_px);
    return level == 0 && IsAlike(found) ? CorrectParallax(*patch, view_index, index, *found)
                                        : found;
  }

  std::optional<Location> Align(
      int view_index, int index, int level, const Eigen::Vector2d& px, double reach_px) const {
    const auto found =
        AlignAtLevel(view_index, index, level, target_.pyramid->ToLevel(px, level), reach_px);
    if (!IsAlike(found)) return std::nullopt;
    const Eigen::Matrix2d scale = target_.pyramid->scales[level].asDiagonal();
    return Location{target_.pyramid->ToImage(found->center_px, level),
                    scale * found->covariance * scale};
  }

  std::span<const OrientedView> views_;
  const TrackingTarget& target_;
  const Camera& camera_;
  const TrackingOptions& options_;
  int coarsest_ = 0;
  int middle_ = 0;
  std::vector<Rotation> target_from_view_;
  std::vector<bool> turns_patches_;
  // Angular velocities, rad/s; set where they are known and the exposure time matters.
  std::optional<Eigen::Vector3d> target_rate_;
  std::vector<std::optional<Eigen::Vector3d>> view_rates_;
};

// Correction of the predicted rotation by the majority of the probes.
Rotation ProbeRotation(const Search& search,
                       const std::vector<Candidate>& candidates,
                       const Camera& camera,
                       int num_threads) {
  // Points that are sought first, over a longer way, to correct the predicted rotation: a tenth of
  // the features, so that the correction costs less than the tracking that it saves.
  constexpr std::size_t kNumProbes = 200;
  const std::size_t step = std::max<std::size_t>(1, candidates.size() / kNumProbes);
  std::vector<std::optional<BearingPair>> probes((candidates.size() + step - 1) / step);
  ParallelFor(static_cast<int>(probes.size()), num_threads, [&](int n) {
    const Candidate& candidate = candidates[static_cast<std::size_t>(n) * step];
    const auto expected_px = search.Expect(candidate);
    if (!expected_px) return;
    const auto found_px = search.Probe(candidate, *expected_px);
    if (!found_px) return;
    const auto expected = camera.Unproject(*expected_px);
    const auto found = camera.Unproject(*found_px);
    if (expected && found) probes[n] = BearingPair{*expected, *found};
  });
  std::vector<BearingPair> pairs;
  pairs.reserve(probes.size());
  for (const std::optional<BearingPair>& pair : probes) {
    if (pair) pairs.push_back(*pair);
  }
  return AlignMostBearings(pairs).value_or(Rotation());
}

}  // namespace

std::optional<std::string> TrackingOptions::Problem() const {
  if (!(min_correlation >= 0.0 && min_correlation < 1.0)) {
    return OutOfRange("min_correlation", min_correlation, "0 or more and below 1");
  }
  if (num_references < 1) return OutOfRange("num_references", num_references, "at least 1");
  if (min_points < 0) return OutOfRange("min_points", min_points, "zero or more");
  if (!(min_found_ratio >= 0.0 && min_found_ratio <= 1.0)) {
    return OutOfRange("min_found_ratio", min_found_ratio, "0 to 1");
  }
  return std::nullopt;
}

bool TrackingResult::IsPoor(const TrackingOptions& options) const {
  const int found = static_cast<int>(points.size());
  return found < options.min_points || found < options.min_found_ratio * num_sought;
}

std::optional<Rotation> AlignMostBearings(const std::vector<BearingPair>& pairs) {
  constexpr std::size_t kFewest = 10;
  constexpr int kRounds = 5;
  std::vector<BearingPair> kept = pairs;
  std::optional<Rotation> j_from_i;
  for (int round = 0; round < kRounds && kept.size() >= kFewest; ++round) {
    const auto aligned = AlignBearings(kept);
    if (!aligned) break;
    j_from_i = aligned;
    std::vector<double> errors;
    errors.reserve(pairs.size());
    for (const BearingPair& pair : pairs) {
      errors.push_back((*aligned * pair.bearing_i - pair.bearing_j).norm());
    }
    const double median = Median(errors);
    kept.clear();
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (errors[k] <= 1.5 * median) kept.push_back(pairs[k]);
    }
  }
  return j_from_i;
}

TrackingResult TrackPoints(std::span<const OrientedView> views,
                           const TrackingTarget& target,
                           const Camera& camera,
                           const TrackingOptions& options,
                           int num_threads) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("TrackingOptions: " + *problem);
  }
  TrackingResult result;
  result.cam_from_world = target.cam_from_world;
  const std::vector<Candidate> candidates = FindCandidates(views, target.max_points);
  Search search(views, target, camera, options);
  result.cam_from_world =
      ProbeRotation(search, candidates, camera, num_threads) * target.cam_from_world;
  search.SetOrientation(result.cam_from_world);

  constexpr int kChunk = 64;
  const int num_candidates = static_cast<int>(candidates.size());
  std::vector<std::optional<Location>> found(candidates.size());
  std::vector<char> is_sought(candidates.size(), 0);
  ParallelFor((num_candidates + kChunk - 1) / kChunk, num_threads, [&](int chunk) {
    const int end = std::min((chunk + 1) * kChunk, num_candidates);
    for (int k = chunk * kChunk; k < end; ++k) {
      const auto expected_px = search.Expect(candidates[k]);
      if (!expected_px) continue;
      is_sought[k] = 1;
      found[k] = search.Locate(candidates[k], *expected_px);
    }
  });
  for (int k = 0; k < num_candidates; ++k) {
    result.num_sought += is_sought[k];
    if (!found[k]) continue;
    const Candidate& candidate = candidates[k];
    result.points.push_back(
        {candidate.track, candidate.view, candidate.index, found[k]->px, found[k]->covariance_px});
  }
  return result;
}

}  // namespace rotslam
