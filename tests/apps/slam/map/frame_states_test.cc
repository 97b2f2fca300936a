#include "apps/slam/map/frame_states.h"

#include <cmath>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr int kPathLength = 60;

// A path of 60 frames, each with an edge to the next one, and registration of all of them in one
// component. The keyframes are 0 and 20, and 40 and 59.
struct Path {
  Reconstruction map;
  std::vector<MapComponent> components;
  std::vector<Track> tracks;
  ViewGraph graph;
  std::vector<double> timestamps_s;
  CenterMap centers;
  Registration registration;

  Path() {
    MapComponent all;
    for (int n = 0; n < kPathLength; ++n) {
      const FrameId frame{n};
      timestamps_s.push_back(0.1 * n);
      centers[frame] = {0.1 * n, 0.002 * n * n, 0.0};
      ResectedPose& pose = registration.measured[frame];
      pose.center_in_world = centers[frame];
      pose.covariance.diagonal().tail<3>().setConstant(1e-6);
      if (n > 0) graph.AddEdge({FrameId{n - 1}, frame, Rotation()});
    }
    for (const int n : {0, 20, 40, 59}) {
      map.center_in_world[FrameId{n}] = centers[FrameId{n}];
      all.keyframes.insert(FrameId{n});
    }
    components.push_back(all);
  }

  void LoseFrames(int first, int last) {
    for (int n = first; n <= last; ++n) registration.measured.erase(FrameId{n});
  }

  // No edge leads from frame - 1 to frame.
  void CutBefore(int frame) {
    ViewGraph cut;
    for (const RelativeRotation& edge : graph.edges()) {
      if (edge.j.value != frame) cut.AddEdge(edge);
    }
    graph = cut;
  }

  // Frames from 40 on see points that the earlier ones do not.
  void SplitBefore40() {
    components = {{{FrameId{0}, FrameId{20}}}, {{FrameId{40}, FrameId{59}}, true}};
    for (const int first : {0, 40}) {
      Track track;
      track.id = TrackId{first};
      for (int n = first; n < (first == 0 ? 30 : kPathLength); ++n) {
        track.observations.push_back(
            {FrameId{n}, Eigen::Vector2d::Zero(), Eigen::Vector3d::UnitZ()});
      }
      tracks.push_back(track);
      map.tracks.push_back(track);
      map.point_in_world[track.id] = Eigen::Vector3d::Zero();
    }
  }

  double variance_factor = 1.0;
  std::map<FrameId, double> orientation_sigma;

  std::map<FrameId, FramePose> Find() const {
    return FindFramePoses(
        {map, components, tracks, graph, timestamps_s, centers, variance_factor, orientation_sigma},
        registration);
  }
};

TEST(FindFramePoses, MeasuresWhatIsRegistered) {
  Path path;
  path.registration.measured.at(FrameId{7}).variance_factor = 4.0;
  const auto poses = path.Find();
  ASSERT_EQ(poses.size(), kPathLength);
  for (const auto& [frame, pose] : poses) {
    EXPECT_EQ(pose.state, PoseState::kMeasured);
    EXPECT_EQ(pose.component, 0);
    ASSERT_TRUE(pose.position_sigma.has_value());
    EXPECT_NEAR(pose.position_sigma->x(), frame.value == 7 ? 2e-3 : 1e-3, 1e-12);
  }
}

TEST(FindFramePoses, CountsWhatEdgesShowAndTheDrift) {
  Path path;
  path.variance_factor = 9.0;
  EXPECT_NEAR(path.Find().at(FrameId{30}).position_sigma->y(), 3e-3, 1e-12);
  for (int n = 0; n < kPathLength; ++n) path.orientation_sigma[FrameId{n}] = 1e-3 * n;
  const auto poses = path.Find();
  EXPECT_NEAR(poses.at(FrameId{0}).position_sigma->y(), 3e-3, 1e-12);
  const double drift = 0.03 * (path.centers.at(FrameId{30}) - path.centers.at(FrameId{0})).norm();
  EXPECT_NEAR(
      poses.at(FrameId{30}).position_sigma->y(), std::hypot(3e-3, drift / std::sqrt(3.0)), 1e-12);
  // The drift begins anew with each component.
  path.SplitBefore40();
  EXPECT_NEAR(path.Find().at(FrameId{40}).position_sigma->y(), 3e-3, 1e-12);
}

TEST(FindFramePoses, InterpolatesWithinAComponent) {
  Path path;
  path.LoseFrames(5, 13);
  const auto poses = path.Find();
  for (int n = 5; n <= 13; ++n) {
    EXPECT_EQ(poses.at(FrameId{n}).state, PoseState::kInterpolated);
    EXPECT_EQ(poses.at(FrameId{n}).component, 0);
    EXPECT_GT(poses.at(FrameId{n}).position_sigma->x(), 1e-3);
  }
  // What interpolation misses in the middle, per axis.
  const double middle = poses.at(FrameId{9}).position_sigma->x();
  EXPECT_GT(middle, 1.5 * poses.at(FrameId{5}).position_sigma->x());
  EXPECT_NEAR(middle, 0.002 * 25 / std::sqrt(3.0), 0.005);
}

TEST(FindFramePoses, LeavesWhatLiesBetweenComponentsUnplaced) {
  Path path;
  path.SplitBefore40();
  path.LoseFrames(30, 39);
  const auto poses = path.Find();
  EXPECT_EQ(poses.at(FrameId{29}).component, 0);
  EXPECT_EQ(poses.at(FrameId{45}).component, 1);
  for (int n = 30; n <= 39; ++n) {
    EXPECT_EQ(poses.at(FrameId{n}).state, PoseState::kUnplaced);
    EXPECT_EQ(poses.at(FrameId{n}).component, -1);
    EXPECT_FALSE(poses.at(FrameId{n}).position_sigma.has_value());
  }
}

TEST(FindFramePoses, ExtrapolatesOnlyWhatIsTied) {
  Path path;
  path.map.center_in_world.erase(FrameId{0});
  path.components.front().keyframes.erase(FrameId{0});
  path.LoseFrames(0, 9);
  EXPECT_EQ(path.Find().at(FrameId{3}).state, PoseState::kExtrapolated);
  EXPECT_GT(path.Find().at(FrameId{3}).position_sigma->x(),
            2.0 * path.Find().at(FrameId{7}).position_sigma->x());
  path.CutBefore(6);
  const auto poses = path.Find();
  EXPECT_EQ(poses.at(FrameId{3}).state, PoseState::kUnplaced);
  EXPECT_EQ(poses.at(FrameId{3}).component, -1);
  EXPECT_EQ(poses.at(FrameId{7}).state, PoseState::kExtrapolated);
}

TEST(FindFramePoses, LeavesAPieceWithoutMatchesUnplaced) {
  Path path;
  path.LoseFrames(30, 34);
  path.CutBefore(30);
  path.CutBefore(35);
  EXPECT_EQ(path.Find().at(FrameId{32}).state, PoseState::kUnplaced);
  // A single frame without edges, as of a covered lens, is interpolated like others.
  for (int n = 31; n < 35; ++n) path.CutBefore(n);
  EXPECT_EQ(path.Find().at(FrameId{32}).state, PoseState::kInterpolated);
}

TEST(FindFramePoses, SaysWhatIsHeld) {
  Path path;
  path.LoseFrames(21, 25);
  for (int n = 21; n <= 25; ++n) path.registration.shared_center[FrameId{n}] = FrameId{20};
  path.registration.held_orientations.insert(FrameId{3});
  path.registration.notes[FrameId{3}] = "why";
  const auto poses = path.Find();
  EXPECT_EQ(poses.at(FrameId{23}).state, PoseState::kHeld);
  EXPECT_EQ(*poses.at(FrameId{23}).position_sigma, *poses.at(FrameId{20}).position_sigma);
  EXPECT_EQ(poses.at(FrameId{3}).state, PoseState::kHeld);
  EXPECT_EQ(poses.at(FrameId{3}).note, "why");
}

}  // namespace
}  // namespace rotslam
