// A drive round a block: where the loop closes, the map that grows is moved.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "apps/simulation/simulation.h"
#include "apps/slam/live/live_slam.h"

namespace rotslam {
namespace {

constexpr int kNumFrames = 140;
constexpr double kStep = 0.7;    // m
constexpr double kSide = 22.0;   // of the block, m
constexpr double kRadius = 7.0;  // of its corners

double CurvatureAt(double way) {
  const double straight = kSide - 2.0 * kRadius;
  const double quarter = straight + 0.5 * std::numbers::pi * kRadius;
  return std::fmod(way, quarter) < straight ? 0.0 : 1.0 / kRadius;
}

// A little more than once round, as KITTI writes poses.
std::string WritePoses() {
  constexpr int kSubsteps = 50;
  const std::string file =
      (std::filesystem::path(testing::TempDir()) / "live_loop_poses.txt").string();
  std::ofstream out(file);
  double x = 0.0;
  double z = 0.0;
  double yaw = 0.0;
  for (int k = 0; k < kNumFrames * kSubsteps; ++k) {
    if (k % kSubsteps == 0) {
      out << std::cos(yaw) << " 0 " << std::sin(yaw) << ' ' << x << " 0 1 0 0 " << -std::sin(yaw)
          << " 0 " << std::cos(yaw) << ' ' << z << '\n';
    }
    const double step = kStep / kSubsteps;
    yaw += step * CurvatureAt(k * step);
    x += step * std::sin(yaw);
    z += step * std::cos(yaw);
  }
  return file;
}

const SimulatedSequence& Block() {
  static const SimulatedSequence block = [] {
    SimulationOptions options;
    options.kind = SimulationKind::kStreet;
    options.poses = WritePoses();
    options.camera = CameraWithView(240, 180, 80.0);
    options.camera.knows_readout = true;
    return RenderSequence(options, /*num_threads=*/2);
  }();
  return block;
}

struct Drive {
  std::vector<LiveEstimate> estimates;
  std::shared_ptr<const LiveMap> map;
};

Drive Through(const SimulatedSequence& sequence, int num_threads, bool correct_map) {
  SlamOptions options;
  options.num_threads = num_threads;
  LiveOptions live;
  live.correct_map = correct_map;
  LiveSlam slam(sequence.camera, options, live);
  Drive drive;
  for (std::size_t k = 0; k < sequence.images.size(); ++k) {
    drive.estimates.push_back(slam.AddFrame(sequence.truth[k].timestamp_s, sequence.images[k]));
  }
  drive.map = slam.Map();
  return drive;
}

// Mean distance from the truth of the last positions that were emitted, m, where the first half of
// the way is aligned with it.
double FinalError(const Drive& drive, const Trajectory& truth) {
  constexpr int kNumLast = 12;
  const auto count = static_cast<int>(drive.estimates.size());
  Eigen::Matrix3Xd found(3, 0);
  Eigen::Matrix3Xd expected(3, 0);
  for (int k = 0; k < count / 2; ++k) {
    if (!drive.estimates[k].center_in_world) continue;
    found.conservativeResize(3, found.cols() + 1);
    expected.conservativeResize(3, expected.cols() + 1);
    found.rightCols<1>() = *drive.estimates[k].center_in_world;
    expected.rightCols<1>() = truth[k].center_in_world;
  }
  const Eigen::Matrix4d truth_from_map = Eigen::umeyama(found, expected);
  double sum = 0.0;
  for (int k = count - kNumLast; k < count; ++k) {
    const Eigen::Vector3d position = drive.estimates[k].center_in_world.value();
    const Eigen::Vector3d aligned = (truth_from_map * position.homogeneous()).head<3>();
    sum += (aligned - truth[k].center_in_world).norm();
  }
  return sum / kNumLast;
}

std::string BytesOf(const Drive& drive) {
  std::ostringstream bytes;
  bytes.precision(17);
  for (const LiveEstimate& estimate : drive.estimates) {
    bytes << estimate.cam_from_world.Quaternion().coeffs().transpose() << ' '
          << estimate.center_in_world.value_or(Eigen::Vector3d::Zero()).transpose() << ' '
          << estimate.map_revision << '\n';
  }
  return bytes.str();
}

TEST(LiveLoop, MovesTheMap) {
  const Drive drive = Through(Block(), 2, true);
  const Drive kept = Through(Block(), 2, false);
  EXPECT_GE(drive.map->num_corrections, 1);
  EXPECT_EQ(kept.map->num_corrections, 0);
  EXPECT_LT(FinalError(drive, Block().truth), 0.6 * FinalError(kept, Block().truth));
  // The same bytes with one thread.
  EXPECT_TRUE(BytesOf(Through(Block(), 1, true)) == BytesOf(drive));
}

}  // namespace
}  // namespace rotslam
