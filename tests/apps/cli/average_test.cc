// `rotslam average` on the files that people bring.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/graph/g2o.h"
#include "output/graph/rotation_list.h"
#include "output/graph/rotation_list_file.h"
#include "tests/apps/command_line.h"
#include "tests/scenes/wrong_edges.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class AverageTest : public testing::Test {
 protected:
  fs::path Path(const std::string& name) const { return folder_.path() / name; }
  fs::path Write(const std::string& name, const std::string& text) const {
    std::ofstream(Path(name)) << text;
    return Path(name);
  }
  static CommandResult Average(const fs::path& graph,
                               const fs::path& out,
                               const std::vector<std::string>& more = {}) {
    return Rotslam({"average", graph.string(), "--out", out.string()}, more);
  }
  // The number behind a word at the beginning of a line; NaN without one.
  static double Number(const CommandResult& result, const std::string& name) {
    for (const std::string& line : Lines(result.output)) {
      if (line.rfind(name, 0) == 0) return std::stod(line.substr(name.size()));
    }
    return std::nan("");
  }

 private:
  const TemporaryFolder folder_;
};

std::string Words(const std::vector<double>& values) {
  std::string text;
  char word[40];
  for (const double value : values) {
    std::snprintf(word, sizeof(word), " %.17g", value);
    text += word;
  }
  return text;
}

std::vector<double> Coefficients(const Rotation& rotation) {
  const auto& q = rotation.Quaternion();
  return {q.x(), q.y(), q.z(), q.w()};
}

void ExpectTruth(const RotationList& list, const WrongEdges& scene) {
  ASSERT_EQ(list.cam_from_world.size(), scene.true_cam_from_world.size());
  const OrientationErrors errors =
      CompareOrientations(list.cam_from_world, scene.true_cam_from_world);
  EXPECT_LT(errors.max_deg, 2.0);
}

TEST_F(AverageTest, ListsOfQuaternionsAndMatricesAreTheSame) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 60, .wrong_ratio = 0.1});
  std::string quaternions = "# i j qx qy qz qw\n";
  std::string matrices;
  for (const RelativeRotation& edge : scene.edges) {
    const std::string ids = std::to_string(edge.i.value) + " " + std::to_string(edge.j.value);
    const Eigen::Matrix3d R = edge.j_from_i.Matrix();
    std::vector<double> numbers;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) numbers.push_back(R(r, c));
    }
    quaternions += ids + Words(Coefficients(edge.j_from_i)) + "\n";
    matrices += ids + Words(numbers) + " 0.1 0.2 0.3\n";
  }
  const std::vector<std::string> sigma = {"--sigma", "0.5", "--quiet"};
  for (const auto& [name, text] : {std::pair{"q.txt", quaternions}, {"R.txt", matrices}}) {
    const CommandResult result =
        Average(Write(name, text), Path(std::string(name) + ".out"), sigma);
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_EQ(result.output, "");
  }
  ASSERT_EQ(Average(Path("q.txt"), Path("q.g2o"), sigma).exit_code, 0);
  const RotationList list = ReadRotationList(Path("q.g2o"), 1.0);
  ExpectTruth(list, scene);

  // The text's lines are the same orientations.
  const std::vector<std::string> from_matrices = Lines(ReadWholeFile(Path("R.txt.out")));
  ASSERT_EQ(from_matrices.size(), 61u);
  for (const std::string& line : from_matrices) {
    if (line[0] == '#') continue;
    int id = 0;
    double x = 0.0, y = 0.0, z = 0.0, w = 0.0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%d %lf %lf %lf %lf", &id, &x, &y, &z, &w), 5);
    const Rotation rotation(Eigen::Quaterniond(w, x, y, z));
    EXPECT_LT((rotation * list.cam_from_world.at(FrameId{id}).Inverse()).AngleDeg(), 1e-4);
  }
}

TEST_F(AverageTest, KeepsIdsPositionsAndFixedVertices) {
  const std::string text =
      "VERTEX_SE3:QUAT 6989586621679009792 1 2 3 0 0 0 1\n"
      "VERTEX_SE3:QUAT 7 4 5 6 0 0 1 0\n"
      "VERTEX_SE3:QUAT 8 7 8 9 0 0 0 1\n"
      "FIX 7\n"
      "SOMETHING else\n"
      "EDGE_SE3:QUAT 7 6989586621679009792 0 0 0 0 0 0 1"
      "  1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4\n";
  const CommandResult result = Average(Write("in.g2o", text), Path("out.g2o"));
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const RotationList list = ReadRotationList(Path("out.g2o"), 1.0);
  EXPECT_THAT(list.ids, ElementsAre("7", "8", "6989586621679009792"));
  EXPECT_THAT(list.fixed, ElementsAre(FrameId{0}));
  EXPECT_EQ(list.center_in_world.at(FrameId{2}), Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(list.cam_from_world.at(FrameId{0}).AngleDeg(), 180.0, 1e-6);
  EXPECT_NEAR(list.cam_from_world.at(FrameId{2}).AngleDeg(), 180.0, 1e-6);
  EXPECT_NEAR(list.cam_from_world.at(FrameId{1}).AngleDeg(), 0.0, 1e-6);
  EXPECT_LT((list.edges[0].covariance - Eigen::Matrix3d::Identity()).norm(), 1e-9);
}

TEST_F(AverageTest, RollPitchYaw) {
  const std::string text =
      "EDGE3 0 1 0 0 0 0.1 0.2 0.3 10 0 0 0 0 0 10 0 0 0 0 10 0 0 0 100 0 0 100 0 25\n"
      "EDGE3 1 2 0 0 0 0 0 0.5\n";
  const RotationList list = ReadRotationList(Write("toro.txt", text), 0.1);
  const Eigen::Matrix3d R = list.edges[0].j_from_i.Inverse().Matrix();
  EXPECT_NEAR(std::atan2(R(2, 1), R(2, 2)), 0.1, 1e-12);
  EXPECT_NEAR(-std::asin(R(2, 0)), 0.2, 1e-12);
  EXPECT_NEAR(std::atan2(R(1, 0), R(0, 0)), 0.3, 1e-12);
  EXPECT_NEAR(list.edges[0].covariance(2, 2), 0.04, 1e-12);
  EXPECT_NEAR(list.edges[1].covariance(2, 2), 0.01, 1e-12);
}

TEST_F(AverageTest, RefusesBadFilesInOneLine) {
  const auto refusal = [&](const std::string& text) {
    const CommandResult result = Average(Write("bad.txt", text), Path("out.g2o"));
    EXPECT_EQ(result.exit_code, 1) << text;
    EXPECT_EQ(Lines(result.error).size(), 1u) << result.error;
    EXPECT_FALSE(fs::exists(Path("out.g2o")));
    return result.error;
  };
  EXPECT_THAT(refusal(""), HasSubstr("has no edges"));
  EXPECT_THAT(refusal("0 1 0 0 0 1\n1 2 0 0\n"), HasSubstr("bad.txt:2: expected i j and"));
  EXPECT_THAT(refusal("0 1 0 0 x 1\n"), AllOf(HasSubstr("bad.txt:1"), HasSubstr("\"x\"")));
  EXPECT_THAT(refusal("0 1 0 0 0 2\n"), HasSubstr("unit length"));
  EXPECT_THAT(refusal("0 1 1 0 0 0 1 0 0 0 -1\n"), HasSubstr("no rotation matrix"));
  EXPECT_THAT(refusal("4 4 0 0 0 1\n"), HasSubstr("itself"));
  EXPECT_THAT(refusal("EDGE3 0 1 0 0 0 0 0 1\nFIX 5\n"), HasSubstr("FIX names 5"));
  EXPECT_THAT(refusal("EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 1 0 0\n"), HasSubstr("ends too early"));
  EXPECT_THAT(refusal("EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1"
                      " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 -4 0 0 4 0 4\n"),
              HasSubstr("not positive definite"));
  const CommandResult missing = Average(Path("nowhere.g2o"), Path("out.g2o"));
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.error, HasSubstr("nowhere.g2o"));
  const CommandResult no_folder =
      Average(Write("good.txt", "0 1 0 0 0 1\n"), Path("none") / "out.g2o");
  EXPECT_EQ(no_folder.exit_code, 1);
  EXPECT_EQ(Lines(no_folder.error).size(), 1u);
}

// Their minima are certified, so nothing can cost less; from the true orientations the same cost is
// reached.
TEST_F(AverageTest, PoseGraphsReachTheCertifiedMinimum) {
  const fs::path data = fs::path(ROTSLAM_SHARED_DIR) / "data/pose_graphs";
  if (!fs::exists(data)) GTEST_SKIP() << data << " is not here";
  const CommandResult sphere = Average(data / "sphere2500.g2o", Path("sphere.g2o"), {"--certify"});
  ASSERT_EQ(sphere.exit_code, 0) << sphere.error;
  EXPECT_LT(Number(sphere, "  gap"), 1e-7);
  EXPECT_EQ(Number(sphere, "inliers"), 100.0);

  // True orientations as vertices of the measured graph.
  ASSERT_EQ(Average(data / "sphere2500_groundtruth.txt", Path("true.g2o"), {"--quiet"}).exit_code,
            0);
  std::string text;
  for (const std::string& line : Lines(ReadWholeFile(Path("true.g2o")))) {
    if (line.rfind("VERTEX", 0) == 0) text += line + "\n";
  }
  for (const std::string& line : Lines(ReadWholeFile(data / "sphere2500.g2o"))) {
    if (line.rfind("EDGE", 0) == 0) text += line + "\n";
  }
  const CommandResult from_truth =
      Average(Write("from_truth.g2o", text), Path("out.g2o"), {"--start"});
  ASSERT_EQ(from_truth.exit_code, 0) << from_truth.error;
  EXPECT_LE(Number(sphere, "cost"), Number(from_truth, "cost") * (1.0 + 1e-6));

  // Its residuals are so small that rounding leaves a wider gap.
  const CommandResult garage =
      Average(data / "parking-garage.g2o", Path("garage.g2o"), {"--certify"});
  ASSERT_EQ(garage.exit_code, 0) << garage.error;
  EXPECT_LT(Number(garage, "  gap"), 1e-3);
}

// The same graph as a pose graph, of 1DSfM and of GLOMAP.
TEST_F(AverageTest, FormsThatPeopleBringGiveTheTruth) {
  const fs::path cases = fs::path(ROTSLAM_SHARED_DIR) / "cases/inputs/graph";
  if (!fs::exists(cases)) GTEST_SKIP() << cases << " is not here";
  std::vector<Rotation> truth;
  for (const std::string& line : Lines(ReadWholeFile(cases / "truth_cw.txt"))) {
    int id = 0;
    double x = 0.0, y = 0.0, z = 0.0, w = 0.0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%d %lf %lf %lf %lf", &id, &x, &y, &z, &w), 5);
    truth.emplace_back(Eigen::Quaterniond(w, x, y, z));
  }
  const std::vector<std::pair<const char*, const char*>> files = {
      {"ok.g2o", "g2o"},
      {"decimalcomma.g2o", "note: its commas are taken for decimal points"},
      {"EGs.txt", "note: taken as x_i = R x_j of cameras with y up, as 1DSfM has it: cycles"},
      {"relpose.txt", "note: taken as x_2 = R x_1, qw first: cycles"}};
  for (const auto& [name, note] : files) {
    SCOPED_TRACE(name);
    const CommandResult result = Average(cases / name, Path("out.g2o"));
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.output, HasSubstr(note));
    const RotationList list = ReadRotationList(Path("out.g2o"), 1.0);
    ASSERT_EQ(list.cam_from_world.size(), truth.size());
    // Between each two views, so that no choice of the world enters.
    double largest_deg = 0.0;
    for (const auto& [i, i_from_world] : list.cam_from_world) {
      for (const auto& [j, j_from_world] : list.cam_from_world) {
        const Rotation found = j_from_world * i_from_world.Inverse();
        const Rotation expected = truth[j.value] * truth[i.value].Inverse();
        largest_deg = std::max(largest_deg, (found.Inverse() * expected).AngleDeg());
      }
    }
    EXPECT_LT(largest_deg, 1.5);
    EXPECT_GT(Number(result, "inliers"), 85.0);
  }
}

TEST_F(AverageTest, NegativeIdsAreIds) {
  const CommandResult result = Average(
      Write("negative.txt", "-2 -1 0 0 0.1736482 0.9848078\n-1 0 0 0 0.1736482 0.9848078\n"),
      Path("out.txt"));
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(Number(result, "views"), 3.0);
  EXPECT_THAT(ReadWholeFile(Path("out.txt")), HasSubstr("\n-2 "));
}

}  // namespace
}  // namespace rotslam
