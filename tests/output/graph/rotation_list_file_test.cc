#include "output/graph/rotation_list_file.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kSigmaRad = 0.01;

class RotationListTest : public testing::Test {
 protected:
  RotationList Read(const std::string& content) const {
    return ReadRotationList(folder_.Write("graph", content), kSigmaRad);
  }

  const TemporaryFolder folder_;
};

double Angle(const Rotation& a, const Rotation& b) { return (a.Inverse() * b).Angle(); }

TEST_F(RotationListTest, PlainLinesTurnIIntoJ) {
  const double h = std::sqrt(0.5);
  const RotationList list =
      Read("# i j qx qy qz qw\n\n18446744073709551615 7 0 0 " + std::to_string(h) + " +" +
           std::to_string(h) + "\r\n7,9, 0 -1 0  1 0 0  0 0 1  12 13\nNOTE 1 2\n");
  EXPECT_FALSE(list.is_pose_graph);
  EXPECT_EQ(list.form, "list of rotations");
  EXPECT_THAT(list.notes,
              ElementsAre(HasSubstr("behind the rotation are not used (1 line)"),
                          HasSubstr("taken as x_j = R x_i; there is no cycle")));
  EXPECT_EQ(list.unread, "1 line of \"NOTE\" (5)");
  EXPECT_THAT(list.ids, ElementsAre("7", "9", "18446744073709551615"));
  ASSERT_EQ(list.edges.size(), 2u);
  const Rotation quarter = Rotation::Exp({0.0, 0.0, M_PI / 2});
  for (const RelativeRotation& edge : list.edges) {
    EXPECT_LT(Angle(edge.j_from_i, quarter), 1e-6);
    EXPECT_EQ(edge.covariance, kSigmaRad * kSigmaRad * Eigen::Matrix3d::Identity());
  }
  EXPECT_EQ(list.edges[0].i, FrameId{2});
  EXPECT_EQ(list.edges[0].j, FrameId{0});
  EXPECT_EQ(list.edges[1].i, FrameId{0});
  EXPECT_EQ(list.edges[1].j, FrameId{1});
}

TEST_F(RotationListTest, ToroAnglesAreRollPitchYawOfTheCamera) {
  const std::string sixteen = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0";
  const RotationList list = Read(
      "VERTEX3 0 1 2 3 0.1 0.2 0.3\nVERTEX3 1 0 0 0 0 0 0\n"
      "EDGE3 0 1 0 0 0 0.1 0.2 0.3\nEDGE3 0 1 0 0 0 0.1 0.2 0.3" +
      sixteen + " 4 0 0 16 0 25\n");
  EXPECT_TRUE(list.is_pose_graph);
  const Rotation world_from_cam = Rotation::Exp({0.0, 0.0, 0.3}) * Rotation::Exp({0.0, 0.2, 0.0}) *
                                  Rotation::Exp({0.1, 0.0, 0.0});
  EXPECT_LT(Angle(list.cam_from_world.at(FrameId{0}), world_from_cam.Inverse()), 1e-12);
  EXPECT_EQ(list.center_in_world.at(FrameId{0}), Eigen::Vector3d(1, 2, 3));
  ASSERT_EQ(list.edges.size(), 2u);
  EXPECT_LT(Angle(list.edges[0].j_from_i, world_from_cam.Inverse()), 1e-12);
  EXPECT_EQ(list.edges[0].covariance, kSigmaRad * kSigmaRad * Eigen::Matrix3d::Identity());
  const Eigen::Vector3d variances(0.25, 1.0 / 16.0, 0.04);
  EXPECT_LT((list.edges[1].covariance - Eigen::Matrix3d(variances.asDiagonal())).norm(), 1e-12);
}

TEST_F(RotationListTest, PoseGraphComesBackWithItsIdsAndDirections) {
  RotationList written;
  written.ids = {"3", "1000000000000", "1000000000007"};
  written.is_pose_graph = true;
  RotationMap cam_from_world;
  for (int view = 0; view < 3; ++view) {
    cam_from_world[FrameId{view}] = Rotation::Exp({0.3 * view, 0.2, -0.1 * view});
    if (view < 2) written.center_in_world[FrameId{view}] = Eigen::Vector3d(view, 2.0 * view, -1.0);
  }
  written.fixed = {FrameId{1}};
  RelativeRotation edge;
  edge.i = FrameId{2};
  edge.j = FrameId{0};
  edge.j_from_i = Rotation::Exp({0.3, 0.01, -0.1});
  edge.covariance = 1e-4 * Eigen::Vector3d(1.0, 2.0, 3.0).asDiagonal();
  edge.covariance(0, 1) = edge.covariance(1, 0) = 3e-5;
  written.edges = {edge};
  const auto file = folder_.path() / "graph.g2o";
  WriteRotationList(file, written, {cam_from_world, written.center_in_world, {}});
  const RotationList read = ReadRotationList(file, kSigmaRad);
  EXPECT_TRUE(read.is_pose_graph);
  EXPECT_EQ(read.ids, written.ids);
  EXPECT_THAT(read.fixed, ElementsAre(FrameId{1}));
  for (const auto& [view, rotation] : cam_from_world) {
    EXPECT_LT(Angle(read.cam_from_world.at(view), rotation), 1e-11);
  }
  EXPECT_EQ(read.center_in_world.at(FrameId{1}), Eigen::Vector3d(1.0, 2.0, -1.0));
  EXPECT_EQ(read.center_in_world.at(FrameId{2}), Eigen::Vector3d(0.0, 0.0, 0.0));
  ASSERT_EQ(read.edges.size(), 1u);
  EXPECT_EQ(read.edges[0].i, edge.i);
  EXPECT_EQ(read.edges[0].j, edge.j);
  EXPECT_LT(Angle(read.edges[0].j_from_i, edge.j_from_i), 1e-11);
  EXPECT_LT((read.edges[0].covariance - edge.covariance).norm(), 1e-10 * edge.covariance.norm());
}

TEST_F(RotationListTest, OtherNamesGetALinePerView) {
  RotationList list;
  list.ids = {"5", "8"};
  const RotationMap cam_from_world = {{FrameId{0}, Rotation()},
                                      {FrameId{1}, Rotation::Exp({M_PI, 0.0, 0.0})}};
  const auto file = folder_.path() / "rotations.txt";
  WriteRotationList(file, list, {cam_from_world, {}, {}});
  const std::string text = ReadWholeFile(file);
  EXPECT_THAT(text, HasSubstr("# id qx qy qz qw of cam_from_world\n5 0 0 0 1\n8 1 0 0 "));
}

TEST_F(RotationListTest, RefusesInOneLineWithItsNumber) {
  const std::string edge = "0 1 0 0 0 1\n";
  const std::string toro = "EDGE3 0 1 0 0 0 0 0 0\n";
  const std::string pose = "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 ";
  const std::map<std::string, std::string> reasons = {
      {"# nothing\n", "has no edges"},
      {edge + "0 1 0 0 0\n", ":2: expected i j and a quaternion or the nine numbers"},
      {edge + "0 1 0 0 0 1 0\n", ":2: expected a standard deviation in deg above zero"},
      {edge + "0 1 0 0 0 1 -2\n", ":2: expected a standard deviation in deg above zero"},
      {"EDGE_SE2 0 1 0 0 0 1 0 0 1 0 1\n", "is a 2-D graph (1 edges of a pose in the plane)"},
      {"VERTEX2 0 0 0 0\nEDGE2 0 1 0 0 0 1 0 1 1 0 0\n", "is a 2-D graph"},
      {edge + "0 1 0 0 0 2\n", ":2: the quaternion is not of unit length"},
      {edge + "0 1 -1 0 0 0 1 0 0 0 1\n", ":2: the nine numbers are no rotation matrix"},
      {edge + "0 1 1 0 0 0 1 0 0 0 2\n", ":2: the nine numbers are no rotation matrix"},
      {edge + "3 3 0 0 0 1\n", ":2: an edge from a view to itself"},
      {edge + "0 1 0 0 nan 1\n", ":2: expected a finite number, found \"nan\""},
      {edge + "0 1.5 0 0 0 1\n", ":2: expected a view's id, a whole number or a name"},
      {edge + "0 nan 0 0 0 1\n", ":2: expected a view's id"},
      {toro + "EDGE3 0 1 0 0\n", ":2: the line ends too early"},
      {toro + "VERTEX3 0 0 0 0 0 0 1e400\n", ":2: expected a finite number"},
      {toro + "VERTEX3 0 0 0 0 1e200 1e200 1e200\n", ":2: an angle is out of range"},
      {toro + pose + "-1 0 0 1 0 1\n", ":2: the information of the rotation is not positive"},
      {toro + "FIX 1\n", "FIX names 1, which has no vertex"},
      {toro + "FIX 9\n", "FIX names 9, which has no vertex"}};
  for (const auto& [content, reason] : reasons) {
    EXPECT_THAT(RuntimeErrorOf([&] { Read(content); }), HasSubstr(reason)) << content;
  }
}

// Rotations of a ring of cameras, between near ones and across.
std::map<int, Rotation> RingOfCameras() {
  std::map<int, Rotation> cam_from_world;
  for (int k = -2; k < 8; ++k) {
    cam_from_world[k] = Rotation::Exp({0.4 * k, 0.3 * std::sin(k), 0.2 * k * k});
  }
  return cam_from_world;
}

using EdgeText = std::string (*)(int i, int j, const Rotation& j_from_i);

std::string RingText(EdgeText edge_text) {
  std::string text;
  const std::map<int, Rotation> cameras = RingOfCameras();
  for (const auto& [i, i_from_world] : cameras) {
    for (const auto& [j, j_from_world] : cameras) {
      if (j > i && j < i + 4) text += edge_text(i, j, j_from_world * i_from_world.Inverse());
    }
  }
  return text;
}

std::string Numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += ' ' + std::to_string(value);
  return text;
}

std::vector<double> RowsOf(const Rotation& rotation) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> R = rotation.Matrix();
  return {R.data(), R.data() + 9};
}

void ExpectRing(const RotationList& list) {
  const std::map<int, Rotation> cameras = RingOfCameras();
  ASSERT_EQ(list.ids.size(), cameras.size());
  std::vector<Rotation> in_order;
  for (const auto& [k, rotation] : cameras) in_order.push_back(rotation);
  for (const RelativeRotation& edge : list.edges) {
    const Rotation expected = in_order[edge.j.value] * in_order[edge.i.value].Inverse();
    EXPECT_LT(Angle(edge.j_from_i, expected), 1e-5);
  }
}

TEST_F(RotationListTest, CyclesTellTheDirectionAndTheOrder) {
  const std::map<std::string, EdgeText> texts = {
      {"x_j = R x_i: cycles",
       [](int i, int j, const Rotation& R) {
         const auto& q = R.Quaternion();
         return std::to_string(i) + ' ' + std::to_string(j) +
                Numbers({q.x(), q.y(), q.z(), q.w()}) + '\n';
       }},
      {"x_i = R x_j: cycles",
       [](int i, int j, const Rotation& R) {
         return std::to_string(i) + ' ' + std::to_string(j) + Numbers(RowsOf(R.Inverse())) + '\n';
       }},
      {"x_j = R x_i with qw first:",
       [](int i, int j, const Rotation& R) {
         const auto& q = R.Quaternion();
         return std::to_string(i) + ' ' + std::to_string(j) +
                Numbers({q.w(), q.x(), q.y(), q.z()}) + '\n';
       }},
      {"x_i = R x_j with qw first:", [](int i, int j, const Rotation& R) {
         const Eigen::Quaterniond q = R.Inverse().Quaternion();
         return std::to_string(i) + ' ' + std::to_string(j) +
                Numbers({q.w(), q.x(), q.y(), q.z()}) + '\n';
       }}};
  for (const auto& [reading, edge_text] : texts) {
    const RotationList list = Read(RingText(edge_text));
    EXPECT_EQ(list.ids.front(), "-2");
    ExpectRing(list);
    EXPECT_THAT(list.notes, ElementsAre(HasSubstr("taken as " + reading))) << reading;
  }
}

TEST_F(RotationListTest, OneDSfmIsReadInItsDirectionAndTheOther) {
  // Their cameras have y up and look along -z.
  const RotationList theirs = Read(RingText([](int i, int j, const Rotation& R) {
    const Rotation y_up = Rotation::Exp({M_PI, 0.0, 0.0});
    return std::to_string(i) + ' ' + std::to_string(j) +
           Numbers(RowsOf(y_up * R.Inverse() * y_up.Inverse())) + " 0.1 0.2 0.3\n";
  }));
  EXPECT_EQ(theirs.form, "1DSfM");
  ExpectRing(theirs);
  EXPECT_THAT(theirs.notes, ElementsAre(HasSubstr("taken as x_i = R x_j of cameras with y up")));
  const RotationList other = Read(RingText([](int i, int j, const Rotation& R) {
    return std::to_string(i) + ' ' + std::to_string(j) + Numbers(RowsOf(R)) + " 0.1 0.2 0.3\n";
  }));
  ExpectRing(other);
  // Two views have no cycle: the documentation of the form decides.
  const RotationList pair = Read("0 1 0 -1 0  1 0 0  0 0 1  1 0 0\n");
  EXPECT_LT(Angle(pair.edges[0].j_from_i, Rotation::Exp({0.0, 0.0, M_PI / 2})), 1e-9);
}

TEST_F(RotationListTest, GlomapsNamesAreIds) {
  const RotationList list = Read(RingText([](int i, int j, const Rotation& R) {
    const auto& q = R.Quaternion();
    const auto name = [](int k) { return "frame_" + std::to_string(100 + k) + ".jpg"; };
    return name(i) + ' ' + name(j) + Numbers({q.w(), q.x(), q.y(), q.z(), 1.0, 2.0, 3.0}) + '\n';
  }));
  EXPECT_EQ(list.form, "GLOMAP relative poses");
  EXPECT_EQ(list.ids[0], "frame_100.jpg");
  EXPECT_EQ(list.edges.size(), 24u);
  const auto file = folder_.path() / "named.g2o";
  RotationMap cam_from_world;
  for (int k = 0; k < 10; ++k) cam_from_world[FrameId{k}] = Rotation();
  WriteRotationList(file, list, {cam_from_world, {}, {}});
  EXPECT_THAT(ReadWholeFile(file), HasSubstr("# 0 is frame_100.jpg\n"));
}

TEST_F(RotationListTest, DecimalCommasAndOtherTags) {
  const RotationList list = Read(
      "VERTEX_SE2 0 0,5 0 0\nEDGE_SE3:QUAT 0 1 0,0 0,0 0,0 0,0 0,0 0,6 0,8"
      " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4,0 0 0 4 0 4\n");
  EXPECT_NEAR(list.edges[0].j_from_i.Angle(), 2.0 * std::atan2(0.6, 0.8), 1e-12);
  EXPECT_THAT(list.notes, ElementsAre(HasSubstr("commas are taken for decimal points")));
  EXPECT_EQ(list.unread, "1 line of \"VERTEX_SE2\" (1)");
  EXPECT_THAT(RuntimeErrorOf([&] { Read("EDGE_POINT 0 1 0 0 0 1 0 0 1 0 1\n"); }),
              HasSubstr("found 1 line of \"EDGE_POINT\" (1)"));
}

TEST_F(RotationListTest, NamesAndWholeNumbersOfAnySizeAreIds) {
  const RotationList list = Read(
      "+007 -18446744073709551617 0 0 0 1\n-0 left.png 0 0 0 1\nleft.png 7 0 0 0 1 2.5\n"
      "left 1 2 3\nEDGE_SE3:QUAT 0 7 0 0 0 0 0 0 1\n");
  EXPECT_THAT(list.ids, ElementsAre("-18446744073709551617", "0", "7", "left.png"));
  ASSERT_EQ(list.edges.size(), 3u);
  EXPECT_EQ(list.edges[0].i, FrameId{2});
  EXPECT_EQ(list.edges[0].j, FrameId{0});
  EXPECT_EQ(list.edges[2].i, FrameId{3});
  EXPECT_EQ(list.unread, "1 line of \"EDGE_SE3:QUAT\" (5), 1 line of \"left\" (4)");
  const RotationList graph = Read(
      "EDGE_SE3:QUAT cam_b cam_a 0 0 0 0 0 0 1"
      " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4\nEDGE_SE3_PRIOR 0 0 0 0 0 0 0 0 1\n"
      "EDGE_SE2 1 2 0 0 0\nEDGE_SE2 2 3 0 0 0\nEDGE_SE2 2 3 0 0 0\nEDGE_SE2 2 3 0 0 0\n");
  EXPECT_THAT(graph.ids, ElementsAre("cam_a", "cam_b"));
  EXPECT_EQ(graph.unread,
            "4 lines of \"EDGE_SE2\" (3, 4, 5 ...), 1 line of \"EDGE_SE3_PRIOR\" (2)");
}

TEST_F(RotationListTest, EulerAnglesAreThoseOfToro) {
  const std::string numbers = " 1 2 3 0.1 0.2 0.3 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 4 0 0 16 0 25\n";
  const RotationList toro = Read("EDGE3 0 1" + numbers);
  const RotationList euler =
      Read("VERTEX_SE3:EULER 0 1 2 3 0.1 0.2 0.3\nEDGE_SE3:EULER 0 1" + numbers);
  EXPECT_EQ(euler.form, "g2o");
  EXPECT_EQ(euler.unread, "");
  EXPECT_LT(Angle(euler.cam_from_world.at(FrameId{0}), toro.edges[0].j_from_i), 1e-12);
  EXPECT_LT(Angle(euler.edges[0].j_from_i, toro.edges[0].j_from_i), 1e-12);
  EXPECT_EQ(euler.edges[0].covariance, toro.edges[0].covariance);
  ASSERT_EQ(euler.translations.size(), 1u);
  EXPECT_EQ(euler.translations[0].j_in_i, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(euler.translations[0].information(0, 0), 9.0);
  EXPECT_EQ(euler.translations[0].information(5, 5), 100.0);  // g2o's is of half the angle
}

TEST_F(RotationListTest, AnEdgeMayHaveADeviationOfItsOwn) {
  const RotationList list = Read("0 1 0 0 0 1 2.5\n1 2 0 0 0 1\n");
  const double sigma_rad = 2.5 * kRadFromDeg;
  EXPECT_NEAR(list.edges[0].covariance(1, 1), sigma_rad * sigma_rad, 1e-12);
  EXPECT_NEAR(list.edges[1].covariance(1, 1), kSigmaRad * kSigmaRad, 1e-12);
  EXPECT_THAT(list.notes, testing::Contains(HasSubstr("standard deviation in deg (1 line)")));
}

TEST_F(RotationListTest, StartsComeFromListsAndPoseGraphs) {
  const RotationList list = Read("a 2 0 0 0 1\n");
  const auto lines =
      folder_.Write("start.txt", "# id q\n2 0 0 0 1 0.1 0.1 0.1\na 1 0 0 0\n5 0 0 0 1\n");
  const RotationMap start = ReadStartOrientations(lines, list);
  ASSERT_EQ(start.size(), 2u);
  EXPECT_NEAR(start.at(FrameId{1}).AngleDeg(), 180.0, 1e-9);
  const auto graph = folder_.Write(
      "start.g2o", "VERTEX_SE3:QUAT 2 0 0 0 0 0 0 1\nVERTEX_SE3:EULER a 0 0 0 0.5 0 0\n");
  EXPECT_LT(Angle(ReadStartOrientations(graph, list).at(FrameId{1}), Rotation::Exp({-0.5, 0, 0})),
            1e-12);
  const auto other = folder_.Write("other.txt", "2 0 0 0 1\n");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadStartOrientations(other, list); }),
              HasSubstr("has no orientation of view a"));
}

}  // namespace
}  // namespace rotslam
