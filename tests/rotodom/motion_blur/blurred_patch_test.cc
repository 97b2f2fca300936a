#include "rotodom/motion_blur/blurred_patch.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/simd/simd_level.h"
#include "rotodom/tracking/tracking.h"
#include "tests/rotodom/tracking/turning_views.h"

namespace rotslam {
namespace {

constexpr double kExposure_s = 0.02;
constexpr double kPatchReachPx = 3.0;

struct PointErrors {
  std::vector<double> px;
  int num_sought = 0;
};

// Of the points of frame i in frame j, where the time of exposure is taken to be `exposure_s`.
PointErrors ErrorsOf(
    const FilmedStart& film, const Eigen::Vector3d& acceleration, int i, int j, double exposure_s) {
  const View& from = film.views[i];
  const View& in = film.views[j];
  const Rotation j_from_i = film.cam_from_world[j] * film.cam_from_world[i].Inverse();
  const auto blur_vector = [&](const View& view, int index) {
    return BlurVectorOf(
        SmallCamera(), view.features.bearings[index], view.timestamp_s * acceleration, exposure_s);
  };
  PointErrors errors;
  for (int index_j = 0; index_j < in.features.size(); ++index_j) {
    const int index_i = FindTrack(from.features, in.features.tracks[index_j]);
    if (index_i < 0) continue;
    ++errors.num_sought;
    const Eigen::Vector2d truth_px = in.features.keypoints_px[index_j];
    const BlurredPatch patch{from.pyramid.levels.front(),
                             from.features.keypoints_px[index_i],
                             PatchWarp(SmallCamera(), from.features.bearings[index_i], j_from_i),
                             blur_vector(from, index_i)};
    const auto found = AlignBlurredPatch(patch,
                                         in.pyramid.levels.front(),
                                         truth_px + Eigen::Vector2d(0.4, -0.3),
                                         blur_vector(in, index_j),
                                         kPatchReachPx);
    if (found) errors.px.push_back((found->center_px - truth_px).norm());
  }
  return errors;
}

void ExpectBlurTakenOut(const Eigen::Vector3d& acceleration, int i, int j) {
  const FilmedStart film = FilmStart(Start(acceleration), std::max(i, j) + 1, kExposure_s);
  const PointErrors blurred = ErrorsOf(film, acceleration, i, j, 0.0);
  const PointErrors alike = ErrorsOf(film, acceleration, i, j, kExposure_s);
  testing::Test::RecordProperty(
      "median_px",
      std::to_string(Quantile(blurred.px, 0.5)) + " -> " + std::to_string(Quantile(alike.px, 0.5)));
  ASSERT_GT(alike.num_sought, 100);
  EXPECT_GT(std::ssize(alike.px), 0.9 * alike.num_sought);
  EXPECT_LT(Quantile(alike.px, 0.5), 0.05);
  EXPECT_LT(Quantile(alike.px, 0.5), 0.25 * Quantile(blurred.px, 0.5));
  EXPECT_LT(Quantile(alike.px, 0.9), 0.25 * Quantile(blurred.px, 0.9));
}

// 0 to 10 px in six frames.
TEST(AlignBlurredPatch, FindsSharpPatchesInABlurredImage) {
  ExpectBlurTakenOut({0.0, 10.0, 0.0}, 0, 6);
}

TEST(AlignBlurredPatch, FindsBlurredPatchesInASharperImage) {
  ExpectBlurTakenOut({0.0, 10.0, 0.0}, 6, 2);
}

TEST(AlignBlurredPatch, KnowsOtherDirections) { ExpectBlurTakenOut({7.0, 7.0, 0.0}, 1, 6); }

// The blur vectors of a roll have all directions, and the patches turn between the two views.
TEST(AlignBlurredPatch, KnowsARoll) { ExpectBlurTakenOut({0.0, 0.0, 20.0}, 0, 6); }

TEST(AlignBlurredPatch, IsAlignPatchWithoutBlur) {
  const FilmedStart film = FilmStart(Start({0.0, 3.0, 0.0}), 3, 0.0);
  const PointErrors errors = ErrorsOf(film, {0.0, 3.0, 0.0}, 0, 2, 0.0);
  const View& from = film.views[0];
  const View& in = film.views[2];
  const Rotation j_from_i = film.cam_from_world[2] * film.cam_from_world[0].Inverse();
  std::vector<double> without_px;
  for (int index = 0; index < in.features.size(); ++index) {
    const int index_i = FindTrack(from.features, in.features.tracks[index]);
    const Eigen::Vector2d truth_px = in.features.keypoints_px[index];
    const auto patch =
        PatchTemplate::Sample(from.pyramid.levels.front(),
                              from.features.keypoints_px[index_i],
                              PatchWarp(SmallCamera(), from.features.bearings[index_i], j_from_i));
    if (!patch) continue;
    const auto found = AlignPatch(
        *patch, in.pyramid.levels.front(), truth_px + Eigen::Vector2d(0.4, -0.3), kPatchReachPx);
    if (found) without_px.push_back((found->center_px - truth_px).norm());
  }
  EXPECT_NEAR(Quantile(errors.px, 0.5), Quantile(without_px, 0.5), 0.002);
}

// What lies beyond the border is not known; nothing may be read there.
TEST(AlignBlurredPatch, StaysInsideTheImage) {
  const FilmedStart film = FilmStart(Start({0.0, 10.0, 0.0}), 7, kExposure_s);
  const cv::Mat sharp = film.views[0].pyramid.levels.front().clone();
  const cv::Mat blurred = film.views[6].pyramid.levels.front().clone();
  for (const Eigen::Vector2d& corner_px :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(319, 0), Eigen::Vector2d(319, 239)}) {
    const auto found = AlignBlurredPatch({sharp, corner_px, Eigen::Matrix2d::Identity(), {0, 0}},
                                         blurred,
                                         corner_px,
                                         {40.0, -40.0},
                                         kPatchReachPx);
    if (!found) continue;
    EXPECT_LE((found->center_px - corner_px).norm(), kPatchReachPx + 1.0);
  }
}

// Where a lens folds the image, blur vectors and warps have no bound.
TEST(AlignBlurredPatch, RefusesWhatNoImageShows) {
  const FilmedStart film = FilmStart(Start({0.0, 10.0, 0.0}), 1, 0.0);
  const cv::Mat& image = film.views[0].pyramid.levels.front();
  const Eigen::Vector2d middle_px(160.0, 120.0);
  const Eigen::Matrix2d same = Eigen::Matrix2d::Identity();
  const auto align = [&](const Eigen::Matrix2d& warp, const Eigen::Vector2d& blur_px) {
    return AlignBlurredPatch({image, middle_px, warp, {3.0, 0.0}}, image, middle_px, blur_px, 3.0);
  };
  EXPECT_TRUE(align(same, {-3.0, 0.0}));
  EXPECT_FALSE(align(same, {1e6, 0.0}));
  EXPECT_FALSE(align(same, {std::nan(""), 0.0}));
  EXPECT_FALSE(align(1e-4 * same, {1.0, 0.0}));
  EXPECT_FALSE(align(Eigen::Matrix2d::Zero(), {1.0, 0.0}));
}

// What AlignBlurredPatch answers for many patches, places and blur vectors.
std::vector<double> AlignMany(int& num_found) {
  const FilmedStart film = FilmStart(Start({0.0, 10.0, 0.0}), 7, kExposure_s);
  const View& from = film.views[0];
  const View& in = film.views[6];
  const Rotation in_from = film.cam_from_world[6] * film.cam_from_world[0].Inverse();
  std::vector<double> all;
  num_found = 0;
  for (int index = 0; index < in.features.size(); ++index) {
    const int before = FindTrack(from.features, in.features.tracks[index]);
    if (before < 0) continue;
    const Eigen::Vector2d blur_px(1.0 + index % 13, index % 5 - 2.0);
    const BlurredPatch patch{from.pyramid.levels.front(),
                             from.features.keypoints_px[before],
                             PatchWarp(SmallCamera(), from.features.bearings[before], in_from),
                             {0.5, 0.25 * (index % 7)}};
    // Some starts lie so far from the place that it is outside the small window.
    const Eigen::Vector2d start_px =
        in.features.keypoints_px[index] + Eigen::Vector2d(index % 2 == 0 ? 4.0 : 0.3, 0.2);
    const auto found = AlignBlurredPatch(patch, in.pyramid.levels.front(), start_px, blur_px, 8.0);
    if (!found) continue;
    ++num_found;
    all.insert(all.end(), {found->center_px.x(), found->center_px.y(), found->correlation});
  }
  return all;
}

TEST(AlignBlurredPatch, EveryLevelOfInstructionsGivesTheSame) {
  int num_found = 0;
  LimitSimdLevel(SimdLevel::kBaseline);
  const std::vector<double> baseline = AlignMany(num_found);
  EXPECT_GT(num_found, 50);
  LimitSimdLevel(SimdLevel::kAvx2);
  EXPECT_EQ(AlignMany(num_found), baseline);
  LimitSimdLevel(SimdLevel::kAvx512);
  EXPECT_EQ(AlignMany(num_found), baseline);
}

}  // namespace
}  // namespace rotslam
