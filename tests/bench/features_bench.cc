// Time of the pyramid, detection and description beside what they find, and cv::ORB next to them.
// The images are real ones from the shared data where they are present.
#include <array>
#include <filesystem>
#include <string>

#include <benchmark/benchmark.h>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "rotodom/features/features.h"
#include "tests/rotodom/features/repeatability.h"

namespace rotslam {
namespace {

constexpr std::array<const char*, 3> kImages = {
    "kitti00/image_0/000050.png", "7scenes_kitchen", "tum_fr1_rpy/rgb"};

// The image, or the hundredth of a folder; a wall of rectangles of KITTI's size where it is absent.
cv::Mat LoadImage(int index) {
  std::filesystem::path path = std::filesystem::path(ROTSLAM_SHARED_DIR) / "data" / kImages[index];
  if (std::filesystem::is_directory(path)) {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path)) {
      const std::string extension = entry.path().extension().string();
      if (extension == ".png" || extension == ".jpg") files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    if (files.size() > 100) path = files[100];
  }
  cv::Mat image;
  if (std::filesystem::is_regular_file(path)) {
    image = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  }
  if (!image.empty()) return image;
  cv::RNG random(1);
  image = cv::Mat(376, 1241, CV_8U, cv::Scalar(128));
  for (int k = 0; k < 3000; ++k) {
    const cv::Rect box(random.uniform(-20, image.cols),
                       random.uniform(-20, image.rows),
                       random.uniform(5, 40),
                       random.uniform(5, 40));
    cv::rectangle(image, box, cv::Scalar(random.uniform(0, 256)), cv::FILLED);
  }
  cv::GaussianBlur(image, image, cv::Size(), 0.8);
  return image;
}

Camera CameraOf(const cv::Mat& image) {
  Camera camera;
  camera.width = image.cols;
  camera.height = image.rows;
  camera.fx = camera.fy = 700.0;
  camera.cx = 0.5 * (image.cols - 1);
  camera.cy = 0.5 * (image.rows - 1);
  return camera;
}

constexpr double kTurnDeg = 10.0;
constexpr double kScale = 0.9;
constexpr double kNoiseGrey = 2.0;

void SetCounters(benchmark::State& state, int found, const Repeatability& repeatability) {
  state.counters["features"] = found;
  state.counters["again_percent"] = 100.0 * repeatability.found_again / repeatability.visible;
  state.counters["matched_percent"] = 100.0 * repeatability.matched / repeatability.visible;
}

void BM_BuildPyramid(benchmark::State& state) {
  const cv::Mat image = LoadImage(static_cast<int>(state.range(0)));
  const FeatureOptions options;
  ImagePyramid pyramid;
  for (auto _ : state) {
    pyramid = BuildPyramid(image, options);
    benchmark::DoNotOptimize(pyramid.levels.back().data);
  }
  // A smooth slope must stay one: how far the last level is from it.
  cv::Mat slope(image.size(), CV_8U);
  for (int x = 0; x < slope.cols; ++x) slope.col(x).setTo(cv::Scalar(x * 250 / slope.cols));
  const ImagePyramid of_slope = BuildPyramid(slope, options);
  double largest = 0.0;
  const cv::Mat& last = of_slope.levels.back();
  const int level = options.num_levels - 1;
  for (int x = 0; x < last.cols; ++x) {
    const double there = of_slope.ToImage(Eigen::Vector2d(x, 0), level).x();
    largest = std::max(largest, std::abs(last.at<std::uint8_t>(0, x) - there * 250 / slope.cols));
  }
  state.counters["slope_error_grey"] = largest;
}

// `carried_percent` of the features stand there already, as after tracking.
void BM_DetectFeatures(benchmark::State& state) {
  const cv::Mat image = LoadImage(static_cast<int>(state.range(0)));
  const FeatureOptions options;
  const Camera camera = CameraOf(image);
  const ImagePyramid pyramid = BuildPyramid(image, options);
  Features all;
  DetectFeatures(pyramid, camera, options, 1, all);
  Features carried;
  for (int k = 0; k < all.size(); ++k) {
    if (k * 7 % 100 >= state.range(1)) continue;
    carried.keypoints_px.push_back(all.keypoints_px[k]);
    carried.bearings.push_back(all.bearings[k]);
    carried.levels.push_back(all.levels[k]);
    carried.rgb.push_back(all.rgb[k]);
  }
  Features features;
  const int num_threads = static_cast<int>(state.range(2));
  for (auto _ : state) {
    features = carried;
    DetectFeatures(pyramid, camera, options, num_threads, features);
    benchmark::DoNotOptimize(features.keypoints_px.data());
  }
  const WarpedImage warped = Warp(image, kTurnDeg, kScale, kNoiseGrey, 1);
  const Features of_warped = ExtractFeatures(warped.image, FrameId{1}, camera, options, 1);
  DescribeFeatures(pyramid, 1, features);
  SetCounters(state,
              features.size(),
              Compare(ToKeyPoints(features),
                      features.descriptors,
                      ToKeyPoints(of_warped),
                      of_warped.descriptors,
                      warped,
                      kScale,
                      options.scale_factor));
}

void BM_DescribeFeatures(benchmark::State& state) {
  const cv::Mat image = LoadImage(static_cast<int>(state.range(0)));
  const FeatureOptions options;
  const ImagePyramid pyramid = BuildPyramid(image, options);
  Features features;
  DetectFeatures(pyramid, CameraOf(image), options, 1, features);
  const int first = features.size() - features.size() * static_cast<int>(state.range(1)) / 100;
  DescribeFeatures(pyramid, 1, features);
  for (auto _ : state) {
    DescribeFeatures(pyramid, static_cast<int>(state.range(2)), features, first);
    benchmark::DoNotOptimize(features.descriptors.data);
  }
  state.counters["features"] = features.size() - first;
}

void BM_ExtractFeatures(benchmark::State& state) {
  const cv::Mat image = LoadImage(static_cast<int>(state.range(0)));
  const FeatureOptions options;
  const Camera camera = CameraOf(image);
  Features features;
  for (auto _ : state) {
    features =
        ExtractFeatures(image, FrameId{0}, camera, options, static_cast<int>(state.range(1)));
    benchmark::DoNotOptimize(features.descriptors.data);
  }
  const WarpedImage warped = Warp(image, kTurnDeg, kScale, kNoiseGrey, 1);
  const Features of_warped = ExtractFeatures(warped.image, FrameId{1}, camera, options, 1);
  SetCounters(state,
              features.size(),
              Compare(ToKeyPoints(features),
                      features.descriptors,
                      ToKeyPoints(of_warped),
                      of_warped.descriptors,
                      warped,
                      kScale,
                      options.scale_factor));
}

void BM_CvOrb(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat image = LoadImage(static_cast<int>(state.range(0)));
  const FeatureOptions options;
  const auto orb = cv::ORB::create(options.max_features,
                                   static_cast<float>(options.scale_factor),
                                   options.num_levels,
                                   19,
                                   0,
                                   2,
                                   cv::ORB::HARRIS_SCORE,
                                   31,
                                   static_cast<int>(state.range(1)));
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  for (auto _ : state) {
    orb->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
    benchmark::DoNotOptimize(descriptors.data);
  }
  const WarpedImage warped = Warp(image, kTurnDeg, kScale, kNoiseGrey, 1);
  std::vector<cv::KeyPoint> of_warped;
  cv::Mat descriptors_of_warped;
  orb->detectAndCompute(warped.image, cv::noArray(), of_warped, descriptors_of_warped);
  SetCounters(state,
              static_cast<int>(keypoints.size()),
              Compare(keypoints,
                      descriptors,
                      of_warped,
                      descriptors_of_warped,
                      warped,
                      kScale,
                      options.scale_factor));
}

BENCHMARK(BM_BuildPyramid)->ArgName("image")->DenseRange(0, 2)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_DetectFeatures)
    ->ArgNames({"image", "carried_percent", "threads"})
    ->ArgsProduct({{0, 1, 2}, {0, 80}, {1}})
    ->Args({0, 0, 2})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK(BM_DescribeFeatures)
    ->ArgNames({"image", "described_percent", "threads"})
    ->ArgsProduct({{0, 1, 2}, {20, 100}, {1}})
    ->Args({0, 100, 2})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK(BM_ExtractFeatures)
    ->ArgNames({"image", "threads"})
    ->ArgsProduct({{0, 1, 2}, {1}})
    ->Args({0, 2})
    ->Unit(benchmark::kMicrosecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();
BENCHMARK(BM_CvOrb)
    ->ArgNames({"image", "threshold"})
    ->ArgsProduct({{0, 1, 2}, {7, 20}})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
