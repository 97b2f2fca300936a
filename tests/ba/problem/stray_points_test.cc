#include "ba/problem/stray_points.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "ba/outliers/classification.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

class StrayPointsTest : public testing::Test {
 protected:
  StrayPointsTest() {
    BaScene scene = MakeBaScene({.noise_px = 0.2});
    problem_.camera = scene.camera;
    problem_.start = std::move(scene.truth);
    state_ = MakeBundleState(problem_, options_);
    ClassifyAll(options_.fine, Placement::kAnywhere, options_, state_);
    const auto point =
        std::find_if(state_.tracks.begin(), state_.tracks.end(), [](const TrackState& track) {
          return track.kind == TrackKind::kPoint;
        });
    stray_ = static_cast<std::size_t>(point - state_.tracks.begin());
    start_ = point->position;
    behind_ =
        2.0 * state_.centers[state_.frames[point->observations.front().frame].center] - start_;
  }

  // Where the state's cameras stand, moved.
  std::vector<StrayPoints::Pose> Poses(const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) {
    std::vector<StrayPoints::Pose> poses;
    for (const FrameState& frame : state_.frames) {
      poses.push_back({frame.cam_from_world.Matrix(), state_.centers[frame.center] + shift});
    }
    return poses;
  }

  BundleOptions options_;
  BundleProblem problem_;
  BundleState state_;
  std::size_t stray_ = 0;
  Eigen::Vector3d start_;
  Eigen::Vector3d behind_;
};

TEST_F(StrayPointsTest, PutsAPointThrownBehindTheCamerasWhereTheySeeIt) {
  StrayPoints strays(state_, 0.0, 2);
  strays.Start(Poses());
  // The others go along with the cameras.
  const Eigen::Vector3d moved(0.3, -0.1, 0.2);
  for (TrackState& track : state_.tracks) track.position += moved;
  state_.tracks[stray_].position = behind_;
  strays.Try(Poses(moved));
  const Eigen::Vector3d error = behind_ + strays.Shift(stray_).shift - (start_ + moved);
  EXPECT_LT(error.norm(), 0.05 * start_.norm());
  for (std::size_t k = 0; k < state_.tracks.size(); ++k) {
    if (k == stray_) continue;
    EXPECT_EQ(strays.Shift(k).shift, Eigen::Vector3d::Zero()) << k;
  }
}

TEST_F(StrayPointsTest, ForgetsARefusedStep) {
  StrayPoints strays(state_, 0.0, 1);
  strays.Start(Poses());
  state_.tracks[stray_].position = behind_;
  strays.Try(Poses());
  EXPECT_NE(strays.Shift(stray_).shift, Eigen::Vector3d::Zero());
  EXPECT_EQ(strays.AcceptedShift(stray_).shift, Eigen::Vector3d::Zero());
  state_.tracks[stray_].position = start_;
  strays.Try(Poses());
  EXPECT_EQ(strays.Shift(stray_).shift, Eigen::Vector3d::Zero());
}

TEST_F(StrayPointsTest, KeepsWhatAnAcceptedStepHasShifted) {
  StrayPoints strays(state_, 0.0, 1);
  strays.Start(Poses());
  state_.tracks[stray_].position = behind_;
  strays.Try(Poses());
  strays.Accept();
  const Eigen::Vector3d shift = strays.AcceptedShift(stray_).shift;
  EXPECT_EQ(shift, strays.Shift(stray_).shift);
  state_.tracks[stray_].position += Eigen::Vector3d(1e-3, 0.0, 0.0);
  strays.Try(Poses());
  EXPECT_EQ(strays.Shift(stray_).shift, shift);
}

TEST_F(StrayPointsTest, LosesAPointThatHasNoPlaceAndFindsItAgain) {
  StrayPoints strays(state_, 0.0, 1);
  strays.Start(Poses());
  // Every other camera looks aside, so that no place is right for all.
  std::vector<StrayPoints::Pose> poses = Poses();
  for (std::size_t k = 0; k < poses.size(); k += 2) {
    poses[k].R_c_w = Rotation::Exp({0.0, 1.0, 0.0}).Matrix() * poses[k].R_c_w;
  }
  state_.tracks[stray_].position = behind_;
  strays.Try(poses);
  EXPECT_TRUE(strays.Shift(stray_).lost);
  EXPECT_FALSE(strays.AcceptedShift(stray_).lost);
  strays.Accept();
  EXPECT_TRUE(strays.AcceptedShift(stray_).lost);
  strays.Try(Poses());
  EXPECT_FALSE(strays.Shift(stray_).lost);
  EXPECT_LT((behind_ + strays.Shift(stray_).shift - start_).norm(), 0.05 * start_.norm());
}

// Observations that never fitted are no reason to move a point.
TEST_F(StrayPointsTest, LeavesAPointThatIsSeenAsBadlyAsBefore) {
  state_.tracks[stray_].observations.front().bearing =
      -state_.tracks[stray_].observations.front().bearing;
  StrayPoints strays(state_, 0.0, 1);
  strays.Start(Poses());
  strays.Try(Poses());
  EXPECT_EQ(strays.Shift(stray_).shift, Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace rotslam
