// Time of patch templates, alignments and whole trackings beside the error against a known shift.
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>

#include "rotodom/matching/patch_alignment.h"
#include "rotodom/motion_blur/blurred_patch.h"
#include "rotodom/tracking/tracking.h"

namespace rotslam {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr int kFine = 4;  // steps per pixel
constexpr double kNoiseGrey = 2.0;
// Of the second image against the first, in steps.
constexpr int kShiftX = 9;
constexpr int kShiftY = -7;

// Two looks at a wall of rectangles, averaged from fine steps so that the shift is exact.
struct Shifted {
  cv::Mat before;
  cv::Mat after;
  Eigen::Vector2d shift_px;
};

cv::Mat Look(const cv::Mat& wall, int x, int y, std::uint64_t seed) {
  const cv::Rect window(64 + x, 64 + y, kFine * kWidth, kFine * kHeight);
  cv::Mat image;
  cv::resize(wall(window), image, cv::Size(kWidth, kHeight), 0.0, 0.0, cv::INTER_AREA);
  cv::Mat noisy(image.size(), CV_32F);
  cv::RNG random(seed);
  random.fill(noisy, cv::RNG::NORMAL, 0.0, kNoiseGrey);
  cv::add(image, noisy, image, cv::noArray(), CV_8U);
  return image;
}

const Shifted& Scene() {
  static const Shifted scene = [] {
    cv::RNG random(1);
    cv::Mat wall(kFine * kHeight + 128, kFine * kWidth + 128, CV_8U, cv::Scalar(128));
    for (int k = 0; k < 4000; ++k) {
      const cv::Rect box(random.uniform(-80, wall.cols),
                         random.uniform(-80, wall.rows),
                         random.uniform(20, 160),
                         random.uniform(20, 160));
      cv::rectangle(wall, box, cv::Scalar(random.uniform(20, 236)), cv::FILLED);
    }
    cv::GaussianBlur(wall, wall, cv::Size(), 0.8 * kFine);
    return Shifted{Look(wall, 0, 0, 2),
                   Look(wall, -kShiftX, -kShiftY, 3),
                   Eigen::Vector2d(kShiftX, kShiftY) / kFine};
  }();
  return scene;
}

Camera SceneCamera() {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fx = camera.fy = 500.0;
  camera.cx = 0.5 * (kWidth - 1);
  camera.cy = 0.5 * (kHeight - 1);
  return camera;
}

View FirstView() {
  View view;
  view.pyramid = BuildPyramid(Scene().before, {});
  DetectFeatures(view.pyramid, SceneCamera(), {}, 1, view.features);
  for (int n = 0; n < view.features.size(); ++n) view.features.tracks.push_back(TrackId{n});
  view.flow_px_per_s.assign(view.features.size(), Eigen::Vector2d::Zero());
  view.is_lost.assign(view.features.size(), false);
  return view;
}

void BM_SamplePatch(benchmark::State& state) {
  const View view = FirstView();
  const double turn = 0.03 * static_cast<double>(state.range(0));
  const Eigen::Matrix2d patch_from_view = Eigen::Rotation2Dd(turn).toRotationMatrix();
  std::size_t n = 0;
  std::size_t count = 0;
  for (auto _ : state) {
    const auto patch =
        PatchTemplate::Sample(Scene().before, view.features.keypoints_px[n], patch_from_view);
    count += patch.has_value();
    benchmark::DoNotOptimize(patch);
    n = (n + 1) % view.features.keypoints_px.size();
  }
  state.counters["made_percent"] =
      100.0 * static_cast<double>(count) / static_cast<double>(state.iterations());
}
BENCHMARK(BM_SamplePatch)->ArgName("turned")->Arg(0)->Arg(1);

// From `off` quarter pixels beside the truth.
void BM_AlignPatch(benchmark::State& state) {
  const View view = FirstView();
  std::vector<PatchTemplate> patches;
  std::vector<Eigen::Vector2d> truth;
  for (const Eigen::Vector2d& keypoint : view.features.keypoints_px) {
    if (auto patch = PatchTemplate::Sample(Scene().before, keypoint, Eigen::Matrix2d::Identity())) {
      patches.push_back(*patch);
      truth.push_back(keypoint + Scene().shift_px);
    }
  }
  const Eigen::Vector2d off = Eigen::Vector2d(0.8, 0.6) * static_cast<double>(state.range(0)) / 4.0;
  std::size_t n = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(AlignPatch(patches[n], Scene().after, truth[n] + off, 5.0));
    n = (n + 1) % patches.size();
  }
  int found = 0;
  double squared = 0.0;
  double normalised = 0.0;
  for (std::size_t k = 0; k < patches.size(); ++k) {
    const auto aligned = AlignPatch(patches[k], Scene().after, truth[k] + off, 5.0);
    if (!aligned || aligned->correlation < TrackingOptions{}.min_correlation) continue;
    const Eigen::Vector2d error = aligned->center_px - truth[k];
    if (error.norm() > 1.0) continue;
    ++found;
    squared += error.squaredNorm() / 2.0;
    normalised += error.dot(aligned->covariance.inverse() * error) / 2.0;
  }
  state.counters["found_percent"] = 100.0 * found / static_cast<double>(patches.size());
  state.counters["error_mpx"] = 1e3 * std::sqrt(squared / found);
  state.counters["normalised"] = normalised / found;
}
BENCHMARK(BM_AlignPatch)->ArgName("off")->Arg(0)->Arg(2)->Arg(8)->Arg(16);

// The second image taken for one that moved by `blur vector` pixels while it was exposed, the first
// for one that moved by a third of that.
void BM_AlignBlurredPatch(benchmark::State& state) {
  const View view = FirstView();
  const Eigen::Vector2d blur_vector(static_cast<double>(state.range(0)), 0.0);
  std::size_t n = 0;
  for (auto _ : state) {
    const Eigen::Vector2d& keypoint = view.features.keypoints_px[n];
    benchmark::DoNotOptimize(AlignBlurredPatch(
        {Scene().before, keypoint, Eigen::Matrix2d::Identity(), blur_vector / 3.0},
        Scene().after,
        keypoint + Scene().shift_px,
        blur_vector,
        3.0));
    n = (n + 1) % view.features.keypoints_px.size();
  }
}
BENCHMARK(BM_AlignBlurredPatch)->ArgName("blur_vector")->Arg(0)->Arg(3)->Arg(10)->Arg(20);

void BM_TrackPoints(benchmark::State& state) {
  const View view = FirstView();
  const ImagePyramid target_pyramid = BuildPyramid(Scene().after, {});
  const std::vector<OrientedView> views = {{&view, Rotation()}};
  TrackingTarget target;
  target.pyramid = &target_pyramid;
  target.timestamp_s = 0.1;
  TrackingResult tracked;
  for (auto _ : state) {
    tracked = TrackPoints(views, target, SceneCamera(), {}, static_cast<int>(state.range(0)));
    benchmark::DoNotOptimize(tracked);
  }
  double squared = 0.0;
  int found = 0;
  for (const TrackedPoint& point : tracked.points) {
    const Eigen::Vector2d error =
        point.keypoint_px - view.features.keypoints_px[point.index] - Scene().shift_px;
    if (error.norm() > 1.0) continue;
    ++found;
    squared += error.squaredNorm() / 2.0;
  }
  state.counters["points"] = static_cast<double>(tracked.points.size());
  state.counters["right_percent"] = 100.0 * found / static_cast<double>(view.features.size());
  state.counters["error_mpx"] = 1e3 * std::sqrt(squared / found);
  state.counters["us_per_point"] = benchmark::Counter(
      static_cast<double>(tracked.points.size()) * static_cast<double>(state.iterations()) * 1e-6,
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_TrackPoints)
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
