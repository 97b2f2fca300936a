#include "rotodom/view_graph/estimate_edges.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"
#include "rotodom/view_graph/consistency.h"
#include "rotodom/view_graph/shared_points.h"

namespace rotslam {
namespace {

// Covariances of the keypoints; zero for both where a keypoint is a new corner, empty where a view
// has none.
std::vector<KeypointCovariances> CovariancesOf(const MatchedViews& views) {
  const auto& [view_i, view_j, keypoints, noise] = views;
  const auto knows = [](const Features& view) {
    return std::ssize(view.covariances_px) == view.size();
  };
  std::vector<KeypointCovariances> covariances;
  if (!knows(view_i) || !knows(view_j)) return covariances;
  covariances.reserve(keypoints.size());
  for (const auto& [of_i, of_j] : keypoints) {
    covariances.push_back(
        {view_i.covariances_px[of_i].cast<double>(), view_j.covariances_px[of_j].cast<double>()});
  }
  return covariances;
}

// Makes an edge of an estimate and its keypoints.
EdgeWithMatches EdgeWithMatchesOf(const RelativeRotationEstimate& estimate,
                                  FrameId i,
                                  FrameId j,
                                  const std::vector<std::array<int, 2>>& keypoints) {
  EdgeWithMatches connection;
  connection.edge.i = connection.matches.frame_i = i;
  connection.edge.j = connection.matches.frame_j = j;
  connection.edge.j_from_i = estimate.j_from_i;
  connection.edge.covariance = estimate.covariance;
  connection.edge.translation_direction = estimate.translation_direction;
  connection.edge.num_inliers = static_cast<int>(estimate.inliers.size());
  connection.edge.rotation_only = estimate.rotation_only;
  connection.edge.baseline_strength = estimate.baseline.strength;
  connection.edge.noise_px = estimate.noise_px;
  connection.edge.parallax_px = estimate.parallax_px;
  std::size_t next_inlier = 0;
  for (int k = 0; k < static_cast<int>(keypoints.size()); ++k) {
    if (next_inlier < estimate.inliers.size() && estimate.inliers[next_inlier] == k) {
      connection.matches.pairs.push_back(keypoints[k]);
      ++next_inlier;
    } else {
      connection.outliers_j.push_back(keypoints[k][1]);
    }
  }
  return connection;
}

// Candidate edges of a pair of views, the best first.
struct EdgeHypotheses {
  std::vector<EdgeWithMatches> connections;
  std::vector<double> excesses;
};

std::vector<BearingPair> PairsOf(const MatchedViews& views) {
  const auto& [view_i, view_j, keypoints, noise] = views;
  std::vector<BearingPair> pairs;
  pairs.reserve(keypoints.size());
  for (const auto& [of_i, of_j] : keypoints) {
    pairs.push_back({view_i.bearings[of_i], view_j.bearings[of_j]});
  }
  for (std::size_t k = 0; k < noise.size(); ++k) pairs[k].noise = noise[k];
  return pairs;
}

RelativeRotationOptions OptionsFor(const MatchedViews& views, const EdgeOptions& options) {
  RelativeRotationOptions pair_options = options.relative_rotation;
  pair_options.shared_error_px = std::hypot(
      pair_options.shared_error_px, views.view_i.shared_error_px, views.view_j.shared_error_px);
  return pair_options;
}

EdgeHypotheses HypothesesByMatches(const MatchedViews& views,
                                   const Rotation& predicted_j_from_i,
                                   double focal_px,
                                   const EdgeOptions& options) {
  const FrameId i = views.view_i.frame;
  const FrameId j = views.view_j.frame;
  const std::uint64_t seed = options.seed * 0x9E3779B97F4A7C15ULL +
                             (std::uint64_t(i.value) << 32 | std::uint32_t(j.value));
  EdgeHypotheses hypotheses;
  for (const RelativeRotationEstimate& estimate :
       EstimateRotationHypotheses({PairsOf(views), CovariancesOf(views)},
                                  predicted_j_from_i,
                                  focal_px,
                                  OptionsFor(views, options),
                                  seed)) {
    hypotheses.connections.push_back(EdgeWithMatchesOf(estimate, i, j, views.keypoints));
    hypotheses.excesses.push_back(estimate.excess);
  }
  return hypotheses;
}

// Orientations of the view by the hypotheses of a pair. Pairs are weighted by the precision that
// follows from their number of points.
PairHypotheses OrientationsBy(const EdgeHypotheses& hypotheses, const RotationMap& cam_from_world) {
  PairHypotheses pair;
  pair.weight = std::sqrt(static_cast<double>(hypotheses.connections.front().edge.num_inliers));
  for (std::size_t h = 0; h < hypotheses.connections.size(); ++h) {
    const RelativeRotation& edge = hypotheses.connections[h].edge;
    pair.hypotheses.push_back({edge.j_from_i * cam_from_world.at(edge.i), hypotheses.excesses[h]});
  }
  return pair;
}

}  // namespace

std::optional<EdgeWithMatches> EstimateEdge(const MatchedViews& views,
                                            const Rotation& predicted_j_from_i,
                                            double focal_px,
                                            const EdgeOptions& options) {
  EdgeHypotheses hypotheses = HypothesesByMatches(views, predicted_j_from_i, focal_px, options);
  if (hypotheses.connections.empty()) return std::nullopt;
  return std::move(hypotheses.connections.front());
}

std::optional<std::string> ViewGraphOptions::Problem() const {
  if (window_frames < 1) return OutOfRange("window_frames", window_frames, "at least 1");
  if (min_edge_inliers < 0) {
    return OutOfRange("min_edge_inliers", min_edge_inliers, "zero or more");
  }
  if (max_keyframe_edges < 0) {
    return OutOfRange("max_keyframe_edges", max_keyframe_edges, "zero or more");
  }
  if (!(keyframe_overlap > 0.0 && keyframe_overlap <= 1.0)) {
    return OutOfRange("keyframe_overlap", keyframe_overlap, "above 0 and at most 1");
  }
  return std::nullopt;
}

std::vector<EdgeWithMatches> EstimateEdges(const Features& view,
                                           const std::vector<const Features*>& others,
                                           const RotationMap& predicted_cam_from_world,
                                           double focal_px,
                                           const EdgeOptions& options) {
  std::vector<EdgeHypotheses> hypotheses(others.size());
  const Rotation& view_from_world = predicted_cam_from_world.at(view.frame);
  ParallelFor(static_cast<int>(others.size()), options.num_threads, [&](int k) {
    const Rotation& other_from_world = predicted_cam_from_world.at(others[k]->frame);
    hypotheses[k] = HypothesesByMatches({*others[k], view, FindCommonPoints(*others[k], view)},
                                        view_from_world * other_from_world.Inverse(),
                                        focal_px,
                                        options);
  });
  std::erase_if(hypotheses,
                [](const EdgeHypotheses& of_pair) { return of_pair.connections.empty(); });
  std::vector<PairHypotheses> orientations;
  orientations.reserve(hypotheses.size());
  for (const EdgeHypotheses& of_pair : hypotheses) {
    orientations.push_back(OrientationsBy(of_pair, predicted_cam_from_world));
  }
  const std::vector<int> chosen = ChooseConsistent(orientations);
  std::vector<EdgeWithMatches> found;
  found.reserve(hypotheses.size());
  for (std::size_t k = 0; k < hypotheses.size(); ++k) {
    found.push_back(std::move(hypotheses[k].connections[chosen[k]]));
  }
  return found;
}

std::vector<EdgeWithMatches> UpdateEdges(const Features& view,
                                         const std::vector<const Features*>& others,
                                         const std::vector<RelativeRotation>& known,
                                         const RotationMap& predicted_cam_from_world,
                                         double focal_px,
                                         const EdgeOptions& options) {
  if (known.size() != others.size()) {
    throw std::invalid_argument("UpdateEdges: not one edge per view");
  }
  std::vector<std::optional<EdgeWithMatches>> updated(others.size());
  const Rotation& view_from_world = predicted_cam_from_world.at(view.frame);
  ParallelFor(static_cast<int>(others.size()), options.num_threads, [&](int k) {
    const auto keypoints = FindCommonPoints(*others[k], view);
    const MatchedViews views{*others[k], view, keypoints};
    const Rotation& other_from_world = predicted_cam_from_world.at(others[k]->frame);
    const auto estimate =
        UpdateRelativeRotation({PairsOf(views), CovariancesOf(views)},
                               {known[k].j_from_i, known[k].translation_direction},
                               view_from_world * other_from_world.Inverse(),
                               focal_px,
                               OptionsFor(views, options));
    if (estimate) {
      updated[k] = EdgeWithMatchesOf(*estimate, others[k]->frame, view.frame, keypoints);
    }
  });
  std::vector<EdgeWithMatches> found;
  found.reserve(updated.size());
  for (std::optional<EdgeWithMatches>& edge : updated) {
    if (edge) found.push_back(*std::move(edge));
  }
  return found;
}

}  // namespace rotslam
