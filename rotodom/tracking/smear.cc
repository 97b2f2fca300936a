#include "rotodom/tracking/smear.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "rotodom/tracking/shutter.h"

namespace rotslam {
namespace {

// Farther apart in time frames are no video.
constexpr double kFarthestNeighbour_s = 0.15;
// What is smeared more is not found again, or not taken for the same.
constexpr double kLongestSmear = 1.4;
// Over which the image's speed is worked out.
constexpr double kShortTime_s = 1e-3;

}  // namespace

TurningRates RatesOf(const RotationMap& cam_from_world,
                     const std::function<double(FrameId)>& time_s) {
  TurningRates rates;
  for (auto here = cam_from_world.begin(); here != cam_from_world.end(); ++here) {
    std::vector<TimedOrientation> others;
    const auto add = [&](RotationMap::const_iterator other) {
      if (std::abs(time_s(other->first) - time_s(here->first)) > kFarthestNeighbour_s) return;
      others.push_back({time_s(other->first), other->second});
    };
    if (here != cam_from_world.begin()) add(std::prev(here));
    if (std::next(here) != cam_from_world.end()) add(std::next(here));
    if (others.empty()) continue;
    rates[here->first] =
        MotionThrough({time_s(here->first), here->second}, others).coefficients.col(0);
  }
  return rates;
}

void SetSmears(const Camera& camera,
               const TurningRates& rates,
               double smear_s_per_px,
               std::vector<Track>& tracks) {
  for (Track& track : tracks) {
    for (Observation& observation : track.observations) {
      observation.smear.setZero();
      const auto rate = rates.find(observation.frame);
      if (rate == rates.end()) continue;
      const Eigen::Vector3d& bearing = observation.bearing;
      const auto now = camera.Project(bearing);
      const auto soon = camera.Project(bearing + kShortTime_s * rate->second.cross(bearing));
      if (!now || !soon) continue;
      const Eigen::Vector2d smear = smear_s_per_px / kShortTime_s * (*soon - *now);
      observation.smear = (smear * std::min(1.0, kLongestSmear / smear.norm())).cast<float>();
    }
  }
}

}  // namespace rotslam
