#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rotodom/features/features.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/tracks/tracks.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Which earlier views get an edge to a new one, and which tests edges pass.
struct ViewGraphOptions {
  // A new frame is matched against this many frames before it; the paper's |F|.
  int window_frames = 4;
  // An edge needs more inliers than this (the paper's theta_matches). A frame that gets no such
  // edge takes the best one it has with at least RelativeRotationOptions::min_inliers, and is
  // flagged.
  int min_edge_inliers = 100;
  // Edges to older keyframes, oldest first, as long as they share more than min_edge_inliers
  // points with the frame. They hold the drift where the camera stays in one place.
  int max_keyframe_edges = 3;
  // A frame that shares less than this part of its points with the last keyframe becomes the next.
  double keyframe_overlap = 0.7;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("window_frames", window_frames);
    visit("min_edge_inliers", min_edge_inliers);
    visit("max_keyframe_edges", max_keyframe_edges);
    visit("keyframe_overlap", keyframe_overlap);
  }
};

/// An edge of the view-graph with its matches.
struct EdgeWithMatches {
  RelativeRotation edge;
  EdgeMatches matches;          // inliers of the edge
  std::vector<int> outliers_j;  // keypoints of frame j whose match is an outlier
};

/// Two views and the keypoints that they have in common.
struct MatchedViews {
  const Features& view_i;
  const Features& view_j;
  const std::vector<std::array<int, 2>>& keypoints;  // of view_i and of view_j
  std::span<const MatchNoise> noise = {};            // one for each of them; none: all are equal
};

/// Options for the estimation of edges.
struct EdgeOptions {
  RelativeRotationOptions relative_rotation;
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Estimates the edge between two views from matched keypoints.
/// @return  nullopt when fewer than relative_rotation.min_inliers of them agree.
std::optional<EdgeWithMatches> EstimateEdge(const MatchedViews& views,
                                            const Rotation& predicted_j_from_i,
                                            double focal_px,
                                            const EdgeOptions& options);

/// Estimates the relative rotations between `view` and each of `others` from their common points.
/// Where these allow two rotations, the one that agrees with the other pairs is selected
/// (ChooseConsistent).
/// @param predicted_cam_from_world  start orientations of all views concerned.
/// @return  one edge for each view with at least relative_rotation.min_inliers agreeing points, in
///          the order of `others`; the same at any thread count.
std::vector<EdgeWithMatches> EstimateEdges(const Features& view,
                                           const std::vector<const Features*>& others,
                                           const RotationMap& predicted_cam_from_world,
                                           double focal_px,
                                           const EdgeOptions& options);

/// Estimates known edges again after the bearings of their views have changed a little
/// (UpdateRelativeRotation). Six parameters: those of EstimateEdges, and `known`.
/// @param known  edges from `others` to `view`, in the same order.
/// @return  as EstimateEdges.
std::vector<EdgeWithMatches> UpdateEdges(const Features& view,
                                         const std::vector<const Features*>& others,
                                         const std::vector<RelativeRotation>& known,
                                         const RotationMap& predicted_cam_from_world,
                                         double focal_px,
                                         const EdgeOptions& options);

}  // namespace rotslam
