#pragma once

#include <stdexcept>

#include "rotodom/odometry.h"
#include "rotodom/types/archive.h"

// Serialisation of the results for single frames (rotodom/types/archive.h).

namespace rotslam {

/// One channel of 8 bits.
template <class Archive>
void TransferValue(Archive& archive, cv::Mat& image) {
  const std::size_t rows = archive.Count(static_cast<std::size_t>(image.rows), 1);
  if (rows == 0) return;
  const std::size_t columns = archive.Count(static_cast<std::size_t>(image.cols), rows);
  if constexpr (Archive::kIsReader) {
    image.create(static_cast<int>(rows), static_cast<int>(columns), CV_8UC1);
  }
  for (int row = 0; row < image.rows; ++row) archive.Bytes(image.ptr(row), columns);
}

template <class Archive>
void TransferValue(Archive& archive, RelativeRotation& edge) {
  auto& [i,
         j,
         j_from_i,
         covariance,
         translation_direction,
         num_inliers,
         rotation_only,
         baseline_strength,
         noise_px,
         parallax_px] = edge;
  archive(i, j, j_from_i, covariance, translation_direction, num_inliers, rotation_only);
  archive(baseline_strength, noise_px, parallax_px);
  // Checksums say nothing of a file that somebody made.
  if (Archive::kIsReader && (i == j || i.value < 0 || j.value < 0)) {
    throw std::runtime_error("has an edge without two different views");
  }
}

template <class Archive>
void TransferValue(Archive& archive, ViewGraph& graph) {
  std::vector<RelativeRotation> edges = graph.edges();
  archive(edges);
  if constexpr (!Archive::kIsReader) return;
  graph = ViewGraph();
  for (const RelativeRotation& edge : edges) graph.AddEdge(edge);
}

template <class Archive>
void TransferValue(Archive& archive, Features& features) {
  auto& [frame,
         keypoints_px,
         bearings,
         levels,
         rgb,
         covariances_px,
         tracks,
         shared_error_px,
         angles_rad,
         descriptors] = features;
  archive(frame, keypoints_px, bearings, levels, rgb, covariances_px, tracks, angles_rad);
  archive(shared_error_px, descriptors);
}

template <class Archive>
void TransferValue(Archive& archive, EdgeMatches& matches) {
  auto& [frame_i, frame_j, pairs] = matches;
  archive(frame_i, frame_j, pairs);
}

template <class Archive>
void TransferValue(Archive& archive, EdgeWithMatches& connection) {
  auto& [edge, matches, outliers_j] = connection;
  archive(edge, matches, outliers_j);
}

template <class Archive>
void TransferValue(Archive& archive, FrameReport& report) {
  auto& [num_tracked, num_inliers, predicted_only, weak, searched_wide] = report;
  archive(num_tracked, num_inliers, predicted_only, weak, searched_wide);
}

template <class Archive>
void TransferValue(Archive& archive, FrameEstimate& estimate) {
  auto& [frame,
         timestamp_s,
         cam_from_world,
         covariance,
         window,
         settled,
         settled_covariance,
         connections,
         revised_edges,
         revised_features,
         features,
         report] = estimate;
  archive(frame, timestamp_s, cam_from_world, covariance, window, settled, settled_covariance);
  archive(connections, revised_edges, revised_features, features, report);
}

template <class Archive>
void TransferValue(Archive& archive, OdometrySeconds& seconds) {
  auto& [pyramid, tracking, detection, edges, averaging, covariance] = seconds;
  archive(pyramid, tracking, detection, edges, averaging, covariance);
}

}  // namespace rotslam
