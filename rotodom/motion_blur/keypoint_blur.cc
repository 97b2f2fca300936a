#include "rotodom/motion_blur/keypoint_blur.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace rotslam {
namespace {

// Largest blur vector, px: keypoints with more blur are not tracked or matched.
constexpr double kLongestBlur = 1.4;
// Time step of the numerical derivative of the image position.
constexpr double kShortTime_s = 1e-3;

}  // namespace

std::optional<Eigen::Vector3d> RateThrough(const TimedOrientation& frame,
                                           std::span<const TimedOrientation> others,
                                           double farthest_s) {
  constexpr std::size_t kMostOthers = 2;
  const auto distance_s = [&](const TimedOrientation& other) {
    return std::abs(other.time_s - frame.time_s);
  };
  std::vector<TimedOrientation> nearest;
  for (const TimedOrientation& other : others) {
    if (other.time_s != frame.time_s && distance_s(other) <= farthest_s) {
      nearest.push_back(other);
    }
  }
  if (nearest.empty()) return std::nullopt;
  std::stable_sort(nearest.begin(), nearest.end(), [&](const auto& a, const auto& b) {
    return distance_s(a) < distance_s(b);
  });
  if (nearest.size() > kMostOthers) nearest.resize(kMostOthers);
  return MotionThrough(frame, nearest).coefficients.col(0);
}

std::optional<Eigen::Vector3d> RateOf(FrameId frame,
                                      const RotationMap& cam_from_world,
                                      const std::function<double(FrameId)>& time_s,
                                      double farthest_s) {
  const auto here = cam_from_world.find(frame);
  if (here == cam_from_world.end()) return std::nullopt;
  std::vector<TimedOrientation> others;
  const auto add = [&](RotationMap::const_iterator other) {
    others.push_back({time_s(other->first), other->second});
  };
  if (here != cam_from_world.begin()) add(std::prev(here));
  if (std::next(here) != cam_from_world.end()) add(std::next(here));
  return RateThrough({time_s(frame), here->second}, others, farthest_s);
}

RotationRates RatesOf(const RotationMap& cam_from_world,
                      const std::function<double(FrameId)>& time_s) {
  RotationRates rates;
  for (const auto& [frame, orientation] : cam_from_world) {
    if (const auto rate = RateOf(frame, cam_from_world, time_s)) rates[frame] = *rate;
  }
  return rates;
}

Eigen::Vector2d BlurVectorOf(const Camera& camera,
                             const Eigen::Vector3d& bearing,
                             const Eigen::Vector3d& rate,
                             double blur_s_per_px) {
  const auto now = camera.Project(bearing);
  const auto soon = camera.Project(bearing + kShortTime_s * rate.cross(bearing));
  if (!now || !soon) return Eigen::Vector2d::Zero();
  return blur_s_per_px / kShortTime_s * (*soon - *now);
}

void SetMotionBlur(const Camera& camera,
                   const RotationRates& rates,
                   double blur_s_per_px,
                   std::vector<Track>& tracks) {
  for (Track& track : tracks) {
    for (Observation& observation : track.observations) {
      observation.blur.setZero();
      const auto rate = rates.find(observation.frame);
      if (rate == rates.end()) continue;
      const Eigen::Vector2d blur =
          BlurVectorOf(camera, observation.bearing, rate->second, blur_s_per_px);
      observation.blur = (blur * std::min(1.0, kLongestBlur / blur.norm())).cast<float>();
    }
  }
}

}  // namespace rotslam
