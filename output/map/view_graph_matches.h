#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "output/map/run_map.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// Two frames, and the keypoints that agree with their relative rotation.
struct MatchedPair {
  FrameId i;
  FrameId j;                                // i < j
  std::vector<std::array<int, 2>> matches;  // positions in the keypoints of i and of j
};

/// The verified matches of a view-graph, whether they became tracks or not.
struct ViewGraphMatches {
  std::map<FrameId, std::vector<Eigen::Vector2f>> keypoints_px;  // those that a match names
  std::vector<MatchedPair> pairs;                                // by (i, j), each once
};

/// Writes `matches.bin` in a binary form of our own. Matches that go on together in both lists, as
/// those of tracked points do, take some bytes a run. Throws std::runtime_error when the file
/// cannot be written.
void WriteViewGraphMatches(const std::filesystem::path& path, const ViewGraphMatches& matches);

/// Reads what WriteViewGraphMatches has written. Throws std::runtime_error with path and reason in
/// one line: not such a file, cut short, counts beyond its size, keypoints that there are not.
ViewGraphMatches ReadViewGraphMatches(const std::filesystem::path& path);

/// Adds the keypoints of `matches` that are in frames of `map` but in none of its tracks, each as a
/// track of one sighting without a point, so that all lists of keypoints have them.
void AddKeypoints(const ViewGraphMatches& matches, RunMap& map);

}  // namespace rotslam
