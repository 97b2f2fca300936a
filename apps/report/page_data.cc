#include "apps/report/page_data.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "apps/page/camera_angles.h"
#include "apps/page/encoded_array.h"
#include "output/map/map_keypoints.h"
#include "output/map/ply.h"
#include "output/tables/summary.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

void Append(const Eigen::Vector3d& vector, std::vector<float>& values) {
  for (const double value : vector) values.push_back(static_cast<float>(value));
}

// Step between the elements shown, so that at most `limit` of `count` are.
int StepFor(std::size_t count, int limit) {
  return std::max(1, static_cast<int>((count + limit - 1) / limit));
}

std::vector<int> EveryStep(int count, int step) {
  std::vector<int> chosen;
  chosen.reserve(count / step + 1);
  for (int k = 0; k < count; k += step) chosen.push_back(k);
  return chosen;
}

// Bits of the flags of rotations.csv, in the order of the page's own list.
std::uint8_t FlagBits(const std::vector<std::string>& flags) {
  static const std::vector<std::string> kNames = {
      "predicted", "weak", "given", "searched_wide", "break", "loop"};
  std::uint8_t bits = 0;
  for (std::size_t k = 0; k < kNames.size(); ++k) {
    if (std::find(flags.begin(), flags.end(), kNames[k]) == flags.end()) continue;
    bits = static_cast<std::uint8_t>(bits | (1U << k));
  }
  return bits;
}

std::vector<Rotation> OrientationsOf(const RunData& run) {
  std::vector<Rotation> orientations;
  orientations.reserve(run.rotations.size());
  for (const RotationRow& row : run.rotations) orientations.push_back(row.world_from_cam);
  return orientations;
}

// Of each frame: its points in the cloud, and in how many frames these are seen on average.
struct TrackCounts {
  std::vector<std::int32_t> tracks;
  std::vector<float> mean_length;
};

TrackCounts CountTracks(const RunMap& map, int num_frames) {
  TrackCounts counts{std::vector<std::int32_t>(num_frames), std::vector<float>(num_frames)};
  for (const MapTrack& track : map.tracks) {
    for (const Observation& observation : track.track.observations) {
      if (observation.frame.value >= num_frames) continue;
      ++counts.tracks[observation.frame.value];
      counts.mean_length[observation.frame.value] +=
          static_cast<float>(track.track.observations.size());
    }
  }
  for (int n = 0; n < num_frames; ++n) {
    if (counts.tracks[n] > 0) counts.mean_length[n] /= static_cast<float>(counts.tracks[n]);
  }
  return counts;
}

std::vector<float> MeanInliers(const RunMap& map, int num_frames) {
  std::vector<float> sum(num_frames);
  std::vector<int> count(num_frames);
  for (const MapEdge& edge : map.edges) {
    for (const FrameId frame : {edge.i, edge.j}) {
      if (frame.value >= num_frames) continue;
      sum[frame.value] += static_cast<float>(edge.num_inliers);
      ++count[frame.value];
    }
  }
  for (int n = 0; n < num_frames; ++n) sum[n] /= static_cast<float>(std::max(1, count[n]));
  return sum;
}

template <class T>
std::vector<T> Chosen(const std::vector<T>& values, const std::vector<int>& frames) {
  std::vector<T> chosen;
  chosen.reserve(frames.size());
  for (const int frame : frames) chosen.push_back(values[frame]);
  return chosen;
}

// One entry per frame that is shown.
Json FramesData(const RunData& run, const std::vector<int>& frames) {
  const std::vector<Eigen::Vector3d> angles_deg = RollPitchYawDeg(OrientationsOf(run));
  std::vector<float> time, quaternion, position, angle, sigma;
  std::vector<std::int32_t> edges;
  std::vector<std::uint8_t> flags;
  for (const int n : frames) {
    const RotationRow& row = run.rotations[n];
    time.push_back(static_cast<float>(row.timestamp_s - run.rotations.front().timestamp_s));
    const Rotation& shown = run.poses.empty() ? row.world_from_cam : run.poses[n].world_from_cam;
    for (const double value : shown.Quaternion().coeffs()) {
      quaternion.push_back(static_cast<float>(value));
    }
    if (!run.poses.empty()) Append(run.poses[n].center_in_world, position);
    Append(angles_deg[n], angle);
    // In the order of the angles: roll is about z, pitch about x, yaw about y.
    const Eigen::Vector3d sigma_deg = row.sigma_deg.value_or(Eigen::Vector3d::Constant(-1.0));
    Append({sigma_deg.z(), sigma_deg.x(), sigma_deg.y()}, sigma);
    edges.push_back(row.inlier_edges);
    flags.push_back(FlagBits(row.flags));
  }
  Json data = {{"frame", EncodedArray(std::vector<std::int32_t>(frames.begin(), frames.end()), 1)},
               {"time_s", EncodedArray(time, 1)},
               {"quaternion", EncodedArray(quaternion, 4)},
               {"angle_deg", EncodedArray(angle, 3)},
               {"sigma_deg", EncodedArray(sigma, 3)},
               {"edges", EncodedArray(edges, 1)},
               {"flags", EncodedArray(flags, 1)}};
  if (run.HasPositions()) data["position"] = EncodedArray(position, 3);
  if (run.keyframe_map) {
    data["inliers"] =
        EncodedArray(Chosen(MeanInliers(*run.keyframe_map, run.NumFrames()), frames), 1);
  }
  if (run.cloud && !run.cloud->tracks.empty()) {
    const TrackCounts counts = CountTracks(*run.cloud, run.NumFrames());
    data["tracks"] = EncodedArray(Chosen(counts.tracks, frames), 1);
    data["track_length"] = EncodedArray(Chosen(counts.mean_length, frames), 1);
  }
  return data;
}

Json CloudData(const RunMap& map, const PageLimits& limits) {
  std::vector<const MapTrack*> points;
  for (const MapTrack& track : map.tracks) {
    if (track.point_in_world && track.point_in_world->allFinite()) points.push_back(&track);
  }
  const int step = StepFor(points.size(), limits.max_points);
  std::vector<float> position;
  std::vector<std::uint8_t> rgb;
  for (std::size_t k = 0; k < points.size(); k += step) {
    Append(*points[k]->point_in_world, position);
    const auto& color = points[k]->track.rgb;
    rgb.insert(rgb.end(), color.begin(), color.end());
  }
  return {{"count", points.size()},
          {"position", EncodedArray(position, 3)},
          {"rgb", EncodedArray(rgb, 3)}};
}

Json KeyframesData(const RunMap& map) {
  CenterMap centers;
  std::vector<std::int32_t> frames;
  for (const MapFrame& frame : map.frames) {
    if (!frame.is_keyframe) continue;
    centers[frame.id] = frame.center_in_world;
    frames.push_back(frame.id.value);
  }
  return {{"frame", EncodedArray(frames, 1)},
          {"frustum_size", FrustumSize(centers)},
          {"tan_x", 0.5 * map.camera.width / map.camera.fx},
          {"tan_y", 0.5 * map.camera.height / map.camera.fy}};
}

Json LensDataOf(const LensData& lens) {
  return {{"is_estimated", lens.is_estimated},
          {"radius_px", lens.radius_px},
          {"displacement_px", lens.displacement_px},
          {"sigma_px", lens.sigma_px},
          {"given_px", lens.given_px}};
}

Json GraphData(const RunData& run, const PageLimits& limits) {
  const int step = StepFor(run.edges.size(), limits.max_edges);
  std::vector<std::int32_t> frames;
  std::vector<float> sigma;
  for (std::size_t k = 0; k < run.edges.size(); k += step) {
    const RelativeRotation& edge = run.edges[k];
    frames.push_back(edge.i.value);
    frames.push_back(edge.j.value);
    sigma.push_back(
        static_cast<float>(kDegFromRad * std::sqrt(std::abs(edge.covariance.trace()) / 3.0)));
  }
  return {{"count", run.edges.size()},
          {"frames", EncodedArray(frames, 2)},
          {"sigma_deg", EncodedArray(sigma, 1)}};
}

Json LoopsData(const std::vector<LoopRow>& loops) {
  Json rows = Json::array();
  for (const LoopRow& loop : loops) {
    if (!loop.accepted) continue;
    rows.push_back({{"frame", loop.frame},
                    {"match", loop.match},
                    {"inliers", loop.inliers},
                    {"angle_deg", loop.angle_deg}});
  }
  return {{"candidates", loops.size()}, {"accepted", rows}};
}

Json SegmentsData(const std::vector<Segment>& segments) {
  Json rows = Json::array();
  for (const Segment& segment : segments) {
    rows.push_back({{"first", segment.first_frame},
                    {"last", segment.last_frame},
                    {"kind", segment.kind},
                    {"component", segment.component},
                    {"scale", segment.scale},
                    {"evidence", segment.evidence}});
  }
  return rows;
}

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

Json MetricsData(const TrajectoryMetrics& metrics) {
  return {{"n", metrics.num_poses},
          {"rpe1", metrics.rpe1_deg},
          {"rpe1_median", metrics.rpe1_median_deg},
          {"rpe1_p90", metrics.rpe1_p90_deg},
          {"rpe1_max", metrics.rpe1_max_deg},
          {"rpen", metrics.rpen_deg},
          {"r_err", OrNull(metrics.r_err_deg_per_100m)},
          {"ate", OrNull(metrics.ate_m)},
          {"scale", OrNull(metrics.scale)},
          {"path_length", metrics.path_length_m}};
}

Json TruthJson(const RunData& run, int step) {
  const TruthData& truth = *run.truth;
  const std::vector<Eigen::Vector3d> estimated_deg = RollPitchYawDeg(OrientationsOf(run));
  const std::vector<Eigen::Vector3d> angles_deg = RollPitchYawDeg(truth.world_from_cam);
  std::vector<std::int32_t> frames;
  std::vector<float> angle, error, position, position_error;
  for (std::size_t k = 0; k < truth.frames.size(); ++k) {
    const int n = truth.frames[k];
    if (n % step != 0) continue;
    frames.push_back(n);
    // Unwrapping restarts after a gap; multiples of 360 deg keep both curves together.
    Append(angles_deg[k] +
               360.0 * ((estimated_deg[n] - angles_deg[k]) / 360.0).array().round().matrix(),
           angle);
    const Eigen::Vector3d error_deg =
        ErrorDeg(run.rotations[n].world_from_cam, truth.world_from_cam[k]);
    Append({error_deg.z(), error_deg.x(), error_deg.y()}, error);
    if (truth.center_in_world.empty()) continue;
    Append(truth.center_in_world[k], position);
    position_error.push_back(static_cast<float>(truth.position_error_m[k]));
  }
  Json data = {{"file", truth.file},
               {"rotations", MetricsData(truth.rotations)},
               {"frame", EncodedArray(frames, 1)},
               {"angle_deg", EncodedArray(angle, 3)},
               {"error_deg", EncodedArray(error, 3)}};
  if (truth.trajectory) data["trajectory"] = MetricsData(*truth.trajectory);
  if (position.empty()) return data;
  data["position"] = EncodedArray(position, 3);
  data["position_error_m"] = EncodedArray(position_error, 1);
  return data;
}

// At most `limit` of the points at equal steps, in units of 1/65535 of the image size.
std::vector<std::uint16_t> Packed(const std::vector<Eigen::Array2d>& places, int limit) {
  const int step = StepFor(places.size(), limit);
  std::vector<std::uint16_t> packed;
  packed.reserve(2 * (places.size() / step + 1));
  for (std::size_t k = 0; k < places.size(); k += step) {
    for (const double value : places[k]) {
      packed.push_back(static_cast<std::uint16_t>(std::lround(65535.0 * value)));
    }
  }
  return packed;
}

// Image positions of the cloud's points in these frames, as shares of width and height.
std::map<int, std::vector<Eigen::Array2d>> FeaturesIn(const std::vector<int>& frames,
                                                      const RunMap& map) {
  std::map<int, std::vector<Eigen::Array2d>> features;
  for (const int frame : frames) features[frame];
  const Eigen::Array2d size_px(map.camera.width, map.camera.height);
  for (const MapTrack& track : map.tracks) {
    for (const Observation& observation : track.track.observations) {
      const auto found = features.find(observation.frame.value);
      if (found == features.end()) continue;
      const Eigen::Array2d place = (observation.keypoint_px.array() + 0.5) / size_px;
      if ((place >= 0.0).all() && (place <= 1.0).all()) found->second.push_back(place);
    }
  }
  return features;
}

Json ThumbnailsData(const RunData& run, const Thumbnails& thumbnails, const PageLimits& limits) {
  Json list = Json::array();
  std::map<int, std::vector<Eigen::Array2d>> features;
  if (run.cloud) features = FeaturesIn(thumbnails.frames, *run.cloud);
  for (std::size_t k = 0; k < thumbnails.frames.size(); ++k) {
    Json entry = {{"frame", thumbnails.frames[k]}, {"jpeg", Base64(thumbnails.jpegs[k])}};
    const auto found = features.find(thumbnails.frames[k]);
    if (found != features.end()) {
      entry["features"] = EncodedArray(Packed(found->second, limits.max_features_per_frame), 2);
    }
    list.push_back(std::move(entry));
  }
  return {{"problem", thumbnails.problem}, {"images", list}};
}

Json FilesData(const std::filesystem::path& directory) {
  std::map<std::string, std::uintmax_t> sizes;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && name != "report.html") sizes[name] = entry.file_size();
  }
  Json files = Json::array();
  for (const auto& [name, bytes] : sizes) files.push_back({{"name", name}, {"bytes", bytes}});
  return files;
}

Json CheckData(const RunCheck& check) {
  Json reasons = Json::array();
  for (const CheckReason& reason : check.reasons) {
    reasons.push_back(
        {{"verdict", Name(reason.verdict)}, {"frames", reason.frames}, {"text", reason.text}});
  }
  return {
      {"verdict", Name(check.verdict)}, {"line", Describe(check)}, {"reasons", std::move(reasons)}};
}

}  // namespace

Json PageData(const RunData& run, const Thumbnails& thumbnails, const PageLimits& limits) {
  const int step = StepFor(run.rotations.size(), limits.max_frames);
  const std::vector<int> frames = EveryStep(run.NumFrames(), step);
  Json data = {{"version", Version()},
               {"check", CheckData(run.check)},
               {"run", std::filesystem::absolute(run.directory).lexically_normal().string()},
               {"summary", run.summary},
               {"frame_step", step},
               {"frames", FramesData(run, frames)},
               {"segments", SegmentsData(run.segments)},
               {"loops", LoopsData(run.loops)},
               {"graph", GraphData(run, limits)},
               {"thumbnails", ThumbnailsData(run, thumbnails, limits)},
               {"files", FilesData(run.directory)},
               {"truth_problem", run.truth_problem}};
  if (run.cloud) data["cloud"] = CloudData(*run.cloud, limits);
  if (run.keyframe_map) data["keyframes"] = KeyframesData(*run.keyframe_map);
  if (run.truth) data["truth"] = TruthJson(run, step);
  if (run.lens && !run.lens->radius_px.empty()) data["lens"] = LensDataOf(*run.lens);
  return data;
}

}  // namespace rotslam
