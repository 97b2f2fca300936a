#include "rotodom/view_graph/estimate_edges.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "rotodom/features/view.h"
#include "tests/rotodom/features/textured_world.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

constexpr int kNumPoints = 600;
constexpr int kNumViews = 4;

struct World {
  std::vector<Features> views;
  RotationMap cam_from_world;
  std::vector<bool> is_wrong;  // per point: view 3 has it somewhere else
};

// Points far away, or 3 to 9 away from cameras 0.1 apart; each view is turned a little further.
World MakeWorld(bool far_away, double noise_px = 0.05, double share_wrong = 0.0) {
  const Camera camera = SmallCamera();
  SceneRandom random(11);
  World world;
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < kNumPoints; ++n) {
    const double depth = far_away ? 1e9 : random.Uniform(3.0, 9.0);
    points.push_back(depth *
                     Eigen::Vector3d(random.Uniform(-0.7, 0.7), random.Uniform(-0.5, 0.5), 1.0));
    world.is_wrong.push_back(random.Uniform(0.0, 1.0) < share_wrong);
  }
  for (int k = 0; k < kNumViews; ++k) {
    const Rotation cam_from_world =
        Rotation::Exp(k * kRadFromDeg * Eigen::Vector3d(0.8, -1.5, 0.5));
    const Eigen::Vector3d center_in_world(0.1 * k, 0.02 * k, 0.03 * k);
    world.cam_from_world[FrameId{k}] = cam_from_world;
    Features features;
    features.frame = FrameId{k};
    for (int n = 0; n < kNumPoints; ++n) {
      const auto true_px = camera.Project(cam_from_world * (points[n] - center_in_world));
      const Eigen::Vector2d noise(random.Normal(noise_px), random.Normal(noise_px));
      const Eigen::Vector2d elsewhere(random.Uniform(0.0, 319.0), random.Uniform(0.0, 239.0));
      if (!true_px) continue;
      const Eigen::Vector2d px = k == 3 && world.is_wrong[n] ? elsewhere : *true_px + noise;
      if (px.x() < 0.0 || px.y() < 0.0 || px.x() > 319.0 || px.y() > 239.0) continue;
      features.keypoints_px.push_back(px);
      features.bearings.push_back(*camera.Unproject(px));
      features.tracks.push_back(TrackId{n});
    }
    world.views.push_back(std::move(features));
  }
  return world;
}

std::vector<const Features*> Others(const World& world) {
  return {&world.views[2], &world.views[1], &world.views[0]};
}

std::vector<EdgeWithMatches> Connect(const World& world, const EdgeOptions& options = {}) {
  return EstimateEdges(world.views[3], Others(world), world.cam_from_world, kWorldFocalPx, options);
}

Rotation TrueRotation(const World& world, const RelativeRotation& edge) {
  return world.cam_from_world.at(edge.j) * world.cam_from_world.at(edge.i).Inverse();
}

void ExpectSame(const EdgeWithMatches& a, const EdgeWithMatches& b) {
  EXPECT_EQ(a.edge.i, b.edge.i);
  EXPECT_EQ(a.edge.j, b.edge.j);
  EXPECT_EQ(a.edge.j_from_i.Quaternion().coeffs(), b.edge.j_from_i.Quaternion().coeffs());
  EXPECT_EQ(a.edge.covariance, b.edge.covariance);
  EXPECT_EQ(a.matches.pairs, b.matches.pairs);
  EXPECT_EQ(a.outliers_j, b.outliers_j);
}

TEST(EstimateEdges, MeasuresTheRotation) {
  for (const bool far_away : {true, false}) {
    const World world = MakeWorld(far_away);
    const std::vector<EdgeWithMatches> connections = Connect(world);
    ASSERT_EQ(connections.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) {
      const RelativeRotation& edge = connections[k].edge;
      EXPECT_EQ(edge.i, Others(world)[k]->frame);  // in the order of the others
      EXPECT_EQ(edge.j, FrameId{3});
      // A twentieth of a pixel is 0.011 deg, and hundreds of points share the error; a baseline
      // costs a good part of what they say.
      EXPECT_LT((edge.j_from_i * TrueRotation(world, edge).Inverse()).AngleDeg(),
                far_away ? 0.005 : 0.03);
      EXPECT_EQ(edge.rotation_only, far_away);
      EXPECT_EQ(far_away, edge.parallax_px < 0.3) << edge.parallax_px;
      EXPECT_EQ(connections[k].matches.frame_i, edge.i);
      EXPECT_EQ(connections[k].matches.frame_j, edge.j);
      EXPECT_EQ(static_cast<int>(connections[k].matches.pairs.size()), edge.num_inliers);
    }
  }
}

TEST(EstimateEdges, SharesOutThePointsThatBothShow) {
  const World world = MakeWorld(true, 0.05, 0.3);
  for (const EdgeWithMatches& connection : Connect(world)) {
    const Features& view_i = world.views[connection.edge.i.value];
    const Features& view_j = world.views[3];
    const int num_common =
        static_cast<int>(connection.matches.pairs.size() + connection.outliers_j.size());
    EXPECT_EQ(num_common, CountCommonTracks(view_i, view_j));
    for (const auto& [i, j] : connection.matches.pairs) {
      EXPECT_EQ(view_i.tracks[i], view_j.tracks[j]);
    }
    EXPECT_TRUE(std::is_sorted(connection.outliers_j.begin(), connection.outliers_j.end()));
    int num_wrong_in = 0;
    int num_wrong_out = 0;
    for (const auto& [i, j] : connection.matches.pairs) {
      num_wrong_in += world.is_wrong[view_j.tracks[j].value];
    }
    for (const int j : connection.outliers_j) {
      num_wrong_out += world.is_wrong[view_j.tracks[j].value];
    }
    EXPECT_GT(num_wrong_out, 100);
    EXPECT_LT(num_wrong_in, 0.1 * num_wrong_out);  // a wrong place may lie on the epipolar line
    EXPECT_EQ(num_wrong_out, static_cast<int>(connection.outliers_j.size()));
    EXPECT_LT(
        (connection.edge.j_from_i * TrueRotation(world, connection.edge).Inverse()).AngleDeg(),
        0.006);
  }
}

TEST(EstimateEdges, SameBytesAtAnyThreadCount) {
  const World world = MakeWorld(false, 0.1, 0.2);
  const std::vector<EdgeWithMatches> one = Connect(world);
  for (const int num_threads : {2, 3, 8}) {
    EdgeOptions options;
    options.num_threads = num_threads;
    const std::vector<EdgeWithMatches> many = Connect(world, options);
    ASSERT_EQ(one.size(), many.size());
    for (std::size_t k = 0; k < one.size(); ++k) ExpectSame(one[k], many[k]);
  }
}

TEST(EstimateEdges, AnEdgeDoesNotDependOnItsNeighbours) {
  const World world = MakeWorld(false, 0.1, 0.2);
  const std::vector<EdgeWithMatches> all = Connect(world);
  const std::vector<EdgeWithMatches> alone =
      EstimateEdges(world.views[3], {&world.views[1]}, world.cam_from_world, kWorldFocalPx, {});
  ASSERT_EQ(alone.size(), 1u);
  ExpectSame(alone[0], all[1]);
}

TEST(EstimateEdges, ABadPredictionCostsNoAccuracy) {
  const World world = MakeWorld(true, 0.05, 0.2);
  RotationMap predicted = world.cam_from_world;
  predicted[FrameId{3}] = Rotation::Exp({0.0, 0.25, 0.0}) * predicted[FrameId{3}];
  const auto connections =
      EstimateEdges(world.views[3], Others(world), predicted, kWorldFocalPx, {});
  ASSERT_EQ(connections.size(), 3u);
  for (const EdgeWithMatches& connection : connections) {
    EXPECT_LT(
        (connection.edge.j_from_i * TrueRotation(world, connection.edge).Inverse()).AngleDeg(),
        0.01);
  }
}

TEST(EstimateEdges, SaysNothingAboutViewsThatShareNothing) {
  const World world = MakeWorld(true);
  EXPECT_TRUE(EstimateEdges(world.views[3], {}, world.cam_from_world, kWorldFocalPx, {}).empty());
  Features blank;
  blank.frame = FrameId{0};
  Features stranger = world.views[0];
  for (TrackId& track : stranger.tracks) track.value += kNumPoints;
  Features few = world.views[2];
  few.keypoints_px.resize(10);
  few.bearings.resize(10);
  few.tracks.resize(10);
  const auto connections = EstimateEdges(world.views[3],
                                         {&blank, &world.views[1], &stranger, &few},
                                         world.cam_from_world,
                                         kWorldFocalPx,
                                         {});
  ASSERT_EQ(connections.size(), 1u);
  EXPECT_EQ(connections[0].edge.i, FrameId{1});
}

TEST(CountCommonTracks, CountsWhatBothHave) {
  const auto with = [](const std::vector<int>& tracks) {
    Features features;
    for (const int track : tracks) features.tracks.push_back(TrackId{track});
    return features;
  };
  EXPECT_EQ(CountCommonTracks(with({}), with({})), 0);
  EXPECT_EQ(CountCommonTracks(with({1, 2}), with({})), 0);
  EXPECT_EQ(CountCommonTracks(with({1, 3, 5}), with({2, 4, 6})), 0);
  EXPECT_EQ(CountCommonTracks(with({1, 3, 5, 8}), with({3, 4, 5, 6, 7, 8, 9})), 3);
  EXPECT_EQ(CountCommonTracks(with({3, 4, 5, 6, 7, 8, 9}), with({1, 3, 5, 8})), 3);
  EXPECT_EQ(CountCommonTracks(with({4, 7}), with({4, 7})), 2);
}

TEST(ViewGraphOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(ViewGraphOptions{}.Problem());
  ViewGraphOptions options;
  options.keyframe_overlap = 0.0;
  EXPECT_EQ(options.Problem(), "keyframe_overlap is 0, must be above 0 and at most 1");
  options.max_keyframe_edges = -2;
  EXPECT_EQ(options.Problem(), "max_keyframe_edges is -2, must be zero or more");
  options.min_edge_inliers = -1;
  EXPECT_EQ(options.Problem(), "min_edge_inliers is -1, must be zero or more");
  options.window_frames = 0;
  EXPECT_EQ(options.Problem(), "window_frames is 0, must be at least 1");
}

}  // namespace
}  // namespace rotslam
