#include "rotodom/features/features.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

cv::Mat TexturedImage() { return TexturedWorld().View(SmallCamera(), Rotation()); }

FeatureOptions WithCount(int max_features) {
  FeatureOptions options;
  options.max_features = max_features;
  return options;
}

void ExpectSameBytes(const Features& a, const Features& b) {
  EXPECT_EQ(a.keypoints_px, b.keypoints_px);
  EXPECT_EQ(a.bearings, b.bearings);
  EXPECT_EQ(a.levels, b.levels);
  EXPECT_EQ(a.angles_rad, b.angles_rad);
  EXPECT_EQ(a.rgb, b.rgb);
  ASSERT_EQ(a.descriptors.size(), b.descriptors.size());
  EXPECT_TRUE(std::equal(a.descriptors.datastart, a.descriptors.dataend, b.descriptors.datastart));
}

TEST(ExtractFeatures, NeverGivesMoreThanAskedFor) {
  const cv::Mat image = TexturedImage();
  for (const int num_levels : {1, 2, 3, 5, 8}) {
    for (const int max_features : {50, 51, 52, 55, 77, 100, 150, 200}) {
      FeatureOptions options = WithCount(max_features);
      options.num_levels = num_levels;
      const Features features = ExtractFeatures(image, FrameId{0}, SmallCamera(), options, 1);
      EXPECT_LE(features.size(), max_features) << num_levels << " levels";
      EXPECT_GE(features.size(), max_features * 4 / 5) << num_levels << " levels";
    }
  }
}

TEST(ExtractFeatures, EveryPartOfTheImageHasSome) {
  const Features features =
      ExtractFeatures(TexturedImage(), FrameId{0}, SmallCamera(), WithCount(400), 1);
  std::array<int, 16> in_cell = {};
  for (const Eigen::Vector2d& keypoint : features.keypoints_px) {
    ++in_cell[int(keypoint.y()) / 60 * 4 + int(keypoint.x()) / 80];
  }
  // A sixteenth would be 25; the border without descriptors takes from the outer cells.
  for (int cell = 0; cell < 16; ++cell) EXPECT_GE(in_cell[cell], 8) << "cell " << cell;
}

TEST(ExtractFeatures, ADarkCornerIsSearchedWithTheLowerThreshold) {
  cv::Mat image = TexturedImage();
  cv::Mat corner = image(cv::Rect(0, 120, 160, 120));
  corner.convertTo(corner, CV_8U, 18.0 / 255.0, 10.0);  // no contrast above 18 grey levels
  const auto in_corner = [&](const FeatureOptions& options) {
    const Features features = ExtractFeatures(image, FrameId{0}, SmallCamera(), options, 1);
    return std::count_if(
        features.keypoints_px.begin(), features.keypoints_px.end(), [](const auto& keypoint) {
          return keypoint.x() < 150.0 && keypoint.y() > 130.0;
        });
  };
  FeatureOptions options = WithCount(400);
  EXPECT_GE(in_corner(options), 10);
  options.min_fast_threshold = options.fast_threshold;
  EXPECT_EQ(in_corner(options), 0);
}

TEST(ExtractFeatures, SameBytesAtAnyThreadCount) {
  const cv::Mat image = TexturedImage();
  const Features one = ExtractFeatures(image, FrameId{0}, SmallCamera(), {}, 1);
  ASSERT_GT(one.size(), 0);
  for (const int num_threads : {2, 4}) {
    ExpectSameBytes(one, ExtractFeatures(image, FrameId{0}, SmallCamera(), {}, num_threads));
  }
}

TEST(ExtractFeatures, ListsBelongTogether) {
  const Camera camera = SmallCamera();
  const FeatureOptions options = WithCount(300);
  const Features features = ExtractFeatures(TexturedImage(), FrameId{7}, camera, options, 1);
  EXPECT_EQ(features.frame, FrameId{7});
  const std::size_t n = features.keypoints_px.size();
  ASSERT_GT(n, 0u);
  EXPECT_EQ(features.bearings.size(), n);
  EXPECT_EQ(features.levels.size(), n);
  EXPECT_EQ(features.angles_rad.size(), n);
  EXPECT_EQ(features.rgb.size(), n);
  EXPECT_EQ(features.descriptors.rows, static_cast<int>(n));
  EXPECT_EQ(features.descriptors.cols, 32);
  EXPECT_EQ(features.descriptors.type(), CV_8UC1);
  for (std::size_t k = 0; k < n; ++k) {
    EXPECT_EQ(features.bearings[k], *camera.Unproject(features.keypoints_px[k]));
    EXPECT_GE(features.levels[k], 0);
    EXPECT_LT(features.levels[k], options.num_levels);
    if (k == 0 || features.levels[k] != features.levels[k - 1]) {
      EXPECT_TRUE(k == 0 || features.levels[k] > features.levels[k - 1]);
      continue;
    }
    const Eigen::Vector2d& before = features.keypoints_px[k - 1];
    const Eigen::Vector2d& here = features.keypoints_px[k];
    EXPECT_TRUE(before.y() < here.y() || (before.y() == here.y() && before.x() < here.x()));
  }
  EXPECT_GT(features.levels.back(), 3);
}

TEST(ExtractFeatures, ABlackImageHasNone) {
  for (const int grey : {0, 128, 255}) {
    const cv::Mat image(240, 320, CV_8U, cv::Scalar(grey));
    EXPECT_EQ(ExtractFeatures(image, FrameId{0}, SmallCamera(), {}, 2).size(), 0);
  }
}

TEST(ExtractFeatures, ColourIsTakenAtTheKeypoint) {
  const cv::Mat grey = TexturedImage();
  cv::Mat dark;
  cv::Mat inverse;
  grey.convertTo(dark, CV_8U, 0.5);
  grey.convertTo(inverse, CV_8U, -0.5, 200.0);
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>{dark, grey, inverse}, image);
  const Features features = ExtractFeatures(image, FrameId{0}, SmallCamera(), WithCount(200), 1);
  ASSERT_GT(features.size(), 0);
  for (int k = 0; k < features.size(); ++k) {
    const auto bgr = image.at<cv::Vec3b>(int(std::lround(features.keypoints_px[k].y())),
                                         int(std::lround(features.keypoints_px[k].x())));
    EXPECT_EQ(features.rgb[k], (std::array<std::uint8_t, 3>{bgr[2], bgr[1], bgr[0]}));
  }
}

TEST(ExtractFeatures, GreyInThreeChannelsIsGrey) {
  const cv::Mat grey = TexturedImage();
  cv::Mat three;
  cv::merge(std::vector<cv::Mat>{grey, grey, grey}, three);
  ExpectSameBytes(ExtractFeatures(grey, FrameId{0}, SmallCamera(), {}, 1),
                  ExtractFeatures(three, FrameId{0}, SmallCamera(), {}, 1));
}

TEST(ExtractFeatures, TinyImagesHaveFewOrNone) {
  const cv::Mat image = TexturedImage();
  for (const cv::Size size : {cv::Size(1, 1),
                              cv::Size(10, 10),
                              cv::Size(38, 38),
                              cv::Size(39, 39),
                              cv::Size(44, 44),
                              cv::Size(60, 20),
                              cv::Size(20, 200),
                              cv::Size(64, 48)}) {
    const cv::Mat tiny = image(cv::Rect(cv::Point(40, 20), size)).clone();
    const Features features = ExtractFeatures(tiny, FrameId{0}, SmallCamera(), {}, 1);
    EXPECT_LE(features.size(), size.area() / 8) << size;
    for (const Eigen::Vector2d& keypoint : features.keypoints_px) {
      EXPECT_TRUE(keypoint.x() < size.width && keypoint.y() < size.height) << size;
    }
  }
}

TEST(ExtractFeatures, LeavesOutWhatTheCameraModelDoesNotReach) {
  Camera folded = SmallCamera();
  folded.model = CameraModel::kRadtan;
  folded.distortion[0] = -1.2;  // folds over well inside the image
  const cv::Mat image = TexturedImage();
  const Features all = ExtractFeatures(image, FrameId{0}, SmallCamera(), WithCount(300), 1);
  const Features some = ExtractFeatures(image, FrameId{0}, folded, WithCount(300), 1);
  EXPECT_GT(some.size(), 0);
  EXPECT_LT(some.size(), all.size());
  EXPECT_EQ(some.descriptors.rows, some.size());
  // What is left kept its descriptor.
  int k = 0;
  for (int n = 0; n < all.size() && k < some.size(); ++n) {
    if (all.keypoints_px[n] != some.keypoints_px[k] || all.levels[n] != some.levels[k]) continue;
    EXPECT_EQ(cv::norm(all.descriptors.row(n), some.descriptors.row(k), cv::NORM_HAMMING), 0.0);
    ++k;
  }
  EXPECT_EQ(k, some.size());
}

TEST(ExtractFeatures, RejectsABrokenContract) {
  const auto extract = [](const cv::Mat& image, const FeatureOptions& options) {
    ExtractFeatures(image, FrameId{0}, SmallCamera(), options, 1);
  };
  EXPECT_THROW(extract(cv::Mat(), {}), std::invalid_argument);
  EXPECT_THROW(extract(cv::Mat::zeros(240, 320, CV_32F), {}), std::invalid_argument);
  EXPECT_THROW(extract(cv::Mat::zeros(240, 320, CV_16U), {}), std::invalid_argument);
  EXPECT_THROW(extract(cv::Mat::zeros(240, 320, CV_8UC4), {}), std::invalid_argument);
  EXPECT_THROW(extract(TexturedImage(), WithCount(49)), std::invalid_argument);
}

TEST(FeatureOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(FeatureOptions{}.Problem());
  const auto problem = [](auto change) {
    FeatureOptions options;
    change(options);
    return options.Problem().value_or("none");
  };
  using Options = FeatureOptions&;
  EXPECT_EQ(problem([](Options o) { o.max_features = 10; }),
            "max_features is 10, must be at least 50");
  EXPECT_TRUE(problem([](Options o) { o.num_levels = 0; }).starts_with("num_levels is 0"));
  EXPECT_TRUE(problem([](Options o) { o.scale_factor = 1.0; }).starts_with("scale_factor is 1"));
  EXPECT_TRUE(
      problem([](Options o) { o.min_fast_threshold = 0; }).starts_with("min_fast_threshold is 0"));
  EXPECT_TRUE(problem([](Options o) { o.fast_threshold = 3; }).starts_with("fast_threshold is 3"));
}

}  // namespace
}  // namespace rotslam
