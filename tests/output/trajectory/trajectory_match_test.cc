#include "output/trajectory/trajectory_match.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A camera that turns about all of its axes on a curved path.
NamedTrajectory Truth() {
  NamedTrajectory truth{{{}, "TUM", {}, true, true}, "truth.txt"};
  for (int k = 0; k < 100; ++k) {
    const double t = 0.05 * k;
    truth.file.poses.push_back({t,
                                Rotation::Exp({0.5 * std::sin(t), 0.8 * t, 0.3 * std::cos(2 * t)}),
                                {3.0 * std::cos(t), std::sin(2.0 * t), t}});
  }
  return truth;
}

// Some hundredths of a degree off, in another world, of another size.
NamedTrajectory Estimate() {
  NamedTrajectory estimate = Truth();
  estimate.name = "estimate.txt";
  const Rotation other_from_world = Rotation::Exp({1.0, 2.0, -0.5});
  int k = 0;
  for (StampedPose& pose : estimate.file.poses) {
    const Rotation noise =
        Rotation::Exp({0.0005 * std::sin(3.0 * k), 0.0005 * std::cos(7.0 * k), 0});
    pose.world_from_cam = other_from_world * pose.world_from_cam * noise;
    pose.center_in_world = 0.5 * (other_from_world * pose.center_in_world);
    ++k;
  }
  return estimate;
}

double Rpe(const MatchedTrajectories& matched) {
  return ComputeMetrics(matched.pairs, {}).rpe1_deg;
}

const double kRightDeg = Rpe(MatchTrajectories(Truth(), Estimate(), {}));

void Invert(Trajectory& poses) {
  for (StampedPose& pose : poses) {
    pose.world_from_cam = pose.world_from_cam.Inverse();
    pose.center_in_world = -(pose.world_from_cam * pose.center_in_world);
  }
}

TEST(MatchTrajectories, LeavesWhatFits) {
  EXPECT_LT(kRightDeg, 0.06);
  const MatchedTrajectories matched = MatchTrajectories(Truth(), Estimate(), {});
  EXPECT_THAT(matched.notes, IsEmpty());
  EXPECT_EQ(matched.pairs.size(), 100u);
}

TEST(MatchTrajectories, FindsTheOneThatIsWorldToCamera) {
  NamedTrajectory truth = Truth();
  Invert(truth.file.poses);
  MatchedTrajectories matched = MatchTrajectories(truth, Estimate(), {});
  EXPECT_NEAR(Rpe(matched), kRightDeg, 1e-9);
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("truth.txt is taken for world->camera")));
  NamedTrajectory estimate = Estimate();
  Invert(estimate.file.poses);
  matched = MatchTrajectories(Truth(), estimate, {});
  EXPECT_NEAR(Rpe(matched), kRightDeg, 1e-9);
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("estimate.txt is taken for world->camera")));
  MatchOptions as_is;
  as_is.as_is = true;
  matched = MatchTrajectories(Truth(), estimate, as_is);
  EXPECT_GT(Rpe(matched), 10.0 * kRightDeg);
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("fit far better if estimate.txt is taken for")));
}

TEST(MatchTrajectories, FindsTheOrderOfAQuaternion) {
  NamedTrajectory truth = Truth();
  for (StampedPose& pose : truth.file.poses) {
    const Eigen::Quaterniond q = pose.world_from_cam.Quaternion();
    pose.world_from_cam = Rotation(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()));
  }
  const MatchedTrajectories matched = MatchTrajectories(truth, Estimate(), {});
  EXPECT_NEAR(Rpe(matched), kRightDeg, 1e-9);
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("truth.txt is taken for qw first")));
}

TEST(MatchTrajectories, SaysHowTheAxesAreTurnedAndTakesThatOutWhenAsked) {
  const Rotation cam_from_body = Rotation::Exp({1.2, -1.2, 1.2});
  NamedTrajectory truth = Truth();
  for (StampedPose& pose : truth.file.poses) {
    pose.world_from_cam = pose.world_from_cam * cam_from_body;
  }
  MatchedTrajectories matched = MatchTrajectories(truth, Estimate(), {});
  EXPECT_GT(Rpe(matched), 10.0 * kRightDeg);
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("turned by 119.")));
  MatchOptions options;
  options.align_axes = true;
  matched = MatchTrajectories(truth, Estimate(), options);
  EXPECT_NEAR(Rpe(matched), kRightDeg, 1e-3);
  const auto fit = FitAxes(MatchTrajectories(truth, Estimate(), {}).pairs, 1);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT((fit->truth_axes_from_estimate_axes * cam_from_body).AngleDeg(), 0.1);
}

TEST(MatchTrajectories, OneAxisTellsNothing) {
  NamedTrajectory truth = Truth();
  for (StampedPose& pose : truth.file.poses) {
    pose.world_from_cam = Rotation::Exp({0.0, 0.8 * pose.timestamp_s, 0.0});
  }
  NamedTrajectory estimate = truth;
  Invert(estimate.file.poses);
  const MatchedTrajectories matched = MatchTrajectories(truth, estimate, {});
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("one axis alone")));
  EXPECT_FALSE(FitAxes(matched.pairs, 1).has_value());
}

TEST(MatchTrajectories, PairsNumberedPosesInTheirOrder) {
  NamedTrajectory truth = Truth();
  NamedTrajectory estimate = Estimate();
  for (StampedPose& pose : estimate.file.poses) pose.timestamp_s += 1.4e9;
  for (std::size_t k = 0; k < truth.file.poses.size(); ++k) {
    truth.file.poses[k].timestamp_s = static_cast<double>(k);
  }
  const MatchedTrajectories matched = MatchTrajectories(truth, estimate, {});
  EXPECT_NEAR(Rpe(matched), kRightDeg, 1e-9);
  EXPECT_THAT(matched.notes, ElementsAre(HasSubstr("both have 100 poses")));
  truth.file.poses.pop_back();
  try {
    MatchTrajectories(truth, estimate, {});
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("99 against 100: give the times of its poses with --times"));
  }
}

TEST(MatchTrajectories, SaysByHowMuchTimesAreApart) {
  NamedTrajectory truth = Truth();
  for (StampedPose& pose : truth.file.poses) pose.timestamp_s += 3600.0;
  try {
    MatchTrajectories(truth, Estimate(), {});
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("starts 3600.000 s apart: --time-offset 3600 would"));
  }
  MatchOptions options;
  options.time_offset_s = 3600.0;
  EXPECT_NEAR(Rpe(MatchTrajectories(truth, Estimate(), options)), kRightDeg, 1e-6);
}

}  // namespace
}  // namespace rotslam
