#include "rotodom/features/features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>

#include "rotodom/features/binary_descriptor.h"
#include "rotodom/features/orb_descriptor.h"
#include "tests/rotodom/features/repeatability.h"
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
  for (const int num_threads : {2, 5}) {
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

// Every second of the features, as if tracked to a place a little off.
Features Carried(const Features& all, const Camera& camera) {
  Features carried;
  carried.frame = all.frame;
  for (int k = 0; k < all.size(); k += 2) {
    const Eigen::Vector2d position = all.keypoints_px[k] + Eigen::Vector2d(0.3, -0.4);
    carried.keypoints_px.push_back(position);
    carried.bearings.push_back(*camera.Unproject(position));
    carried.levels.push_back(all.levels[k]);
    carried.rgb.push_back(all.rgb[k]);
  }
  return carried;
}

TEST(DetectFeatures, KeepsCarriedFeaturesAndTheirDistance) {
  const Camera camera = SmallCamera();
  const FeatureOptions options = WithCount(400);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  Features all;
  DetectFeatures(pyramid, camera, options, 1, all);
  const Features carried = Carried(all, camera);
  Features features = carried;
  DetectFeatures(pyramid, camera, options, 1, features);
  ASSERT_GT(features.size(), carried.size() + 50);
  EXPECT_LE(features.size(), options.max_features);
  for (int k = 0; k < carried.size(); ++k) {
    EXPECT_EQ(features.keypoints_px[k], carried.keypoints_px[k]);
    EXPECT_EQ(features.bearings[k], carried.bearings[k]);
    EXPECT_EQ(features.levels[k], carried.levels[k]);
  }
  for (int k = carried.size(); k < features.size(); ++k) {
    for (int n = 0; n < features.size(); ++n) {
      if (n == k || features.levels[n] != features.levels[k]) continue;
      const int level = features.levels[k];
      const double distance = (pyramid.ToLevel(features.keypoints_px[k], level) -
                               pyramid.ToLevel(features.keypoints_px[n], level))
                                  .norm();
      EXPECT_GE(distance, options.min_distance_px - 1e-9);
    }
  }
}

TEST(DetectFeatures, NewFeaturesGoWhereNoneAreCarried) {
  const Camera camera = SmallCamera();
  const FeatureOptions options = WithCount(400);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  const auto is_left = [](const Eigen::Vector2d& position) { return position.x() < 160.0; };
  Features all;
  DetectFeatures(pyramid, camera, options, 1, all);
  Features features;
  for (int k = 0; k < all.size(); ++k) {
    if (!is_left(all.keypoints_px[k])) continue;
    features.keypoints_px.push_back(all.keypoints_px[k]);
    features.bearings.push_back(all.bearings[k]);
    features.levels.push_back(all.levels[k]);
    features.rgb.push_back(all.rgb[k]);
  }
  const int num_carried = features.size();
  DetectFeatures(pyramid, camera, options, 1, features);
  const auto new_left = std::count_if(
      features.keypoints_px.begin() + num_carried, features.keypoints_px.end(), is_left);
  const auto num_new = features.size() - num_carried;
  ASSERT_GT(num_new, 100);
  EXPECT_LT(new_left, num_new / 5);
}

TEST(DetectFeatures, AddsNothingToAFullFrame) {
  const Camera camera = SmallCamera();
  FeatureOptions options = WithCount(400);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  Features features;
  DetectFeatures(pyramid, camera, options, 1, features);
  const int before = features.size();
  ASSERT_GT(before, 200);
  options.max_features = 200;
  DetectFeatures(pyramid, camera, options, 1, features);
  EXPECT_EQ(features.size(), before);
  // One level that holds everything leaves nothing for the others.
  features.levels.assign(features.levels.size(), 2);
  options.max_features = before + 1;
  DetectFeatures(pyramid, camera, options, 1, features);
  EXPECT_LE(features.size(), before + 1);
}

TEST(DetectFeatures, SameBytesWithCarriedOnesAtAnyThreadCount) {
  const Camera camera = SmallCamera();
  const FeatureOptions options = WithCount(400);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  Features all;
  DetectFeatures(pyramid, camera, options, 1, all);
  const auto complete = [&](int num_threads) {
    Features features = Carried(all, camera);
    DetectFeatures(pyramid, camera, options, num_threads, features);
    DescribeFeatures(pyramid, num_threads, features);
    return features;
  };
  const Features one = complete(1);
  for (const int num_threads : {2, 5}) ExpectSameBytes(one, complete(num_threads));
}

TEST(DetectFeatures, RejectsABrokenContract) {
  const Camera camera = SmallCamera();
  const FeatureOptions options = WithCount(100);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  Features good;
  DetectFeatures(pyramid, camera, options, 1, good);
  ASSERT_GT(good.size(), 0);
  const auto detect = [&](auto change) {
    Features features = good;
    change(features);
    DetectFeatures(pyramid, camera, options, 1, features);
  };
  EXPECT_NO_THROW(detect([](Features&) {}));
  EXPECT_THROW(detect([](Features& f) { f.rgb.pop_back(); }), std::invalid_argument);
  EXPECT_THROW(detect([](Features& f) { f.bearings.pop_back(); }), std::invalid_argument);
  EXPECT_THROW(detect([](Features& f) { f.levels[0] = 8; }), std::invalid_argument);
  EXPECT_THROW(detect([](Features& f) { f.levels[0] = -1; }), std::invalid_argument);
  EXPECT_THROW(detect([](Features& f) { f.keypoints_px[0].x() = std::nan(""); }),
               std::invalid_argument);
  FeatureOptions other = options;
  other.num_levels = 3;
  Features features;
  EXPECT_THROW(DetectFeatures(pyramid, camera, other, 1, features), std::invalid_argument);
}

TEST(DescribeFeatures, AreThoseOfCvOrb) {
  const FeatureOptions options = WithCount(500);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  Features features;
  DetectFeatures(pyramid, SmallCamera(), options, 1, features);
  DescribeFeatures(pyramid, 1, features);
  const auto orb = cv::ORB::create(500, 1.2F, 1, 19, 0, 2, cv::ORB::HARRIS_SCORE, 31);
  for (int level = 0; level < options.num_levels; ++level) {
    const cv::Mat& image = pyramid.levels[level];
    std::vector<cv::KeyPoint> keypoints;
    std::vector<int> index;
    for (int k = 0; k < features.size(); ++k) {
      if (features.levels[k] != level) continue;
      const Eigen::Vector2d place = pyramid.ToLevel(features.keypoints_px[k], level);
      const int x = static_cast<int>(std::lround(place.x()));
      const int y = static_cast<int>(std::lround(place.y()));
      const float angle_deg =
          CentroidAngleDeg(image.ptr<std::uint8_t>(y) + x, static_cast<std::ptrdiff_t>(image.step));
      keypoints.emplace_back(float(x), float(y), 31.0F, angle_deg, 1.0F, 0);
      index.push_back(k);
      EXPECT_FLOAT_EQ(features.angles_rad[k], angle_deg * float(CV_PI) / 180.0F);
    }
    ASSERT_FALSE(keypoints.empty());
    const std::size_t n = keypoints.size();
    cv::Mat descriptors;
    orb->compute(image, keypoints, descriptors);
    ASSERT_EQ(keypoints.size(), n) << "level " << level;
    // Blurred in whole numbers here and in floating point there: about one bit in a thousand.
    double bits = 0.0;
    for (std::size_t row = 0; row < n; ++row) {
      const double distance = cv::norm(descriptors.row(static_cast<int>(row)),
                                       features.descriptors.row(index[row]),
                                       cv::NORM_HAMMING);
      EXPECT_LE(distance, 6.0) << "level " << level;
      bits += distance;
    }
    EXPECT_LE(bits, 1.0 * static_cast<double>(n)) << "level " << level;
  }
}

TEST(DescribeFeatures, MirrorsTheImageAtItsBorder) {
  constexpr int kMargin = 64;
  FeatureOptions options;
  options.num_levels = 1;
  const cv::Mat image = TexturedImage();
  cv::Mat larger;
  cv::copyMakeBorder(image, larger, kMargin, kMargin, kMargin, kMargin, cv::BORDER_REFLECT_101);
  Features at_border;
  Features well_inside;
  for (int k = 0; k < 30; ++k) {
    for (const Eigen::Vector2d& position : {Eigen::Vector2d(k, 37.0),
                                            Eigen::Vector2d(0.4 + k, 239.0 - k),
                                            Eigen::Vector2d(319.0 - k, 5.0 * k),
                                            Eigen::Vector2d(100.0 + k, k - 0.3)}) {
      at_border.keypoints_px.push_back(position);
      well_inside.keypoints_px.push_back(position + Eigen::Vector2d(kMargin, kMargin));
      at_border.levels.push_back(0);
      well_inside.levels.push_back(0);
    }
  }
  DescribeFeatures(BuildPyramid(image, options), 1, at_border);
  DescribeFeatures(BuildPyramid(larger, options), 1, well_inside);
  EXPECT_EQ(at_border.angles_rad, well_inside.angles_rad);
  EXPECT_EQ(cv::norm(at_border.descriptors, well_inside.descriptors, cv::NORM_HAMMING), 0.0);
}

TEST(DescribeFeatures, StartsWhereItIsTold) {
  const FeatureOptions options = WithCount(300);
  const ImagePyramid pyramid = BuildPyramid(TexturedImage(), options);
  Features features;
  DetectFeatures(pyramid, SmallCamera(), options, 1, features);
  Features all = features;
  DescribeFeatures(pyramid, 1, all);
  const int first = all.size() / 3;
  EXPECT_THROW(DescribeFeatures(pyramid, 1, features, first), std::invalid_argument);
  EXPECT_THROW(DescribeFeatures(pyramid, 1, features, -1), std::invalid_argument);
  EXPECT_THROW(DescribeFeatures(pyramid, 1, features, all.size() + 1), std::invalid_argument);
  // Those before it keep theirs, whatever they are.
  features.angles_rad.assign(first, 9.0F);
  features.descriptors = cv::Mat(first, 32, CV_8UC1, cv::Scalar(77));
  DescribeFeatures(pyramid, 1, features, first);
  ASSERT_EQ(features.descriptors.rows, all.size());
  ASSERT_EQ(features.angles_rad.size(), all.angles_rad.size());
  for (int k = 0; k < all.size(); ++k) {
    EXPECT_EQ(features.angles_rad[k], k < first ? 9.0F : all.angles_rad[k]);
    const cv::Mat expected =
        k < first ? cv::Mat(1, 32, CV_8UC1, cv::Scalar(77)) : all.descriptors.row(k);
    EXPECT_EQ(cv::norm(features.descriptors.row(k), expected, cv::NORM_HAMMING), 0.0);
  }
}

// A ladder of turns and scales beside cv::ORB. That takes the strongest corners wherever they are,
// which are found again more often than weak ones that stand alone; ours may lose a fifth to it.
TEST(ExtractFeatures, FindsFeaturesAgainAfterTurningAndScaling) {
  const cv::Mat image = TexturedImage();
  const FeatureOptions options = WithCount(400);
  const auto orb = cv::ORB::create(
      400, 1.2F, options.num_levels, 19, 0, 2, cv::ORB::HARRIS_SCORE, 31, options.fast_threshold);
  std::vector<cv::KeyPoint> of_orb;
  cv::Mat descriptors_of_orb;
  orb->detectAndCompute(image, cv::noArray(), of_orb, descriptors_of_orb);
  const Features features = ExtractFeatures(image, FrameId{0}, SmallCamera(), options, 1);
  struct Rung {
    double turn_deg;
    double scale;
  };
  for (const Rung& rung :
       {Rung{0.0, 1.0}, Rung{5.0, 1.0}, Rung{30.0, 1.0}, Rung{0.0, 0.8}, Rung{90.0, 0.9}}) {
    const WarpedImage warped = Warp(image, rung.turn_deg, rung.scale, 2.0, 1);
    const Features there = ExtractFeatures(warped.image, FrameId{1}, SmallCamera(), options, 1);
    const Repeatability ours = Compare(ToKeyPoints(features),
                                       features.descriptors,
                                       ToKeyPoints(there),
                                       there.descriptors,
                                       warped,
                                       rung.scale,
                                       options.scale_factor);
    std::vector<cv::KeyPoint> there_of_orb;
    cv::Mat there_descriptors;
    orb->detectAndCompute(warped.image, cv::noArray(), there_of_orb, there_descriptors);
    const Repeatability of_cv = Compare(of_orb,
                                        descriptors_of_orb,
                                        there_of_orb,
                                        there_descriptors,
                                        warped,
                                        rung.scale,
                                        options.scale_factor);
    const auto share = [](int count, const Repeatability& of) {
      return double(count) / of.visible;
    };
    ASSERT_GT(ours.visible, 100);
    ASSERT_GT(of_cv.visible, 100);
    EXPECT_GE(share(ours.found_again, ours), share(of_cv.found_again, of_cv) - 0.2)
        << rung.turn_deg << " deg, scale " << rung.scale;
    EXPECT_GE(share(ours.matched, ours), share(of_cv.matched, of_cv) - 0.2)
        << rung.turn_deg << " deg, scale " << rung.scale;
    EXPECT_GE(share(ours.matched, ours), 0.3) << rung.turn_deg << " deg, scale " << rung.scale;
  }
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
  EXPECT_TRUE(
      problem([](Options o) { o.min_distance_px = -1.0; }).starts_with("min_distance_px is -1"));
}

TEST(BinaryDescriptors, AreTheRowsOfAMatrix) {
  cv::Mat rows(2, 32, CV_8U);
  for (int k = 0; k < 64; ++k) rows.data[k] = static_cast<std::uint8_t>(k);
  const std::vector<BinaryDescriptor> descriptors = ToBinaryDescriptors(rows);
  ASSERT_EQ(descriptors.size(), 2U);
  EXPECT_EQ(descriptors[1][0], 0x2726252423222120U);
  EXPECT_TRUE(ToBinaryDescriptors(cv::Mat()).empty());
  EXPECT_THROW(ToBinaryDescriptors(cv::Mat(2, 31, CV_8U)), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
