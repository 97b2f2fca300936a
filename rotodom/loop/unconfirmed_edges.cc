#include "rotodom/loop/unconfirmed_edges.h"

#include <algorithm>

namespace rotslam {
namespace {

bool IsSame(const RelativeRotation& a, const RelativeRotation& b) {
  return a.i == b.i && a.j == b.j;
}

// Rotation between the worlds of the components of edge.i and edge.j.
Rotation WorldFromWorld(const RelativeRotation& edge, const RotationMap& cam_from_world) {
  return cam_from_world.at(edge.i).Inverse() * edge.j_from_i.Inverse() * cam_from_world.at(edge.j);
}

}  // namespace

void UnconfirmedEdges::Remove(const std::vector<EdgeWithMatches>& connections) {
  std::erase_if(unconfirmed_, [&](const EdgeWithMatches& unconfirmed) {
    return std::any_of(
        connections.begin(), connections.end(), [&](const EdgeWithMatches& connection) {
          return IsSame(unconfirmed.edge, connection.edge);
        });
  });
}

std::vector<EdgeWithMatches> UnconfirmedEdges::Confirmed(const EdgeWithMatches& connection,
                                                         const RotationMap& cam_from_world,
                                                         const DisjointSets& pieces) const {
  const RelativeRotation& edge = connection.edge;
  const Rotation turn = WorldFromWorld(edge, cam_from_world);
  std::vector<EdgeWithMatches> agreeing = {connection};
  const auto is_witness = [&](const EdgeWithMatches& other) {
    return std::all_of(agreeing.begin(), agreeing.end(), [&](const EdgeWithMatches& known) {
      const Rotation between =
          cam_from_world.at(other.edge.j) * cam_from_world.at(known.edge.j).Inverse();
      return between.AngleDeg() >= options_.min_witness_deg;
    });
  };
  int num_inliers = edge.num_inliers;
  for (const EdgeWithMatches& other : unconfirmed_) {
    const bool links_the_same = pieces.Find(other.edge.i.value) == pieces.Find(edge.i.value) &&
                                pieces.Find(other.edge.j.value) == pieces.Find(edge.j.value);
    if (!links_the_same) continue;
    const Rotation doubt = turn.Inverse() * WorldFromWorld(other.edge, cam_from_world);
    if (doubt.AngleDeg() > options_.max_cycle_deg) continue;
    if (!is_witness(other)) continue;
    num_inliers += other.edge.num_inliers;
    agreeing.push_back(other);
  }
  if (static_cast<int>(agreeing.size()) < options_.min_edges ||
      num_inliers < options_.sure_inliers) {
    return {};
  }
  std::stable_sort(
      agreeing.begin(), agreeing.end(), [](const EdgeWithMatches& a, const EdgeWithMatches& b) {
        return a.edge.covariance.trace() < b.edge.covariance.trace();
      });
  return agreeing;
}

}  // namespace rotslam
