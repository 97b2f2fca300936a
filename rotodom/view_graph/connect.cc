#include "rotodom/view_graph/connect.h"

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

std::optional<Connection> Connect(const View& view_i,
                                  const View& view_j,
                                  const Rotation& predicted_j_from_i,
                                  const Camera& camera,
                                  const ConnectOptions& options) {
  const Matches matches = RefineMatches(
      MatchFeatures(view_i.features, view_j.features, predicted_j_from_i, camera, options.matching),
      view_i.features,
      view_j.features,
      view_i.pyramid,
      view_j.pyramid,
      options.matching,
      options.features.scale_factor);
  std::vector<BearingPair> pairs;
  std::vector<int> match_of_pair;
  for (int k = 0; k < static_cast<int>(matches.matches.size()); ++k) {
    const auto bearing_j = camera.Unproject(matches.matches[k].keypoint_j_px);
    if (!bearing_j) continue;
    pairs.push_back({view_i.features.bearings[matches.matches[k].i.value], *bearing_j});
    match_of_pair.push_back(k);
  }
  const FrameId i = view_i.features.frame;
  const FrameId j = view_j.features.frame;
  const std::uint64_t seed = options.seed * 0x9E3779B97F4A7C15ULL +
                             (std::uint64_t(i.value) << 32 | std::uint32_t(j.value));
  const auto estimate = EstimateRelativeRotation(
      pairs, predicted_j_from_i, camera.MeanFocal(), options.relative_rotation, seed);
  if (!estimate) return std::nullopt;

  Connection connection;
  connection.range = matches.range;
  connection.edge.i = connection.matches.frame_i = i;
  connection.edge.j = connection.matches.frame_j = j;
  connection.edge.j_from_i = estimate->j_from_i;
  connection.edge.covariance = estimate->covariance;
  connection.edge.translation_direction = estimate->translation_direction;
  connection.edge.num_inliers = static_cast<int>(estimate->inliers.size());
  connection.edge.rotation_only = estimate->rotation_only;
  connection.edge.parallax_px = estimate->parallax_px;
  for (const int inlier : estimate->inliers) {
    const Match& match = matches.matches[match_of_pair[inlier]];
    connection.matches.pairs.push_back({match.i.value, match.j.value});
    connection.keypoint_j_px.push_back(match.keypoint_j_px);
  }
  return connection;
}

}  // namespace

std::optional<std::string> ViewGraphOptions::Problem() const {
  if (window_frames < 1) return OutOfRange("window_frames", window_frames, "at least 1");
  if (min_edge_inliers < 0) {
    return OutOfRange("min_edge_inliers", min_edge_inliers, "zero or more");
  }
  return std::nullopt;
}

std::vector<Connection> ConnectView(const View& view,
                                    const std::vector<const View*>& others,
                                    const RotationMap& predicted_cam_from_world,
                                    const Camera& camera,
                                    const ConnectOptions& options) {
  std::vector<std::optional<Connection>> connections(others.size());
  const Rotation& view_from_world = predicted_cam_from_world.at(view.features.frame);
  ParallelFor(static_cast<int>(others.size()), options.num_threads, [&](int k) {
    const Rotation& other_from_world = predicted_cam_from_world.at(others[k]->features.frame);
    connections[k] =
        Connect(*others[k], view, view_from_world * other_from_world.Inverse(), camera, options);
  });
  std::vector<Connection> found;
  for (std::optional<Connection>& connection : connections) {
    if (connection) found.push_back(std::move(*connection));
  }
  return found;
}

}  // namespace rotslam
