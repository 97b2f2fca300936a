#pragma once

#include "rotodom/odometry.h"

namespace rotslam {

/// Options of rotational odometry as the paper has them: |F| = 4, |R| = 10, theta = 100. Where the
/// paper is silent the values are those of ORB-SLAM2 and of the program that the paper's authors
/// have published: 4,000 features, matches within 100 px, 50 bits and a ratio of 0.9.
/// `config/paper.yaml` says the same. PaperOdometry reads features, matching (radius, distance and
/// ratio), view_graph.window_frames, view_graph.min_edge_inliers, averaging.mode and
/// averaging.window; the other options are of our own method.
/// Source:  Chng, Parra, Chin & Latif, Monocular Rotational Odometry with Incremental Rotation
///          Averaging and Loop Closure, DICTA 2020, sec. IV to V; their program MRO.
OdometryOptions PaperDefaults();

}  // namespace rotslam
