#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "apps/slam/live/live_map.h"

namespace rotslam {

/// The map that a page shows, in rows that have the version of their last change, so that a browser
/// gets only rows that are new to it. Versions count the maps that have been shown, from 1.
class ShownMap {
 public:
  /// Of larger maps only points whose track is a multiple of two, four, ... are shown.
  static constexpr std::size_t kMaxPoints = 100'000;

  void Update(const LiveMap& map);

  int version() const { return version_; }
  std::size_t num_points() const { return points_.size(); }

  /// The rows that have changed after a version, 0 for all. "points" and "keyframes" have the
  /// number of rows ("count") and those that changed, at "row"; where all have, without "row".
  nlohmann::ordered_json After(int version) const;

 private:
  struct Point {
    TrackId track;
    Eigen::Vector3f position;
    std::array<std::uint8_t, 3> rgb = {};
    int changed = 0;  // version
    int seen = 0;     // version of the newest map that has it
  };
  struct Keyframe {
    int frame = 0;
    Eigen::Vector4f quaternion;
    Eigen::Vector3f position;
    int changed = 0;

    bool IsSameAs(const Keyframe& other) const;
  };

  void UpdatePoints(const std::vector<LivePoint>& points);
  void RemoveUnseenPoints();
  void UpdateKeyframes(const std::vector<LiveKeyframe>& keyframes);
  nlohmann::ordered_json PointsAfter(int version) const;
  nlohmann::ordered_json KeyframesAfter(int version) const;

  int version_ = 0;
  int revision_ = 0;
  int num_corrections_ = 0;
  int track_stride_ = 1;
  std::vector<Point> points_;
  std::unordered_map<int, std::size_t> row_of_track_;
  std::vector<Keyframe> keyframes_;
};

}  // namespace rotslam
