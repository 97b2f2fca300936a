// Time of matching two frames whose rotation is predicted, and of two of which nothing is, beside
// how many true pairs are found; cv::BFMatcher with its ratio test next to them.
#include <cstdint>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/features2d.hpp>

#include "rotodom/matching/matching.h"

namespace rotslam {
namespace {

constexpr int kNumFeatures = 3000;
constexpr int kNumFlipped = 20;  // of 256 bits, between two sightings of a corner
constexpr int kNumLevels = 8;

Camera WideCamera() {
  Camera camera;
  camera.width = 752;
  camera.height = 480;
  camera.fx = camera.fy = 460.0;
  camera.cx = 375.5;
  camera.cy = 239.5;
  return camera;
}

// The corner with number k is k in both frames; the second frame sees them elsewhere.
struct Pair {
  Pair() {
    std::mt19937 random(3);
    const auto below = [&](int count) { return static_cast<int>(random() % count); };
    for (Features* features : {&first, &second}) {
      features->descriptors.create(kNumFeatures, 32, CV_8U);
    }
    for (int k = 0; k < kNumFeatures; ++k) {
      const int level = below(kNumLevels);
      for (Features* features : {&first, &second}) {
        const Eigen::Vector2d px(below(camera.width), below(camera.height));
        features->keypoints_px.push_back(px);
        features->bearings.push_back(*camera.Unproject(px));
        features->levels.push_back(level);
        features->angles_rad.push_back(0.0F);
      }
      std::uint8_t* descriptor = first.descriptors.ptr<std::uint8_t>(k);
      for (int byte = 0; byte < 32; ++byte) {
        descriptor[byte] = static_cast<std::uint8_t>(below(256));
      }
      first.descriptors.row(k).copyTo(second.descriptors.row(k));
      for (int flip = 0; flip < kNumFlipped; ++flip) {
        second.descriptors.at<std::uint8_t>(k, below(32)) ^=
            static_cast<std::uint8_t>(1U << below(8));
      }
    }
  }

  Camera camera = WideCamera();
  Features first;
  Features second;
};

// Where `options` ask for no more matches than there are, they are found around the prediction.
void Measure(const Pair& pair, const MatchingOptions& options, benchmark::State& state) {
  double num_true = 0.0;
  for (auto _ : state) {
    const Matches matches = MatchFeatures(pair.first, pair.second, {}, pair.camera, options);
    num_true = 0.0;
    for (const Match& match : matches.matches) {
      num_true += match.i.value == match.j.value ? 1 : 0;
    }
  }
  state.counters["true_pairs"] = num_true / kNumFeatures;
}

// All three searches, the last one in the whole image.
void BM_MatchAnywhere(benchmark::State& state) {
  MatchingOptions options;
  options.min_matches = kNumFeatures;
  Measure(Pair(), options, state);
}
BENCHMARK(BM_MatchAnywhere)->Unit(benchmark::kMillisecond);

void BM_MatchGuided(benchmark::State& state) {
  Pair pair;
  pair.second.keypoints_px = pair.first.keypoints_px;
  pair.second.bearings = pair.first.bearings;
  Measure(pair, {}, state);
}
BENCHMARK(BM_MatchGuided)->Unit(benchmark::kMillisecond);

void BM_OpenCv(benchmark::State& state) {
  const Pair pair;
  const cv::BFMatcher matcher(cv::NORM_HAMMING);
  const MatchingOptions options;
  double num_true = 0.0;
  for (auto _ : state) {
    std::vector<std::vector<cv::DMatch>> nearest;
    matcher.knnMatch(pair.first.descriptors, pair.second.descriptors, nearest, 2);
    num_true = 0.0;
    for (const std::vector<cv::DMatch>& two : nearest) {
      if (two[0].distance > options.ratio * two[1].distance) continue;
      num_true += two[0].queryIdx == two[0].trainIdx ? 1 : 0;
    }
  }
  state.counters["true_pairs"] = num_true / kNumFeatures;
}
BENCHMARK(BM_OpenCv)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace rotslam

BENCHMARK_MAIN();
