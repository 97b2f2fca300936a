#include "rotodom/tracking/recovery.h"

#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "tests/rotodom/tracking/world_views.h"

namespace rotslam {
namespace {

RecoveryOptions Options(int num_threads = 1) {
  RecoveryOptions options;
  options.features = FewFeatures();
  options.num_threads = num_threads;
  return options;
}

// A view of the world to come back to, and one that shows something else.
class RecoverMotionTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    known_ = MakeView(Look(Rotation()), FrameId{0}, 0.0, 0);
    blank_ = MakeView(cv::Mat(240, 320, CV_8U, cv::Scalar(90)), FrameId{1}, 0.1, 1000);
    stranger_ = MakeView(TexturedWorld(99).View(SmallCamera(), Rotation()), FrameId{2}, 0.2, 2000);
  }

  static cv::Mat Look(const Rotation& cam_from_world) {
    static const TexturedWorld world;
    return world.View(SmallCamera(), cam_from_world);
  }

  // Nothing is known of the target's orientation: the prediction is the old view's.
  static std::optional<Recovery> Recover(const std::vector<OrientedView>& views,
                                         const cv::Mat& image,
                                         const RecoveryOptions& options = Options()) {
    const ImagePyramid pyramid = BuildPyramid(image, FewFeatures());
    TrackingTarget target;
    target.pyramid = &pyramid;
    target.timestamp_s = 0.5;
    return RecoverMotion(views, target, SmallCamera(), options);
  }

  static std::vector<double> ErrorsPx(const Recovery& recovery, const Rotation& cam_from_world) {
    std::vector<double> errors_px;
    for (const TrackedPoint& point : recovery.points) {
      const auto truth_px =
          SmallCamera().Project(cam_from_world * known_.features.bearings[point.index]);
      errors_px.push_back(truth_px ? (point.keypoint_px - *truth_px).norm() : 1e3);
    }
    return errors_px;
  }

  inline static View known_;
  inline static View blank_;
  inline static View stranger_;
};

TEST_F(RecoverMotionTest, NeedsNoPrediction) {
  for (const Rotation& cam_from_world :
       {TurnDeg(0.0, 20.0, 0.0), TurnDeg(0.0, 0.0, 21.0), TurnDeg(-8.0, 10.0, 60.0)}) {
    const auto recovery = Recover({{&known_, Rotation()}}, Look(cam_from_world));
    ASSERT_TRUE(recovery) << cam_from_world.Log().transpose();
    EXPECT_LT((recovery->cam_from_world * cam_from_world.Inverse()).AngleDeg(), 0.1);
    EXPECT_GT(recovery->points.size(), 80u);
    const std::string at = std::to_string(static_cast<int>(cam_from_world.AngleDeg()));
    for (std::size_t k = 0; k < recovery->points.size(); ++k) {
      const TrackedPoint& point = recovery->points[k];
      EXPECT_EQ(point.view, 0);
      EXPECT_EQ(known_.features.tracks[point.index], point.track);
      if (k > 0) {
        EXPECT_LT(recovery->points[k - 1].track, point.track);
      }
    }
    const std::vector<double> errors_px = ErrorsPx(*recovery, cam_from_world);
    EXPECT_LT(Quantile(errors_px, 0.5), 0.05);
    EXPECT_LT(Quantile(errors_px, 0.9), 0.15);
    // The wall is infinitely far away: nothing moves beside the rotation.
    EXPECT_LT(recovery->flow.At({160.0, 120.0}).norm(), 2.0);
    RecordProperty("points_at_" + at, static_cast<int>(recovery->points.size()));
    RecordProperty(
        "turn_deg",
        std::to_string((recovery->cam_from_world * cam_from_world.Inverse()).AngleDeg()));
    RecordProperty("median_px_at_" + at, std::to_string(Quantile(errors_px, 0.5)));
    RecordProperty("p90_px_at_" + at, std::to_string(Quantile(errors_px, 0.9)));
  }
}

TEST_F(RecoverMotionTest, SaysHowFarItHadToSearch) {
  struct Case {
    Rotation cam_from_world;
    SearchRange range;
  };
  // 4 px, 91 px, and up to the image's diagonal.
  for (const auto& [cam_from_world, range] : {Case{TurnDeg(0, 1, 0), SearchRange::kGuided},
                                              Case{TurnDeg(0, 20, 0), SearchRange::kWide},
                                              Case{TurnDeg(0, 0, 160), SearchRange::kWholeImage}}) {
    const auto recovery = Recover({{&known_, Rotation()}}, Look(cam_from_world));
    ASSERT_TRUE(recovery);
    EXPECT_EQ(recovery->range, range) << cam_from_world.AngleDeg() << " deg";
  }
}

TEST_F(RecoverMotionTest, OrientationsAreThoseOfTheViews) {
  const Rotation known_from_world = TurnDeg(40.0, -70.0, 110.0);
  const Rotation turn = TurnDeg(2.0, 12.0, 0.0);
  const auto recovery = Recover({{&known_, known_from_world}}, Look(turn));
  ASSERT_TRUE(recovery);
  const Rotation truth = turn * known_from_world;
  EXPECT_LT((recovery->cam_from_world * truth.Inverse()).AngleDeg(), 0.1);
}

TEST_F(RecoverMotionTest, TriesOneViewAfterTheOther) {
  const Rotation cam_from_world = TurnDeg(0.0, 15.0, 5.0);
  const cv::Mat image = Look(cam_from_world);
  const Rotation elsewhere = TurnDeg(80.0, 0.0, 0.0);
  const auto recovery =
      Recover({{&blank_, elsewhere}, {&stranger_, elsewhere}, {&known_, Rotation()}}, image);
  ASSERT_TRUE(recovery);
  EXPECT_TRUE(recovery->is_clear);
  EXPECT_LT((recovery->cam_from_world * cam_from_world.Inverse()).AngleDeg(), 0.1);
  ASSERT_FALSE(recovery->points.empty());
  for (const TrackedPoint& point : recovery->points) EXPECT_EQ(point.view, 2);
}

TEST_F(RecoverMotionTest, SaysSoWhereNothingMatches) {
  const cv::Mat image = Look(TurnDeg(0.0, 5.0, 0.0));
  EXPECT_FALSE(Recover({}, image));
  EXPECT_FALSE(Recover({{&blank_, Rotation()}}, image));
  EXPECT_FALSE(Recover({{&known_, Rotation()}}, cv::Mat(240, 320, CV_8U, cv::Scalar(90))));
}

TEST_F(RecoverMotionTest, IsNotFooledByAnotherPlace) {
  int num_found = 0;
  for (const std::uint64_t seed : {99u, 100u, 101u, 102u, 103u}) {
    num_found +=
        Recover({{&known_, Rotation()}}, TexturedWorld(seed).View(SmallCamera(), Rotation()))
            .has_value();
  }
  EXPECT_EQ(num_found, 0);
}

TEST_F(RecoverMotionTest, IsOnlyAGuideWhereTooFewAgree) {
  const Rotation cam_from_world = TurnDeg(0.0, 15.0, 10.0);
  cv::Mat image;
  cv::blur(Look(cam_from_world), image, cv::Size(9, 1));
  RecoveryOptions options = Options();
  const auto clear = Recover({{&known_, Rotation()}}, image, options);
  ASSERT_TRUE(clear);
  EXPECT_TRUE(clear->is_clear);
  ASSERT_LT(static_cast<int>(clear->points.size()), options.tracking.min_points);
  options.min_inlier_ratio = 0.99;
  const auto guide = Recover({{&known_, Rotation()}}, image, options);
  ASSERT_TRUE(guide);
  EXPECT_FALSE(guide->is_clear);
  EXPECT_LT((guide->guide_cam_from_world * cam_from_world.Inverse()).AngleDeg(), 2.0);
}

TEST_F(RecoverMotionTest, LeavesOutLostPoints) {
  View view = known_;
  for (int n = 0; n < view.features.size(); n += 2) view.is_lost[n] = true;
  const cv::Mat image = Look(TurnDeg(0.0, 12.0, 0.0));
  const auto all = Recover({{&known_, Rotation()}}, image);
  const auto recovery = Recover({{&view, Rotation()}}, image);
  ASSERT_TRUE(all && recovery);
  EXPECT_GT(recovery->points.size(), all->points.size() / 4);
  EXPECT_LT(recovery->points.size(), all->points.size() * 3 / 4);
  for (const TrackedPoint& point : recovery->points) EXPECT_EQ(point.index % 2, 1);
}

TEST_F(RecoverMotionTest, SameAnswerAtAnyThreadCount) {
  const cv::Mat image = Look(TurnDeg(3.0, 12.0, -9.0));
  const auto one = Recover({{&known_, Rotation()}}, image);
  ASSERT_TRUE(one);
  for (const int num_threads : {2, 5}) {
    const auto many = Recover({{&known_, Rotation()}}, image, Options(num_threads));
    ASSERT_TRUE(many);
    EXPECT_EQ(one->cam_from_world.Quaternion().coeffs(),
              many->cam_from_world.Quaternion().coeffs());
    ASSERT_EQ(one->points.size(), many->points.size());
    for (std::size_t k = 0; k < one->points.size(); ++k) {
      EXPECT_EQ(one->points[k].track, many->points[k].track);
      EXPECT_EQ(one->points[k].keypoint_px, many->points[k].keypoint_px);
    }
  }
}

}  // namespace
}  // namespace rotslam
