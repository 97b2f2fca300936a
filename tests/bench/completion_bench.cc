// Time of completion for a point and view, beside how many of the sightings are found and how well,
// against a wall that faces the camera.
#include <cmath>
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>

#include "rotodom/track_completion/track_completion.h"

namespace rotslam {
namespace {

constexpr int kNumViews = 30;
constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr int kStepPx = 6;   // that the wall goes from view to view
constexpr int kNumSeen = 4;  // views that the tracker has followed each point through
constexpr double kWallDepth = 5.0;
constexpr double kNoiseGrey = 2.0;

Camera WallCamera() {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fx = camera.fy = 500.0;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

// A walk along a wall of rectangles.
struct Walk {
  Walk() {
    cv::RNG random(1);
    cv::Mat wall(kHeight, kWidth + kNumViews * kStepPx, CV_8U, cv::Scalar(128));
    for (int k = 0; k < 6000; ++k) {
      const cv::Rect box(random.uniform(-20, wall.cols),
                         random.uniform(-20, wall.rows),
                         random.uniform(5, 40),
                         random.uniform(5, 40));
      cv::rectangle(wall, box, cv::Scalar(random.uniform(20, 236)), cv::FILLED);
    }
    cv::GaussianBlur(wall, wall, cv::Size(), 0.8);
    for (int k = 0; k < kNumViews; ++k) {
      const FrameId frame{k};
      map.cam_from_world[frame] = Rotation();
      map.center_in_world[frame] = {kStepPx * k * kWallDepth / camera.fx, 0.0, 0.0};
      cv::Mat noisy(kHeight, kWidth, CV_32F);
      random.fill(noisy, cv::RNG::NORMAL, 0.0, kNoiseGrey);
      cv::add(wall(cv::Rect(kStepPx * k, 0, kWidth, kHeight)), noisy, noisy, cv::noArray(), CV_8U);
      views[frame] = MakeMapView(noisy);
    }
    for (int row = 20; row < kHeight - 20; row += 16) {
      for (int column = 20; column < wall.cols - 20; column += 16) {
        Track track;
        track.id = TrackId{static_cast<int>(map.tracks.size())};
        const Eigen::Vector2d first_px(column, row);
        map.point_in_world[track.id] =
            *camera.Unproject(first_px) * (kWallDepth / camera.Unproject(first_px)->z());
        for (int k = 0; k < kNumViews && std::ssize(track.observations) < kNumSeen; ++k) {
          const Eigen::Vector2d px = TruePx(FrameId{k}, track.id);
          if (!Shows(px)) continue;
          track.observations.push_back({FrameId{k}, px, *camera.Unproject(px), 1.0});
        }
        map.tracks.push_back(track);
      }
    }
  }

  Eigen::Vector2d TruePx(FrameId frame, TrackId track) const {
    return *camera.Project(
        Eigen::Vector3d(map.point_in_world.at(track) - map.center_in_world.at(frame)));
  }

  static bool Shows(const Eigen::Vector2d& px) { return px.x() >= 0.0 && px.x() < kWidth; }

  Camera camera = WallCamera();
  Reconstruction map;
  MapViews views;
};

void Complete(benchmark::State& state) {
  static const Walk walk;
  std::vector<Track> tracks;
  for (auto _ : state) tracks = CompleteTracks(walk.map, walk.views, walk.camera, {}, 1);
  double sum = 0.0;
  int count = 0;
  int num_shown = 0;
  for (const Track& track : tracks) {
    for (int k = 0; k < kNumViews; ++k) {
      if (Walk::Shows(walk.TruePx(FrameId{k}, track.id))) ++num_shown;
    }
    for (const Observation& observation : track.observations) {
      sum += (observation.keypoint_px - walk.TruePx(observation.frame, track.id)).squaredNorm();
      ++count;
    }
  }
  state.counters["found_share"] = static_cast<double>(count) / num_shown;
  state.counters["rms_px"] = std::sqrt(sum / (2.0 * count));
  state.counters["us_per_view"] = benchmark::Counter(
      1e-6 * num_shown,
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(Complete)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
