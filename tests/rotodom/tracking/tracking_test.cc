#include "rotodom/tracking/tracking.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "tests/rotodom/tracking/turning_views.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr double kStepS = 0.1;

const TexturedWorld& TheWorld() {
  static const TexturedWorld world;
  return world;
}

cv::Mat Look(const Rotation& cam_from_world) {
  return TheWorld().View(SmallCamera(), cam_from_world);
}

cv::Mat Noisy(const cv::Mat& image, double sigma, std::uint64_t seed) {
  // Streams of neighbouring seeds overlap.
  SceneRandom random(seed * 1'000'003);
  cv::Mat noisy = image.clone();
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      noisy.at<std::uint8_t>(row, column) = cv::saturate_cast<std::uint8_t>(
          image.at<std::uint8_t>(row, column) + random.Normal(sigma));
    }
  }
  return noisy;
}

TrackingTarget TargetAt(const ImagePyramid& pyramid, const Rotation& predicted_cam_from_world) {
  TrackingTarget target;
  target.pyramid = &pyramid;
  target.timestamp_s = kStepS;
  target.cam_from_world = predicted_cam_from_world;
  return target;
}

ImagePyramid PyramidOf(const cv::Mat& image) { return BuildPyramid(image, FewFeatures()); }

// The distance of each point from where the true orientation puts it.
std::vector<double> ErrorsPx(const TrackingResult& result,
                             const std::vector<OrientedView>& views,
                             const Rotation& cam_from_world) {
  std::vector<double> errors_px;
  for (const TrackedPoint& point : result.points) {
    const OrientedView& from = views[point.view];
    const auto truth_px =
        SmallCamera().Project(cam_from_world * (from.cam_from_world.Inverse() *
                                                from.view->features.bearings[point.index]));
    errors_px.push_back(truth_px ? (point.keypoint_px - *truth_px).norm() : 1e3);
  }
  return errors_px;
}

double TurnBetweenDeg(const Rotation& a, const Rotation& b) { return (a * b.Inverse()).AngleDeg(); }

void Record(const std::string& name, double value) {
  testing::Test::RecordProperty(name, std::to_string(value));
}

TEST(TrackPoints, FollowsARotationThatWasPredictedBadly) {
  const View view = MakeView(Look(Rotation()), FrameId{0}, 0.0, 0);
  const std::vector<OrientedView> views = {{&view, Rotation()}};
  const Rotation cam_from_world = TurnDeg(1.0, -3.0, 0.5);
  const ImagePyramid pyramid = PyramidOf(Look(cam_from_world));
  for (const double wrong_deg : {0.0, 1.0, 2.0, 3.0}) {
    // A degree is 4.4 px.
    const Rotation wrong =
        Rotation::Exp(wrong_deg * kRadFromDeg * Eigen::Vector3d(0.6, -0.7, 0.387298));
    const TrackingResult result =
        TrackPoints(views, TargetAt(pyramid, wrong * cam_from_world), SmallCamera(), {}, 1);
    EXPECT_LT(TurnBetweenDeg(result.cam_from_world, cam_from_world), 0.05) << wrong_deg << " deg";
    EXPECT_GT(static_cast<int>(result.points.size()), 0.9 * result.num_sought)
        << wrong_deg << " deg";
    EXPECT_GT(result.num_sought, 400);
    EXPECT_FALSE(result.IsPoor({}));
    const std::vector<double> errors_px = ErrorsPx(result, views, cam_from_world);
    EXPECT_LT(Quantile(errors_px, 0.5), 0.05) << wrong_deg << " deg";
    EXPECT_LT(Quantile(errors_px, 0.9), 0.15) << wrong_deg << " deg";
    const std::string name = std::to_string(static_cast<int>(wrong_deg)) + "_deg";
    Record("turn_deg_at_" + name, TurnBetweenDeg(result.cam_from_world, cam_from_world));
    Record("median_px_at_" + name, Quantile(errors_px, 0.5));
    Record("p90_px_at_" + name, Quantile(errors_px, 0.9));
  }
}

TEST(TrackPoints, TurnsThePatches) {
  const View view = MakeView(Look(Rotation()), FrameId{0}, 0.0, 0);
  const std::vector<OrientedView> views = {{&view, Rotation()}};
  for (const double roll_deg : {5.0, 15.0, 30.0}) {
    const Rotation cam_from_world = TurnDeg(0.0, 2.0, roll_deg);
    const ImagePyramid pyramid = PyramidOf(Look(cam_from_world));
    const TrackingResult result =
        TrackPoints(views, TargetAt(pyramid, cam_from_world), SmallCamera(), {}, 1);
    EXPECT_GT(static_cast<int>(result.points.size()), 0.85 * result.num_sought) << roll_deg;
    EXPECT_LT(Quantile(ErrorsPx(result, views, cam_from_world), 0.5), 0.05) << roll_deg;
    Record("found_at_" + std::to_string(static_cast<int>(roll_deg)),
           static_cast<double>(result.points.size()) / result.num_sought);
    Record("median_px_at_" + std::to_string(static_cast<int>(roll_deg)),
           Quantile(ErrorsPx(result, views, cam_from_world), 0.5));
  }
}

class TrackPointsOfThreeViews : public testing::Test {
 protected:
  void SetUp() override {
    oldest_ = MakeView(Look(oldest_from_world_), FrameId{0}, -2.0 * kStepS, 100);
    middle_ = CarryOver(oldest_,
                        middle_from_world_ * oldest_from_world_.Inverse(),
                        Look(middle_from_world_),
                        FrameId{1},
                        -kStepS,
                        2);
    newest_ = CarryOver(oldest_,
                        newest_from_world_ * oldest_from_world_.Inverse(),
                        Look(newest_from_world_),
                        FrameId{2},
                        0.0,
                        3);
    views_ = {{&newest_, newest_from_world_},
              {&middle_, middle_from_world_},
              {&oldest_, oldest_from_world_}};
    pyramid_ = PyramidOf(Look(cam_from_world_));
  }

  TrackingResult Track(int max_points = 2000, int num_threads = 1) const {
    TrackingTarget target = TargetAt(pyramid_, cam_from_world_);
    target.max_points = max_points;
    return TrackPoints(views_, target, SmallCamera(), {}, num_threads);
  }

  static bool Shows(const View& view, TrackId track) {
    return std::binary_search(view.features.tracks.begin(), view.features.tracks.end(), track);
  }

  const Rotation oldest_from_world_;
  const Rotation middle_from_world_ = TurnDeg(0.5, 1.0, -0.5);
  const Rotation newest_from_world_ = TurnDeg(1.0, 2.0, -1.0);
  const Rotation cam_from_world_ = TurnDeg(1.5, 3.0, -1.5);
  View oldest_;
  View middle_;
  View newest_;
  std::vector<OrientedView> views_;  // newest first
  ImagePyramid pyramid_;
};

TEST_F(TrackPointsOfThreeViews, FindsEachInTheNewestThatShowsIt) {
  const TrackingResult result = Track();
  ASSERT_GT(result.points.size(), 350u);
  std::array<int, 3> from_view = {};
  for (std::size_t k = 0; k < result.points.size(); ++k) {
    const TrackedPoint& point = result.points[k];
    if (k > 0) {
      EXPECT_LT(result.points[k - 1].track, point.track);
    }
    EXPECT_EQ(views_[point.view].view->features.tracks[point.index], point.track);
    for (int newer = 0; newer < point.view; ++newer) {
      EXPECT_FALSE(Shows(*views_[newer].view, point.track)) << point.track.value;
    }
    ++from_view[point.view];
  }
  for (const int count : from_view) EXPECT_GT(count, 50);
  EXPECT_LT(Quantile(ErrorsPx(result, views_, cam_from_world_), 0.5), 0.05);
}

TEST_F(TrackPointsOfThreeViews, OldPointsFillTheRoomThatIsLeft) {
  const int in_newest = newest_.features.size();
  const TrackingResult all = Track();
  const auto count_old = [](const TrackingResult& result) {
    return std::count_if(
        result.points.begin(), result.points.end(), [](const auto& point) { return point.view; });
  };
  const auto count_new = [&](const TrackingResult& result) {
    return static_cast<std::ptrdiff_t>(result.points.size()) - count_old(result);
  };
  EXPECT_GT(count_old(all), 100);
  for (const int room : {0, 1, 40}) {
    const TrackingResult result = Track(in_newest + room);
    EXPECT_LE(result.num_sought, in_newest + room);
    EXPECT_LE(count_old(result), room);
    EXPECT_GE(count_old(result), room / 2);
    EXPECT_GE(count_new(result), count_new(all) - 2);  // the probes may differ
  }
  // The newest view's points are followed whatever their number.
  EXPECT_GE(count_new(Track(in_newest / 2)), count_new(all) - 2);
  EXPECT_EQ(count_old(Track(in_newest / 2)), 0);
}

TEST_F(TrackPointsOfThreeViews, LostPointsAreNotSought) {
  const TrackingResult before = Track();
  std::vector<TrackId> lost;
  for (int n = 0; n < newest_.features.size(); n += 2) {
    newest_.is_lost[n] = true;
    lost.push_back(newest_.features.tracks[n]);  // the oldest view shows it too, and not as lost
  }
  const TrackingResult result = Track();
  for (const TrackedPoint& point : result.points) {
    EXPECT_FALSE(std::binary_search(lost.begin(), lost.end(), point.track)) << point.track.value;
  }
  EXPECT_LE(result.num_sought, before.num_sought - static_cast<int>(lost.size()) * 8 / 10);
  // One that only an older view calls lost goes on.
  std::fill(newest_.is_lost.begin(), newest_.is_lost.end(), false);
  for (int n = 0; n < oldest_.features.size(); ++n) {
    oldest_.is_lost[n] = Shows(newest_, oldest_.features.tracks[n]);
  }
  EXPECT_EQ(Track().num_sought, before.num_sought);
}

TEST_F(TrackPointsOfThreeViews, SameAnswerAtAnyThreadCount) {
  const TrackingResult one = Track(2000, 1);
  for (const int num_threads : {2, 5}) {
    const TrackingResult many = Track(2000, num_threads);
    EXPECT_EQ(one.cam_from_world.Quaternion().coeffs(), many.cam_from_world.Quaternion().coeffs());
    EXPECT_EQ(one.num_sought, many.num_sought);
    ASSERT_EQ(one.points.size(), many.points.size());
    for (std::size_t k = 0; k < one.points.size(); ++k) {
      EXPECT_EQ(one.points[k].track, many.points[k].track);
      EXPECT_EQ(one.points[k].view, many.points[k].view);
      EXPECT_EQ(one.points[k].index, many.points[k].index);
      EXPECT_EQ(one.points[k].keypoint_px, many.points[k].keypoint_px);
    }
  }
}

TEST(TrackPoints, MoreReferencesAverageTheirNoise) {
  constexpr double kNoise = 8.0;  // grey levels
  const Rotation newest_from_world = TurnDeg(0.3, 0.6, -0.2);
  const Rotation cam_from_world = TurnDeg(0.6, 1.2, -0.4);
  const View clean = MakeView(Look(Rotation()), FrameId{0}, -kStepS, 0);
  const View oldest =
      CarryOver(clean, Rotation(), Noisy(Look(Rotation()), kNoise, 1), FrameId{0}, -kStepS);
  const View newest = CarryOver(
      clean, newest_from_world, Noisy(Look(newest_from_world), kNoise, 2), FrameId{1}, 0.0);
  const std::vector<OrientedView> views = {{&newest, newest_from_world}, {&oldest, Rotation()}};
  const ImagePyramid pyramid = PyramidOf(Noisy(Look(cam_from_world), kNoise, 3));
  const auto median_px = [&](int num_references) {
    TrackingOptions options;
    options.num_references = num_references;
    return Quantile(
        ErrorsPx(TrackPoints(views, TargetAt(pyramid, cam_from_world), SmallCamera(), options, 1),
                 views,
                 cam_from_world),
        0.5);
  };
  const double one_px = median_px(1);
  const double two_px = median_px(2);
  Record("one_px", one_px);
  Record("two_px", two_px);
  // The target's noise stays, of the references' half: sqrt(3/4) where all is independent.
  EXPECT_LT(two_px, 0.95 * one_px);
  EXPECT_GT(two_px, 0.7 * one_px);
}

// The left half of the picture moves up and the right half down: no rotation does that.
TEST(TrackPoints, PointsGoOnWithTheirOwnMotion) {
  constexpr int kShiftPx = 14;
  const cv::Mat image = Look(Rotation());
  const View resting = MakeView(image, FrameId{0}, 0.0, 0);
  const cv::Rect left(0, 0, image.cols / 2, image.rows);
  const cv::Rect right(image.cols / 2, 0, image.cols / 2, image.rows);
  cv::Mat moved = cv::Mat::zeros(image.size(), CV_8U);
  const auto upper = [&](int top) { return cv::Range(top, image.rows - kShiftPx + top); };
  image(left)(upper(kShiftPx), cv::Range::all()).copyTo(moved(left)(upper(0), cv::Range::all()));
  image(right)(upper(0), cv::Range::all()).copyTo(moved(right)(upper(kShiftPx), cv::Range::all()));
  const ImagePyramid pyramid = PyramidOf(moved);

  View moving = resting;
  FlowField field(image.cols, image.rows);
  for (int n = 0; n < moving.features.size(); ++n) {
    const bool is_left = moving.features.keypoints_px[n].x() < image.cols / 2;
    moving.flow_px_per_s[n] = {0.0, (is_left ? -kShiftPx : kShiftPx) / kStepS};
    field.Add(moving.features.keypoints_px[n], moving.flow_px_per_s[n]);
  }
  const auto num_right = [&](const View& view, const FlowField* flow) {
    const std::vector<OrientedView> views = {{&view, Rotation()}};
    TrackingTarget target = TargetAt(pyramid, Rotation());
    target.flow = flow;
    int count = 0;
    for (const TrackedPoint& point : TrackPoints(views, target, SmallCamera(), {}, 1).points) {
      const Eigen::Vector2d truth_px =
          view.features.keypoints_px[point.index] + kStepS * moving.flow_px_per_s[point.index];
      count += (point.keypoint_px - truth_px).norm() < 0.2;
    }
    return count;
  };
  const int with_own = num_right(moving, nullptr);
  const int with_field = num_right(resting, &field);
  const int without = num_right(resting, nullptr);
  RecordProperty("with_own", with_own);
  RecordProperty("with_field", with_field);
  RecordProperty("without", without);
  EXPECT_GT(with_own, 0.75 * moving.features.size());
  EXPECT_GT(with_field, 0.75 * moving.features.size());
  EXPECT_LT(without, 0.5 * with_own);
}

TEST(TrackPoints, FindsNothingInSomethingElse) {
  const View view = MakeView(Look(Rotation()), FrameId{0}, 0.0, 0);
  const std::vector<OrientedView> views = {{&view, Rotation()}};
  const ImagePyramid blank = PyramidOf(cv::Mat(240, 320, CV_8U, cv::Scalar(90)));
  const TrackingResult in_blank =
      TrackPoints(views, TargetAt(blank, Rotation()), SmallCamera(), {}, 1);
  EXPECT_TRUE(in_blank.points.empty());
  EXPECT_TRUE(in_blank.IsPoor({}));
  EXPECT_EQ(in_blank.cam_from_world.Angle(), 0.0);
  const ImagePyramid elsewhere = PyramidOf(TexturedWorld(99).View(SmallCamera(), Rotation()));
  EXPECT_TRUE(TrackPoints(views, TargetAt(elsewhere, Rotation()), SmallCamera(), {}, 1).IsPoor({}));
  const TrackingResult of_none = TrackPoints({}, TargetAt(blank, Rotation()), SmallCamera(), {}, 1);
  EXPECT_TRUE(of_none.points.empty());
  EXPECT_EQ(of_none.num_sought, 0);
}

TEST(TrackPoints, SeeksOnlyWhatTheImageCanShow) {
  const View view = MakeView(Look(Rotation()), FrameId{0}, 0.0, 0);
  const std::vector<OrientedView> views = {{&view, Rotation()}};
  // Half the view of 65 deg has left the image, and all of it behind the camera.
  const ImagePyramid pyramid = PyramidOf(Look(TurnDeg(0.0, 25.0, 0.0)));
  const TrackingResult result =
      TrackPoints(views, TargetAt(pyramid, TurnDeg(0.0, 25.0, 0.0)), SmallCamera(), {}, 1);
  EXPECT_LT(result.num_sought, 0.8 * view.features.size());
  EXPECT_GT(result.num_sought, 0.4 * view.features.size());
  for (const TrackedPoint& point : result.points) {
    EXPECT_TRUE(point.keypoint_px.x() >= 0.0 && point.keypoint_px.x() <= 319.0);
    EXPECT_TRUE(point.keypoint_px.y() >= 0.0 && point.keypoint_px.y() <= 239.0);
  }
  EXPECT_EQ(TrackPoints(views, TargetAt(pyramid, TurnDeg(0.0, 180.0, 0.0)), SmallCamera(), {}, 1)
                .num_sought,
            0);
}

TEST(TrackingResult, IsPoorWithFewPointsOrFewOfThoseSought) {
  const auto is_poor = [](int num_found, int num_sought) {
    TrackingOptions options;
    options.min_points = 50;
    options.min_found_ratio = 0.4;
    TrackingResult result;
    result.points.resize(num_found);
    result.num_sought = num_sought;
    return result.IsPoor(options);
  };
  EXPECT_TRUE(is_poor(0, 0));
  EXPECT_TRUE(is_poor(49, 49));
  EXPECT_FALSE(is_poor(50, 50));
  EXPECT_FALSE(is_poor(400, 1000));
  EXPECT_TRUE(is_poor(399, 1000));
}

TEST(AlignMostBearings, IsNotMovedByTheOthers) {
  SceneRandom random(4);
  const Rotation j_from_i = TurnDeg(3.0, -7.0, 11.0);
  for (const double share : {0.0, 0.2, 0.4}) {
    std::vector<BearingPair> pairs;
    for (int k = 0; k < 200; ++k) {
      const Eigen::Vector3d bearing =
          Eigen::Vector3d(random.Uniform(-0.6, 0.6), random.Uniform(-0.5, 0.5), 1.0).normalized();
      // The others agree among themselves, which is worse than if they were scattered.
      const Rotation turn = k < 200 * share ? TurnDeg(2.0, 0.0, 0.0) * j_from_i : j_from_i;
      pairs.push_back({bearing, turn * bearing});
    }
    const auto found = AlignMostBearings(pairs);
    ASSERT_TRUE(found);
    EXPECT_LT(TurnBetweenDeg(*found, j_from_i), share == 0.0 ? 1e-9 : 0.3) << share;
    Record("turn_deg_at_" + std::to_string(share), TurnBetweenDeg(*found, j_from_i));
  }
}

TEST(AlignMostBearings, NeedsTenPairs) {
  std::vector<BearingPair> pairs;
  for (int k = 0; k < 9; ++k) {
    const Eigen::Vector3d bearing = Eigen::Vector3d(0.1 * k, 0.03 * k * k, 1.0).normalized();
    pairs.push_back({bearing, bearing});
  }
  EXPECT_FALSE(AlignMostBearings({}));
  EXPECT_FALSE(AlignMostBearings(pairs));
  pairs.push_back({Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitZ()});
  EXPECT_TRUE(AlignMostBearings(pairs));
}

TEST(TrackingOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(TrackingOptions{}.Problem());
  const auto problem = [](auto change) {
    TrackingOptions options;
    change(options);
    return options.Problem().value_or("none");
  };
  using Options = TrackingOptions&;
  EXPECT_TRUE(
      problem([](Options o) { o.min_correlation = 1.0; }).starts_with("min_correlation is"));
  EXPECT_TRUE(problem([](Options o) { o.min_correlation = -0.1; }).starts_with("min_correlation"));
  EXPECT_TRUE(problem([](Options o) { o.num_references = 0; }).starts_with("num_references is 0"));
  EXPECT_TRUE(problem([](Options o) { o.min_points = -1; }).starts_with("min_points is -1"));
  EXPECT_TRUE(problem([](Options o) { o.min_found_ratio = 1.5; }).starts_with("min_found_ratio"));
  TrackingOptions bad;
  bad.num_references = 0;
  EXPECT_THROW(TrackPoints({}, {}, SmallCamera(), bad, 1), std::invalid_argument);
}

// Four views before the target tell how fast it turns; nobody tells the tracker.
TEST(TrackPoints, SeeksPointsOfASharpViewInABlurredOne) {
  constexpr double kExposureS = 0.02;
  const FilmedStart film = FilmStart(Start({2.0, 10.0, 4.0}), 6, kExposureS);
  std::vector<OrientedView> views;
  for (int k = 4; k >= 0; --k) views.push_back({&film.views[k], film.cam_from_world[k]});
  TrackingTarget target = TargetAt(film.views[5].pyramid, film.cam_from_world[5]);
  target.timestamp_s = film.views[5].timestamp_s;
  const auto errors_px = [&](double exposure_s) {
    target.exposure_s = exposure_s;
    return ErrorsPx(
        TrackPoints(views, target, SmallCamera(), {}, 1), views, film.cam_from_world[5]);
  };
  const std::vector<double> blurred = errors_px(0.0);
  const std::vector<double> alike = errors_px(kExposureS);
  Record("median_px", Quantile(blurred, 0.5));
  Record("median_alike_px", Quantile(alike, 0.5));
  EXPECT_GT(static_cast<double>(alike.size()), 0.98 * static_cast<double>(blurred.size()));
  EXPECT_LT(Quantile(alike, 0.5), 0.5 * Quantile(blurred, 0.5));
  EXPECT_LT(Quantile(alike, 0.9), 0.5 * Quantile(blurred, 0.9));
}

}  // namespace
}  // namespace rotslam
