#include "rotodom/view_graph/connect.h"

#include <gtest/gtest.h>

#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

// Four views of a far wall, each turned a little further.
class ConnectViewTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    FeatureOptions options;
    options.max_features = 600;
    const TexturedWorld world;
    for (int k = 0; k < 4; ++k) {
      const Rotation cam_from_world =
          Rotation::Exp(k * kRadFromDeg * Eigen::Vector3d(0.8, -1.5, 0.5));
      truth_[FrameId{k}] = cam_from_world;
      const cv::Mat image = world.View(SmallCamera(), cam_from_world);
      views_.push_back({ExtractFeatures(image, FrameId{k}, SmallCamera(), options, 1),
                        BuildPatchPyramid(image, {})});
    }
  }
  static void TearDownTestSuite() { views_.clear(); }

  static std::vector<const View*> Others() { return {&views_[2], &views_[1], &views_[0]}; }
  static std::vector<Connection> Connect(const ConnectOptions& options) {
    return ConnectView(views_[3], Others(), truth_, SmallCamera(), options);
  }

  inline static std::vector<View> views_;
  inline static RotationMap truth_;
};

void ExpectSame(const Connection& a, const Connection& b) {
  EXPECT_EQ(a.edge.i, b.edge.i);
  EXPECT_EQ(a.edge.j, b.edge.j);
  EXPECT_EQ(a.edge.j_from_i.Quaternion().coeffs(), b.edge.j_from_i.Quaternion().coeffs());
  EXPECT_EQ(a.edge.covariance, b.edge.covariance);
  EXPECT_EQ(a.matches.pairs, b.matches.pairs);
  EXPECT_EQ(a.keypoint_j_px, b.keypoint_j_px);
}

TEST_F(ConnectViewTest, MeasuresPureRotation) {
  const std::vector<Connection> connections = Connect({});
  ASSERT_EQ(connections.size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    const RelativeRotation& edge = connections[k].edge;
    EXPECT_EQ(edge.i, Others()[k]->features.frame);  // in the order of the others
    EXPECT_EQ(edge.j, FrameId{3});
    const Rotation truth = truth_.at(edge.j) * truth_.at(edge.i).Inverse();
    // A tenth of a pixel is 0.02 deg, and hundreds of matches share the error.
    EXPECT_LT((edge.j_from_i * truth.Inverse()).AngleDeg(), 0.02);
    EXPECT_TRUE(edge.rotation_only);
    EXPECT_LT(edge.parallax_px, 0.5);
    EXPECT_EQ(connections[k].range, SearchRange::kGuided);
  }
}

TEST_F(ConnectViewTest, BringsTheMatchesThatAgree) {
  for (const Connection& connection : Connect({})) {
    EXPECT_EQ(connection.matches.frame_i, connection.edge.i);
    EXPECT_EQ(connection.matches.frame_j, connection.edge.j);
    EXPECT_EQ(static_cast<int>(connection.matches.pairs.size()), connection.edge.num_inliers);
    EXPECT_EQ(connection.keypoint_j_px.size(), connection.matches.pairs.size());
    EXPECT_GT(connection.edge.num_inliers, 150);
    const View& view_i = views_[connection.edge.i.value];
    for (std::size_t k = 0; k < connection.matches.pairs.size(); ++k) {
      const auto predicted = SmallCamera().Project(
          connection.edge.j_from_i * view_i.features.bearings[connection.matches.pairs[k][0]]);
      ASSERT_TRUE(predicted);
      EXPECT_LT((*predicted - connection.keypoint_j_px[k]).norm(), 2.0);
    }
  }
}

TEST_F(ConnectViewTest, SameBytesAtAnyThreadCount) {
  const std::vector<Connection> one = Connect({});
  ConnectOptions options;
  options.num_threads = 3;
  const std::vector<Connection> three = Connect(options);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t k = 0; k < one.size(); ++k) ExpectSame(one[k], three[k]);
}

TEST_F(ConnectViewTest, AnEdgeDoesNotDependOnItsNeighbours) {
  const std::vector<Connection> all = Connect({});
  const std::vector<Connection> alone =
      ConnectView(views_[3], {&views_[1]}, truth_, SmallCamera(), {});
  ASSERT_EQ(alone.size(), 1u);
  ExpectSame(alone[0], all[1]);
}

TEST_F(ConnectViewTest, ABadPredictionCostsNoAccuracy) {
  RotationMap predicted = truth_;
  predicted[FrameId{3}] = Rotation::Exp({0.0, 0.25, 0.0}) * predicted[FrameId{3}];  // 62 px off
  for (const Connection& connection :
       ConnectView(views_[3], Others(), predicted, SmallCamera(), {})) {
    EXPECT_EQ(connection.range, SearchRange::kWide);
    const Rotation truth = truth_.at(FrameId{3}) * truth_.at(connection.edge.i).Inverse();
    EXPECT_LT((connection.edge.j_from_i * truth.Inverse()).AngleDeg(), 0.03);
  }
}

TEST_F(ConnectViewTest, SaysNothingAboutViewsThatShareNothing) {
  EXPECT_TRUE(ConnectView(views_[3], {}, truth_, SmallCamera(), {}).empty());
  View blank;
  blank.features.frame = FrameId{0};
  blank.pyramid = BuildPatchPyramid(cv::Mat::zeros(240, 320, CV_8U), {});
  const auto connections = ConnectView(views_[3], {&blank, &views_[1]}, truth_, SmallCamera(), {});
  ASSERT_EQ(connections.size(), 1u);
  EXPECT_EQ(connections[0].edge.i, FrameId{1});

  FeatureOptions options;
  const cv::Mat elsewhere = TexturedWorld(99).View(SmallCamera(), Rotation());
  const View stranger{ExtractFeatures(elsewhere, FrameId{0}, SmallCamera(), options, 1),
                      BuildPatchPyramid(elsewhere, {})};
  for (const Connection& connection :
       ConnectView(views_[3], {&stranger}, truth_, SmallCamera(), {})) {
    EXPECT_LE(connection.edge.num_inliers, ViewGraphOptions{}.min_edge_inliers);
  }
}

TEST(ViewGraphOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(ViewGraphOptions{}.Problem());
  ViewGraphOptions options;
  options.min_edge_inliers = -1;
  EXPECT_EQ(options.Problem(), "min_edge_inliers is -1, must be zero or more");
  options.window_frames = 0;
  EXPECT_EQ(options.Problem(), "window_frames is 0, must be at least 1");
}

}  // namespace
}  // namespace rotslam
