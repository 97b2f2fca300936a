#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/matching/matching.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/tracks/tracks.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

struct ViewGraphOptions {
  // A new frame is matched against this many frames before it; the paper's |F|.
  int window_frames = 4;
  // An edge needs more inliers than this (the paper's theta_matches). A frame that gets no such
  // edge takes the best one it has with at least RelativeRotationOptions::min_inliers, and is
  // flagged.
  int min_edge_inliers = 100;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("window_frames", window_frames);
    visit("min_edge_inliers", min_edge_inliers);
  }
};

/// What is kept of a frame while others are matched against it.
struct View {
  Features features;
  std::vector<cv::Mat> pyramid;
};

/// A measured edge of the view-graph together with the matches it rests on.
struct Connection {
  RelativeRotation edge;
  EdgeMatches matches;
  std::vector<Eigen::Vector2d> keypoint_j_px;  // one per match, sub-pixel position in frame j
  SearchRange range = SearchRange::kGuided;
};

struct ConnectOptions {
  FeatureOptions features;
  MatchingOptions matching;
  RelativeRotationOptions relative_rotation;
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Matches `view` against each of `others` and estimates the relative rotations.
/// @param predicted_cam_from_world  start orientations of all views concerned.
/// @return  one connection per other view that agrees on at least relative_rotation.min_inliers
/// matches, in
///          the order of `others`; the thread count does not change it.
std::vector<Connection> ConnectView(const View& view,
                                    const std::vector<const View*>& others,
                                    const RotationMap& predicted_cam_from_world,
                                    const Camera& camera,
                                    const ConnectOptions& options);

}  // namespace rotslam
