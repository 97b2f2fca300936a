#include "apps/slam/orientations.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/slam/orientation_collector.h"
#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

using ::testing::ElementsAre;

constexpr int kNumFrames = 12;

const SimulatedSequence& Walk() {
  static const SimulatedSequence walk = RenderWalk(kNumFrames);
  return walk;
}

// Counts what it is told, and stops after so many frames.
class CountingObserver : public SlamObserver {
 public:
  explicit CountingObserver(int max_frames = 1000) : max_frames_(max_frames) {}

  void OnBegin(SlamStage stage, int num_frames_expected) override {
    EXPECT_EQ(stage, SlamStage::kOrientations);
    num_steps = num_frames_expected;
  }
  void OnFrame(const FrameProgress& progress) override {
    EXPECT_TRUE(progress.odometry.cam_from_world.contains(progress.frame.id));
    EXPECT_TRUE(progress.frame.image.empty());
    ++num_frames;
  }
  void OnEnd(SlamStage /*stage*/, const Orientations& /*orientations*/) override { ++num_ends; }
  bool ShouldStop() override { return num_frames >= max_frames_; }

  int num_steps = 0;
  int num_frames = 0;
  int num_ends = 0;

 private:
  int max_frames_;
};

Orientations Find(const SimulatedSequence& sequence,
                  SlamObserver& observer,
                  const OrientationInputs& inputs = {}) {
  ImageSource frames(sequence);
  return FindOrientations(frames, sequence.camera, SlamOptions(), inputs, observer);
}

Orientations Find(const SimulatedSequence& sequence, const OrientationInputs& inputs = {}) {
  SlamObserver nobody;
  return Find(sequence, nobody, inputs);
}

double LargestErrorDeg(const RotationMap& cam_from_world, const Trajectory& truth) {
  double largest = 0.0;
  for (const auto& [frame, rotation] : cam_from_world) {
    const Rotation found = rotation * cam_from_world.begin()->second.Inverse();
    const Rotation turn = truth[frame.value].world_from_cam.Inverse() * truth[0].world_from_cam;
    largest = std::max(largest, (found * turn.Inverse()).AngleDeg());
  }
  return largest;
}

TEST(FindOrientations, FindsThatOfEveryFrame) {
  CountingObserver observer;
  const Orientations orientations = Find(Walk(), observer);
  EXPECT_EQ(orientations.cam_from_world.size(), kNumFrames);
  EXPECT_LT(LargestErrorDeg(orientations.cam_from_world, Walk().truth), 0.2);
  EXPECT_EQ(orientations.timestamps_s.size(), kNumFrames);
  EXPECT_EQ(orientations.image_names[3], "3");
  EXPECT_EQ(orientations.reports.size(), kNumFrames);
  EXPECT_EQ(orientations.features.size(), kNumFrames);
  EXPECT_TRUE(orientations.unconnected.empty());
  EXPECT_GE(orientations.inlier_edges.at(FrameId{5}), 2);
  EXPECT_TRUE(orientations.IsUsable());
  EXPECT_FALSE(orientations.interrupted);
  EXPECT_EQ(observer.num_steps, kNumFrames);
  EXPECT_EQ(observer.num_frames, kNumFrames);
  EXPECT_EQ(observer.num_ends, 1);
}

TEST(FindOrientations, InterpolatesWhatCannotBeMatched) {
  SimulatedSequence sequence = Walk();
  sequence.images[6] = cv::Mat();
  sequence.truth[6].timestamp_s += 0.01;  // not in the middle
  const Orientations orientations = Find(sequence);
  EXPECT_EQ(orientations.num_unreadable, 1);
  EXPECT_THAT(orientations.unconnected, ElementsAre(FrameId{6}));
  const RotationMap& found = orientations.cam_from_world;
  const double from_s = sequence.truth[5].timestamp_s;
  const double share =
      (sequence.truth[6].timestamp_s - from_s) / (sequence.truth[7].timestamp_s - from_s);
  EXPECT_GT(share, 0.6);
  const Rotation expected = Interpolate(found.at(FrameId{5}), found.at(FrameId{7}), share);
  EXPECT_LT((found.at(FrameId{6}) * expected.Inverse()).AngleDeg(), 1e-9);
}

TEST(FindOrientations, StopsWhenTheObserverAsks) {
  CountingObserver after_five(5);
  const Orientations five = Find(Walk(), after_five);
  EXPECT_TRUE(five.interrupted);
  EXPECT_TRUE(five.IsUsable());
  EXPECT_EQ(five.timestamps_s.size(), 5U);
  EXPECT_EQ(five.cam_from_world.size(), 5U);
  CountingObserver after_one(1);
  const Orientations one = Find(Walk(), after_one);
  EXPECT_TRUE(one.interrupted);
  EXPECT_FALSE(one.IsUsable()) << "and yet no error";
}

TEST(FindOrientations, GivenOnesCount) {
  OrientationInputs inputs;
  inputs.given.emplace().name = "gimbal.txt";
  for (const StampedPose& pose : Walk().truth) {
    inputs.given->rotations.push_back({pose.timestamp_s, pose.world_from_cam, std::nullopt});
  }
  const Orientations orientations = Find(Walk(), inputs);
  ASSERT_TRUE(orientations.given.has_value());
  for (int k = 0; k < kNumFrames; ++k) EXPECT_TRUE(orientations.given->CountsFor(FrameId{k})) << k;
  // They are exact, and the images are not.
  EXPECT_LT(LargestErrorDeg(orientations.cam_from_world, Walk().truth),
            LargestErrorDeg(Find(Walk()).cam_from_world, Walk().truth));
}

TEST(FindOrientations, RefusesTooFewFramesAndNothingToMatch) {
  SimulatedSequence two = Walk();
  two.images.resize(2);
  EXPECT_THROW(Find(two), std::runtime_error);
  SimulatedSequence blank = Walk();
  for (cv::Mat& image : blank.images) image = cv::Mat(image.size(), CV_8U, cv::Scalar(90));
  EXPECT_THROW(Find(blank), std::runtime_error);
}

// Frames 0.1 s apart, the last one later, whose orientations are known but for some.
TEST(InterpolateUnknown, TakesTheNearestKnownFrames) {
  Orientations orientations;
  orientations.timestamps_s = {0.0, 0.1, 0.2, 0.3, 0.7, 0.8};
  RotationMap rotations;
  for (int k = 0; k < 6; ++k) {
    rotations[FrameId{k}] = Rotation::Exp({0.0, orientations.timestamps_s[k], 0.0});
  }
  const RotationMap truth = rotations;
  const std::set<FrameId> unknown = {FrameId{0}, FrameId{2}, FrameId{3}, FrameId{5}};
  for (const FrameId frame : unknown) rotations[frame] = Rotation::Exp({1.0, 1.0, 1.0});
  RotationMap given = rotations;
  InterpolateUnknown(orientations, unknown, rotations);
  const auto error_deg = [&](int frame, int expected) {
    return (rotations.at(FrameId{frame}) * truth.at(FrameId{expected}).Inverse()).AngleDeg();
  };
  EXPECT_LT(error_deg(0, 1), 1e-9);
  EXPECT_LT(error_deg(2, 2), 1e-9);
  EXPECT_LT(error_deg(3, 3), 1e-9);
  EXPECT_LT(error_deg(5, 4), 1e-9);
  const Rotation before = given.at(FrameId{2});
  orientations.cam_from_world = given;
  orientations.given.emplace().fusion.source.assign(given.size(), OrientationSource::kSensor);
  InterpolateUnknown(orientations, unknown, given);
  EXPECT_LT((given.at(FrameId{2}) * before.Inverse()).AngleDeg(), 1e-9) << "these are not ours";
}

TEST(OrientationSigmas, IsTheMeanOverTheAxes) {
  Orientations orientations;
  orientations.covariance[FrameId{4}] = Eigen::Vector3d(1e-4, 4e-4, 7e-4).asDiagonal();
  const auto sigmas = OrientationSigmas(orientations);
  ASSERT_EQ(sigmas.size(), 1U);
  EXPECT_NEAR(sigmas.at(FrameId{4}), 0.02, 1e-12);
}

TEST(RotationScaleOf, IsTheMedianOfAcceptedLoopsRightRound) {
  EXPECT_EQ(RotationScaleOf({}).factor, 1.0);
  std::vector<LoopCheck> loops(6);
  const double factors[] = {1.02, 1.04, 1.01, 9.0, 1.0, 1.03};
  for (std::size_t k = 0; k < loops.size(); ++k) {
    loops[k].accepted = k != 3;
    loops[k].scaled.turn_scale = factors[k];  // 1: the loop does not go right round
  }
  loops.pop_back();
  const RotationScale scale = RotationScaleOf(loops);
  EXPECT_EQ(scale.num_loops, 3);
  EXPECT_EQ(scale.factor, 1.02);
}

}  // namespace
}  // namespace rotslam
