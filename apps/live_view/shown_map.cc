#include "apps/live_view/shown_map.h"

#include "apps/page/encoded_array.h"

namespace rotslam {

bool ShownMap::Keyframe::IsSameAs(const Keyframe& other) const {
  return frame == other.frame && quaternion == other.quaternion && position == other.position;
}

void ShownMap::Update(const LiveMap& map) {
  ++version_;
  revision_ = map.revision;
  num_corrections_ = map.num_corrections;
  UpdatePoints(map.points);
  UpdateKeyframes(map.keyframes);
}

void ShownMap::UpdatePoints(const std::vector<LivePoint>& points) {
  while (points.size() / static_cast<std::size_t>(track_stride_) > kMaxPoints) track_stride_ *= 2;
  for (const LivePoint& point : points) {
    if (point.track.value % track_stride_ != 0 || !point.point_in_world.allFinite()) continue;
    const Eigen::Vector3f position = point.point_in_world.cast<float>();
    const auto [entry, is_new] = row_of_track_.try_emplace(point.track.value, points_.size());
    if (is_new) {
      points_.push_back({point.track, position, point.rgb, version_, version_});
      continue;
    }
    Point& shown = points_[entry->second];
    shown.seen = version_;
    if (shown.position == position && shown.rgb == point.rgb) continue;
    shown.position = position;
    shown.rgb = point.rgb;
    shown.changed = version_;
  }
  RemoveUnseenPoints();
}

// The last row moves to where one is removed, so that there are no gaps.
void ShownMap::RemoveUnseenPoints() {
  for (std::size_t row = 0; row < points_.size();) {
    if (points_[row].seen == version_) {
      ++row;
      continue;
    }
    row_of_track_.erase(points_[row].track.value);
    if (row + 1 < points_.size()) {
      points_[row] = points_.back();
      points_[row].changed = version_;
      row_of_track_[points_[row].track.value] = row;
    }
    points_.pop_back();
  }
}

void ShownMap::UpdateKeyframes(const std::vector<LiveKeyframe>& keyframes) {
  keyframes_.resize(keyframes.size());
  for (std::size_t row = 0; row < keyframes.size(); ++row) {
    const LiveKeyframe& keyframe = keyframes[row];
    const Keyframe now = {keyframe.frame.value,
                          keyframe.cam_from_world.Inverse().Quaternion().coeffs().cast<float>(),
                          keyframe.center_in_world.cast<float>(),
                          version_};
    if (keyframes_[row].changed == 0 || !keyframes_[row].IsSameAs(now)) keyframes_[row] = now;
  }
}

nlohmann::ordered_json ShownMap::After(int version) const {
  return {{"revision", revision_},
          {"corrections", num_corrections_},
          {"points", PointsAfter(version)},
          {"keyframes", KeyframesAfter(version)}};
}

nlohmann::ordered_json ShownMap::PointsAfter(int version) const {
  std::vector<std::int32_t> rows;
  std::vector<float> position;
  std::vector<std::uint8_t> rgb;
  for (std::size_t row = 0; row < points_.size(); ++row) {
    const Point& point = points_[row];
    if (point.changed <= version) continue;
    rows.push_back(static_cast<std::int32_t>(row));
    position.insert(position.end(), point.position.data(), point.position.data() + 3);
    rgb.insert(rgb.end(), point.rgb.begin(), point.rgb.end());
  }
  nlohmann::ordered_json changes = {{"count", points_.size()},
                                    {"position", EncodedArray(position, 3)},
                                    {"rgb", EncodedArray(rgb, 3)}};
  if (rows.size() < points_.size()) changes["row"] = EncodedArray(rows, 1);
  return changes;
}

nlohmann::ordered_json ShownMap::KeyframesAfter(int version) const {
  std::vector<std::int32_t> rows;
  std::vector<std::int32_t> frame;
  std::vector<float> quaternion;
  std::vector<float> position;
  for (std::size_t row = 0; row < keyframes_.size(); ++row) {
    const Keyframe& keyframe = keyframes_[row];
    if (keyframe.changed <= version) continue;
    rows.push_back(static_cast<std::int32_t>(row));
    frame.push_back(keyframe.frame);
    quaternion.insert(quaternion.end(), keyframe.quaternion.data(), keyframe.quaternion.data() + 4);
    position.insert(position.end(), keyframe.position.data(), keyframe.position.data() + 3);
  }
  nlohmann::ordered_json changes = {{"count", keyframes_.size()},
                                    {"frame", EncodedArray(frame, 1)},
                                    {"quaternion", EncodedArray(quaternion, 4)},
                                    {"position", EncodedArray(position, 3)}};
  if (rows.size() < keyframes_.size()) changes["row"] = EncodedArray(rows, 1);
  return changes;
}

}  // namespace rotslam
