#include "apps/slam/live/live_slam.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

constexpr int kNumFrames = 40;

const SimulatedSequence& Walk() {
  static const SimulatedSequence walk = RenderWalk(kNumFrames);
  return walk;
}

SlamOptions OptionsWith(int num_threads) {
  SlamOptions options;
  options.num_threads = num_threads;
  return options;
}

// All frames of the sequence, one after the other.
std::vector<LiveEstimate> AddAll(const SimulatedSequence& sequence, LiveSlam& slam) {
  std::vector<LiveEstimate> estimates;
  for (std::size_t k = 0; k < sequence.images.size(); ++k) {
    estimates.push_back(slam.AddFrame(sequence.truth[k].timestamp_s, sequence.images[k]));
  }
  return estimates;
}

std::vector<std::string> LinesOf(const std::vector<LiveEstimate>& estimates) {
  std::vector<std::string> lines;
  for (const LiveEstimate& estimate : estimates) {
    std::ostringstream line;
    line.precision(17);
    line << estimate.cam_from_world.Quaternion().coeffs().transpose() << ' '
         << estimate.center_in_world.value_or(Eigen::Vector3d::Zero()).transpose() << ' '
         << ToString(estimate.state) << ' ' << estimate.map_revision;
    lines.push_back(line.str());
  }
  return lines;
}

// Root mean square distance of the emitted positions from the truth, as a share of the way, after
// the scale and the place of the first one are taken out: both worlds have the same axes.
double PositionError(const std::vector<LiveEstimate>& estimates, const Trajectory& truth) {
  const Rotation world_from_first = truth.front().world_from_cam;
  std::vector<Eigen::Vector3d> found;
  std::vector<Eigen::Vector3d> expected;
  for (const LiveEstimate& estimate : estimates) {
    if (!estimate.center_in_world) continue;
    found.push_back(*estimate.center_in_world);
    expected.push_back(world_from_first.Inverse() * truth[estimate.frame.value].center_in_world);
  }
  Eigen::Vector3d mean_found = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_expected = Eigen::Vector3d::Zero();
  const auto count = static_cast<double>(found.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    mean_found += found[k] / count;
    mean_expected += expected[k] / count;
  }
  double product = 0.0;
  double squares = 0.0;
  double extent = 0.0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    product += (found[k] - mean_found).dot(expected[k] - mean_expected);
    squares += (found[k] - mean_found).squaredNorm();
    extent += (expected[k] - mean_expected).squaredNorm();
  }
  double errors = 0.0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    errors +=
        (product / squares * (found[k] - mean_found) - (expected[k] - mean_expected)).squaredNorm();
  }
  return std::sqrt(errors / extent);
}

TEST(LiveSlam, GivesPosesAtOnceAndAMap) {
  LiveSlam slam(Walk().camera, OptionsWith(2));
  EXPECT_EQ(slam.Map(), nullptr);
  const std::vector<LiveEstimate> estimates = AddAll(Walk(), slam);
  EXPECT_EQ(estimates.front().state, LiveState::kStarting);
  EXPECT_FALSE(estimates.front().center_in_world);
  const LiveEstimate& newest = estimates.back();
  EXPECT_EQ(newest.state, LiveState::kTracking);
  ASSERT_TRUE(newest.center_in_world);
  EXPECT_GT(newest.num_points, 100);
  const auto map = slam.Map();
  ASSERT_NE(map, nullptr);
  EXPECT_EQ(map->revision, newest.map_revision);
  EXPECT_GE(map->keyframes.size(), 3U);
  EXPECT_GT(map->points.size(), 300U);
  for (const LivePoint& point : map->points) {
    EXPECT_EQ(map->FindPoint(point.track), &point);
  }
  EXPECT_LT(PositionError(estimates, Walk().truth), 0.03);
  for (std::size_t k = 1; k < estimates.size(); ++k) {
    const Rotation turn = estimates[k].cam_from_world * estimates[k - 1].cam_from_world.Inverse();
    const Rotation expected =
        Walk().truth[k].world_from_cam.Inverse() * Walk().truth[k - 1].world_from_cam;
    EXPECT_LT((turn * expected.Inverse()).AngleDeg(), 0.1) << k;
  }
}

TEST(LiveSlam, DoesNotDependOnThreadsAndSpeed) {
  LiveSlam slam(Walk().camera, OptionsWith(1));
  const std::vector<std::string> expected = LinesOf(AddAll(Walk(), slam));
  LiveSlam slow(Walk().camera, OptionsWith(3));
  std::vector<LiveEstimate> estimates;
  for (std::size_t k = 0; k < Walk().images.size(); ++k) {
    // The map is there long before it is due, or just in time.
    if (k % 8 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(60));
    estimates.push_back(slow.AddFrame(Walk().truth[k].timestamp_s, Walk().images[k]));
  }
  EXPECT_EQ(LinesOf(estimates), expected);
}

TEST(LiveSlam, FinishesWithTheResultOfTheWholeSystem) {
  LiveSlam slam(Walk().camera, OptionsWith(2));
  AddAll(Walk(), slam);
  ImageSource frames(Walk());
  SlamObserver nobody;
  const SlamResult live = slam.Finish(&frames, nobody);
  ImageSource again(Walk());
  const SlamResult expected = RunSlam(again, Walk().camera, OptionsWith(2));
  ASSERT_EQ(live.map.failure, "");
  ASSERT_EQ(live.map.center_in_world.size(), expected.map.center_in_world.size());
  for (const auto& [frame, center] : expected.map.center_in_world) {
    EXPECT_EQ(live.map.center_in_world.at(frame), center) << frame.value;
    EXPECT_EQ(live.map.cam_from_world.at(frame).Quaternion().coeffs(),
              expected.map.cam_from_world.at(frame).Quaternion().coeffs());
  }
  EXPECT_EQ(live.map.cloud.point_in_world, expected.map.cloud.point_in_world);
}

TEST(LiveSlam, GoesOnWithoutAnImage) {
  LiveSlam slam(Walk().camera, OptionsWith(2));
  for (int k = 0; k < 12; ++k) {
    const bool is_broken = k == 6;
    const LiveEstimate estimate =
        slam.AddFrame(Walk().truth[k].timestamp_s, is_broken ? cv::Mat() : Walk().images[k]);
    EXPECT_EQ(estimate.frame, FrameId{k});
  }
  EXPECT_THROW(slam.AddFrame(Walk().truth[12].timestamp_s, cv::Mat(10, 10, CV_8UC1)),
               std::invalid_argument);
}

// In a turn in place to an entirely new view there is an orientation for every frame, and the
// position is held.
TEST(LiveSlam, HoldsThePositionWhileTheCameraTurns) {
  SimulationOptions options;
  options.kind = SimulationKind::kGimbal;
  options.camera = CameraWithView(320, 240, 65.0);
  options.camera.knows_readout = true;
  const SimulatedSequence gimbal = RenderSequence(options, /*num_threads=*/2);
  LiveSlam slam(gimbal.camera, OptionsWith(2));
  const std::vector<LiveEstimate> estimates = AddAll(gimbal, slam);
  int num_held = 0;
  std::optional<Eigen::Vector3d> held;
  for (const LiveEstimate& estimate : estimates) {
    const Rotation found = estimate.cam_from_world * estimates.front().cam_from_world.Inverse();
    const Rotation expected = gimbal.truth[estimate.frame.value].world_from_cam.Inverse() *
                              gimbal.truth.front().world_from_cam;
    EXPECT_LT((found * expected.Inverse()).AngleDeg(), 1.0) << estimate.frame.value;
    if (estimate.state != LiveState::kRotating) continue;
    ++num_held;
    if (!held) held = estimate.center_in_world;
    EXPECT_EQ(estimate.center_in_world, held);
  }
  EXPECT_GT(num_held, 30);  // of 48
  // Frames behind the turn had no position until the map went on there; afterwards they have one.
  const std::vector<LivePathPose> path = slam.Path();
  ASSERT_EQ(path.size(), estimates.size());
  int num_late = 0;
  for (std::size_t k = 70; k < path.size(); ++k) {
    if (!estimates[k].center_in_world) num_late += path[k].center_in_world ? 1 : 0;
  }
  const auto num_without =
      std::count_if(estimates.begin() + 70, estimates.end(), [](const LiveEstimate& estimate) {
        return estimate.state == LiveState::kStarting;
      });
  EXPECT_GT(num_without, 0);
  EXPECT_GE(num_late, num_without / 2);
  // The map goes on behind it, in a component of its own.
  EXPECT_EQ(estimates.back().state, LiveState::kTracking);
  EXPECT_EQ(slam.Map()->keyframes.back().component, 1);
}

}  // namespace
}  // namespace rotslam
