#include "apps/slam/live/place_links.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "krot/initialisation/resection.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// A link needs so many points that agree on it within so many pixels.
constexpr int kMinLinkPoints = 15;
constexpr double kMaxLinkErrorPx = 4.0;
// Smaller differences between a map and its loops are not corrected: a share of the depth and of
// the scale, and an angle.
constexpr double kMinCorrection = 0.01;
constexpr double kMinTurnRad = 0.2 * kRadFromDeg;

// A point of the older place in a newer keyframe.
struct SeenAgain {
  const RevisitedPoint* point;
  const Eigen::Vector3d* older_point;
  Eigen::Vector3d bearing;
};

// The keyframe after the older place that sees the most points of it, and these.
std::pair<FrameId, std::vector<SeenAgain>> MostSeenAgain(const RevisitedPlace& place,
                                                         const PlaceLinkSources& sources) {
  std::map<FrameId, std::vector<SeenAgain>> seen_by;
  for (const RevisitedPoint& point : place.points) {
    const auto track = sources.map.tracks().find(point.newer);
    const Eigen::Vector3d* older_point = sources.map.FindPoint(point.older);
    if (track == sources.map.tracks().end() || older_point == nullptr) continue;
    for (const Observation& seen : track->second.observations) {
      if (seen.frame <= place.older || !sources.chain.contains(seen.frame)) continue;
      seen_by[seen.frame].push_back({&point, older_point, seen.bearing});
    }
  }
  const auto most =
      std::max_element(seen_by.begin(), seen_by.end(), [](const auto& a, const auto& b) {
        return a.second.size() < b.second.size();
      });
  if (most == seen_by.end()) return {};
  return {most->first, std::move(most->second)};
}

}  // namespace

std::optional<VerifiedPlaceLink> FindPlaceLink(const RevisitedPlace& place,
                                               const PlaceLinkSources& sources) {
  const auto entry = sources.chain.find(place.older);
  if (entry == sources.chain.end()) return std::nullopt;
  const ChainedKeyframe& older = entry->second;
  const auto [newer, seen] = MostSeenAgain(place, sources);
  if (std::ssize(seen) < kMinLinkPoints) return std::nullopt;
  // Its orientation in the older keyframe's world.
  const Rotation newer_from_world = sources.cam_from_world.at(newer) *
                                    sources.cam_from_world.at(place.older).Inverse() *
                                    older.cam_from_world;
  std::vector<PosedRay> rays;
  rays.reserve(seen.size());
  for (const SeenAgain& one : seen) {
    rays.push_back({Rotation(), *one.older_point, -(newer_from_world.Inverse() * one.bearing)});
  }
  const auto resected =
      ResectCenter(rays, {kMaxLinkErrorPx / sources.focal_px, /*max_samples=*/200, sources.seed});
  if (!resected || std::ssize(resected->inliers) < kMinLinkPoints) return std::nullopt;
  VerifiedPlaceLink found;
  std::vector<double> ratios;
  for (const int n : resected->inliers) {
    found.points.push_back(seen[n].point);
    const Eigen::Vector3d* newer_point = sources.map.FindPoint(seen[n].point->newer);
    if (newer_point == nullptr) continue;
    ratios.push_back((*seen[n].older_point - resected->center_in_world).norm() /
                     (*newer_point - sources.chain.at(newer).center_in_world).norm());
  }
  if (std::ssize(ratios) < kMinLinkPoints) return std::nullopt;
  found.link.older = place.older;
  found.link.newer = newer;
  found.link.scale = Median(std::move(ratios));
  found.link.newer_in_older =
      older.cam_from_world * (resected->center_in_world - older.center_in_world);
  if (!(found.link.scale > 0.0) || !found.link.newer_in_older.allFinite()) return std::nullopt;
  return found;
}

bool Contradicts(const KeyframeChain& chain,
                 const RotationMap& cam_from_world,
                 const std::vector<PlaceLink>& links,
                 double depth) {
  for (const auto& [frame, keyframe] : chain) {
    const Rotation turn = cam_from_world.at(frame) * keyframe.cam_from_world.Inverse();
    if (turn.Angle() > kMinTurnRad) return true;
  }
  return std::any_of(links.begin(), links.end(), [&](const PlaceLink& link) {
    const ChainedKeyframe& older = chain.at(link.older);
    const ChainedKeyframe& newer = chain.at(link.newer);
    const Eigen::Vector3d gap = older.cam_from_world.Inverse() * link.newer_in_older -
                                (newer.center_in_world - older.center_in_world);
    return older.component != newer.component || std::abs(std::log(link.scale)) > kMinCorrection ||
           gap.norm() > kMinCorrection * depth;
  });
}

}  // namespace rotslam
