#include "output/graph/g2o.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

Eigen::Matrix3d SomeCovariance() {
  Eigen::Matrix3d A;
  A << 2.0, 0.3, -0.1, 0.0, 1.0, 0.4, 0.0, 0.0, 0.5;
  return 1e-4 * A * A.transpose();
}

PoseGraph ThreeViews() {
  PoseGraph pose_graph;
  for (int view = 0; view < 3; ++view) {
    pose_graph.cam_from_world[FrameId{view}] = Rotation::Exp({0.3 * view, 0.2, -0.1 * view});
    pose_graph.center_in_world[FrameId{view}] = Eigen::Vector3d(view, 2.0 * view, -1.0);
  }
  for (int i = 0; i < 3; ++i) {
    RelativeRotation edge;
    edge.i = FrameId{i};
    edge.j = FrameId{(i + 1) % 3};
    edge.j_from_i = Rotation::Exp({0.3, 0.01 * i, -0.1});
    edge.covariance = SomeCovariance();
    pose_graph.graph.AddEdge(edge);
  }
  return pose_graph;
}

TEST(G2o, ComesBack) {
  const TemporaryFolder folder;
  const PoseGraph written = ThreeViews();
  WriteG2o(folder.path() / "g.g2o", written);
  const PoseGraph read = ReadG2o(folder.path() / "g.g2o");
  ASSERT_EQ(read.cam_from_world.size(), 3u);
  for (const auto& [view, cam_from_world] : written.cam_from_world) {
    EXPECT_LT((read.cam_from_world.at(view).Inverse() * cam_from_world).Angle(), 1e-11);
    EXPECT_LT((read.center_in_world.at(view) - written.center_in_world.at(view)).norm(), 1e-11);
  }
  ASSERT_EQ(read.graph.edges().size(), 3u);
  for (const RelativeRotation& edge : written.graph.edges()) {
    const RelativeRotation* found = read.graph.FindEdge(edge.i, edge.j);
    ASSERT_NE(found, nullptr);
    EXPECT_LT((found->j_from_i.Inverse() * edge.j_from_i).Angle(), 1e-11);
    EXPECT_LT((found->covariance - edge.covariance).norm(), 1e-10 * edge.covariance.norm());
  }
}

// The information must be that of the error as g2o computes it: vector part of the quaternion of
// Z^-1 X_i^-1 X_j, here sampled for true rotations Exp(delta) * j_from_i.
TEST(G2o, InformationIsThatOfItsOwnError) {
  const TemporaryFolder folder;
  PoseGraph pose_graph = ThreeViews();
  WriteG2o(folder.path() / "g.g2o", pose_graph);
  std::ifstream file(folder.path() / "g.g2o");
  std::string tag;
  while (file >> tag && tag != "EDGE_SE3:QUAT") file.ignore(1000, '\n');
  int i = 0;
  int j = 0;
  double v[28];
  file >> i >> j;
  for (double& value : v) file >> value;
  const Eigen::Quaterniond Z(v[6], v[3], v[4], v[5]);
  Eigen::Matrix3d information;  // rows 4 to 6 of the upper triangle: its last six numbers
  information << v[22], v[23], v[24], v[23], v[25], v[26], v[24], v[26], v[27];

  const RelativeRotation& edge = *pose_graph.graph.FindEdge(FrameId{i}, FrameId{j});
  const Eigen::Matrix3d root = edge.covariance.llt().matrixL();
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const int num_samples = 40000;
  for (int k = 0; k < num_samples; ++k) {
    const Eigen::Vector3d delta =
        root * Eigen::Vector3d(normal(generator), normal(generator), normal(generator));
    const Rotation true_i_from_j = (Rotation::Exp(delta) * edge.j_from_i).Inverse();
    const Eigen::Vector3d error =
        Rotation(Z.conjugate() * true_i_from_j.Quaternion()).Quaternion().vec();
    covariance += error * error.transpose() / num_samples;
  }
  const Eigen::Matrix3d product = information * covariance;
  EXPECT_LT((product - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 0.05) << product;
}

TEST(G2o, WritesOriginsWithoutCentresAndDropsViewsWithoutOrientation) {
  const TemporaryFolder folder;
  PoseGraph pose_graph = ThreeViews();
  pose_graph.center_in_world.clear();
  pose_graph.cam_from_world.erase(FrameId{2});
  WriteG2o(folder.path() / "g.g2o", pose_graph);
  const std::string text = ReadWholeFile(folder.path() / "g.g2o");
  EXPECT_THAT(text, StartsWith("VERTEX_SE3:QUAT 0 0 0 0 "));
  EXPECT_THAT(text, HasSubstr("\nEDGE_SE3:QUAT 0 1 0 0 0 "));
  EXPECT_EQ(ReadG2o(folder.path() / "g.g2o").graph.edges().size(), 1u);
}

TEST(G2o, NamesTheLineThatIsWrong) {
  const TemporaryFolder folder;
  const auto error_of = [&](const std::string& content) {
    const auto path = folder.Write("g.g2o", content);
    return RuntimeErrorOf([&] { ReadG2o(path); });
  };
  EXPECT_THAT(error_of("FIX 0\nVERTEX_SE3:QUAT 0 0 0 0 0 0 0\n"), HasSubstr("g.g2o:2: "));
  EXPECT_THAT(error_of("VERTEX_SE3:QUAT 0.5 0 0 0 0 0 0 1\n"), HasSubstr("vertex id"));
  EXPECT_THAT(error_of("EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 1 0\n"), HasSubstr("g.g2o:1: "));
  EXPECT_THAT(
      error_of("EDGE_SE3:QUAT 1 1 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"),
      HasSubstr("two different views"));
  EXPECT_THAT(error_of(""), HasSubstr("has neither"));
}

TEST(G2o, RefusesACovarianceThatIsNone) {
  const TemporaryFolder folder;
  PoseGraph pose_graph = ThreeViews();
  RelativeRotation edge = pose_graph.graph.edges()[0];
  edge.covariance.setZero();
  pose_graph.graph.AddEdge(edge);
  EXPECT_THROW(WriteG2o(folder.path() / "g.g2o", pose_graph), std::invalid_argument);
}

TEST(G2o, ReadsAPublicPoseGraph) {
  const std::filesystem::path path =
      std::filesystem::path(ROTSLAM_SHARED_DIR) / "data/pose_graphs/sphere2500.g2o";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
  const PoseGraph pose_graph = ReadG2o(path);
  EXPECT_EQ(pose_graph.cam_from_world.size(), 2500u);
  EXPECT_EQ(pose_graph.graph.edges().size(), 4949u);
}

}  // namespace
}  // namespace rotslam
