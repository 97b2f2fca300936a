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
  // The fixed vertex and the one without an edge stay; the edge says the other is at the first.
  EXPECT_EQ(list.center_in_world.at(FrameId{0}), Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(list.center_in_world.at(FrameId{1}), Eigen::Vector3d(7, 8, 9));
  EXPECT_LT((list.center_in_world.at(FrameId{2}) - Eigen::Vector3d(4, 5, 6)).norm(), 1e-9);
  EXPECT_THAT(result.error, HasSubstr("not read: 1 line of \"SOMETHING\" (5)"));
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
  const CommandResult result =
      Average(Write("negative.txt",
                    "-2 -1 0 0 0.1736482 0.9848078\n-1 +0 0 0 0.1736482 0.9848078\n"
                    "0 left 0 0 0.1736482 0.9848078\nleft -2 0 0 0 1 200\n"),
              Path("out.txt"));
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(Number(result, "views"), 4.0);
  EXPECT_EQ(Number(result, "edges"), 4.0);
  EXPECT_THAT(ReadWholeFile(Path("out.txt")), AllOf(HasSubstr("\n-2 "), HasSubstr("\nleft ")));
}

TEST_F(AverageTest, PlaneGraphsAreRefused) {
  const CommandResult result =
      Average(Write("plane.g2o",
                    "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"),
              Path("out.g2o"));
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(Lines(result.error).size(), 1u) << result.error;
  EXPECT_THAT(result.error, HasSubstr("is a 2-D graph"));
}

// Two views of 200 hang on one edge each, and are far from the truth.
TEST_F(AverageTest, WeakViewsAreNamedAndLeftOut) {
  const fs::path weak = fs::path(ROTSLAM_SHARED_DIR) / "cases/inputs/parts/average_weak_nodes.txt";
  if (!fs::exists(weak)) GTEST_SKIP() << weak << " is not here";
  const CommandResult named = Average(weak,
                                      Path("out.txt"),
                                      {"--edges",
                                       Path("edges.csv").string(),
                                       "--nodes",
                                       Path("nodes.csv").string(),
                                       "--log",
                                       Path("log.txt").string()});
  ASSERT_EQ(named.exit_code, 0) << named.error;
  EXPECT_THAT(named.error, HasSubstr("2 of the 200 views (56, 150) hang on at most one edge"));
  EXPECT_THAT(ReadWholeFile(Path("log.txt")),
              AllOf(HasSubstr("(56, 150)"), HasSubstr("robust, in squared")));
  const std::vector<std::string> edges = Lines(ReadWholeFile(Path("edges.csv")));
  ASSERT_EQ(edges.size(), 801u);
  EXPECT_EQ(edges[0], "i,j,residual_deg,residual_sigmas,weight,inlier,component");
  int num_inliers = 0;
  for (std::size_t k = 1; k < edges.size(); ++k) {
    double deg = 0.0, sigmas = 0.0, weight = 0.0;
    int i = 0, j = 0, inlier = 0, component = -1;
    ASSERT_EQ(std::sscanf(edges[k].c_str(),
                          "%d,%d,%lf,%lf,%lf,%d,%d",
                          &i,
                          &j,
                          &deg,
                          &sigmas,
                          &weight,
                          &inlier,
                          &component),
              7)
        << edges[k];
    EXPECT_EQ(inlier, sigmas <= 6.0 ? 1 : 0);
    EXPECT_NEAR(weight, std::pow(36.0 / (36.0 + sigmas * sigmas), 2), 1e-5);
    EXPECT_EQ(component, 0);
    num_inliers += inlier;
  }
  EXPECT_NEAR(Number(named, "inliers"), num_inliers / 8.0, 0.01);
  const std::vector<std::string> nodes = Lines(ReadWholeFile(Path("nodes.csv")));
  ASSERT_EQ(nodes.size(), 201u);
  EXPECT_THAT(nodes, testing::Contains(testing::StartsWith("150,0,1,")));
  const std::vector<std::string> lines = Lines(ReadWholeFile(Path("out.txt")));
  ASSERT_EQ(lines.size(), 201u);
  // One edge of one degree: more than a degree from the mean; the others less.
  double sigma_deg[3] = {};
  std::sscanf(lines[151].c_str(),
              "150 %*f %*f %*f %*f %lf %lf %lf",
              &sigma_deg[0],
              &sigma_deg[1],
              &sigma_deg[2]);
  EXPECT_GT(sigma_deg[0], 1.0);
  EXPECT_LT(sigma_deg[0], 1.5);

  const CommandResult left_out = Average(weak, Path("out.txt"), {"--min-support", "2"});
  ASSERT_EQ(left_out.exit_code, 0) << left_out.error;
  const std::string text = ReadWholeFile(Path("out.txt"));
  EXPECT_EQ(Lines(text).size(), 199u);
  EXPECT_THAT(text, testing::Not(HasSubstr("\n150 ")));
  EXPECT_THAT(left_out.error, HasSubstr("left out"));
}

// A graph whose orientations are exact and whose vertices lie elsewhere.
TEST_F(AverageTest, PositionsFitTheOrientations) {
  RotationList written;
  RotationMap cam_from_world;
  CenterMap centers;
  for (int k = 0; k < 12; ++k) {
    written.ids.push_back(std::to_string(k));
    cam_from_world[FrameId{k}] = Rotation::Exp({0.3 * k, 0.1 * k * k, -0.2 * k});
    centers[FrameId{k}] = Eigen::Vector3d(std::sin(k), 2.0 * k, std::cos(3.0 * k));
    written.center_in_world[FrameId{k}] = Eigen::Vector3d::Constant(k);
  }
  for (int k = 0; k < 24; ++k) {
    RelativeRotation edge;
    edge.i = FrameId{k % 12};
    edge.j = FrameId{(k % 12 + 1 + k / 12) % 12};
    edge.j_from_i = cam_from_world[edge.j] * cam_from_world[edge.i].Inverse();
    edge.covariance = 1e-4 * Eigen::Matrix3d::Identity();
    written.edges.push_back(edge);
    EdgeTranslation translation;
    translation.j_in_i = cam_from_world[edge.i] * (centers[edge.j] - centers[edge.i]);
    translation.information.diagonal() << 5, 5, 5, 4e4, 4e4, 4e4;
    written.translations.push_back(translation);
  }
  WriteRotationList(Path("in.g2o"), written, {cam_from_world, written.center_in_world, {}});
  for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--certify"}}) {
    const CommandResult result = Average(Path("in.g2o"), Path("out.g2o"), more);
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.output, HasSubstr("are the least squares of the inliers' translations"));
    const RotationList read = ReadRotationList(Path("out.g2o"), 1.0);
    ASSERT_EQ(read.translations.size(), 24u);
    for (std::size_t k = 0; k < read.edges.size(); ++k) {
      const RelativeRotation& edge = read.edges[k];
      const Eigen::Vector3d between =
          read.cam_from_world.at(edge.i) *
          (read.center_in_world.at(edge.j) - read.center_in_world.at(edge.i));
      EXPECT_LT((between - written.translations[k].j_in_i).norm(), 1e-7);
      EXPECT_LT((read.translations[k].information - written.translations[k].information).norm(),
                1e-6);
    }
    EXPECT_EQ(read.center_in_world.at(FrameId{0}), Eigen::Vector3d::Zero());
  }
}

// The written orientations have the certified cost.
TEST_F(AverageTest, WritesWhatItCertifies) {
  const WrongEdges scene = MakeWrongEdges({.num_views = 60, .noise_deg = 2.0, .wrong_ratio = 0.1});
  std::string text;
  for (const RelativeRotation& edge : scene.edges) {
    text += std::to_string(edge.i.value) + " " + std::to_string(edge.j.value) +
            Words(Coefficients(edge.j_from_i)) + " 1.5\n";
  }
  const auto graph = Write("graph.txt", text);
  const auto edges = Path("edges.csv");
  const CommandResult result =
      Average(graph, Path("out.g2o"), {"--certify", "--edges", edges.string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.output, HasSubstr("all positions in"));
  // Of the robust solution, whose inliers the certificate takes.
  ASSERT_EQ(Average(graph, Path("robust.g2o"), {"--edges", edges.string()}).exit_code, 0);
  const std::vector<std::string> lines = Lines(ReadWholeFile(edges));
  const double variance = std::pow(1.5 * kRadFromDeg, 2);
  const auto cost_of = [&](const RotationList& list) {
    double cost = 0.0;
    for (std::size_t k = 0; k < scene.edges.size(); ++k) {
      if (lines[k + 1].find(",1,") == std::string::npos) continue;
      const RelativeRotation& edge = scene.edges[k];
      cost += (list.cam_from_world.at(edge.j).Matrix() -
               edge.j_from_i.Matrix() * list.cam_from_world.at(edge.i).Matrix())
                  .squaredNorm() /
              variance;
    }
    return cost;
  };
  const double certified = Number(result, "chordal cost");
  EXPECT_NEAR(cost_of(ReadRotationList(Path("out.g2o"), 1.0)), certified, 1e-5 * certified);
  EXPECT_GT(cost_of(ReadRotationList(Path("robust.g2o"), 1.0)), certified * (1.0 + 1e-4));
}

TEST_F(AverageTest, StartsFromAFile) {
  const auto list = Write("list.txt", "0 1 0 0 0 1\n1 2 0 0 0 1\n2 0 0 0 0 1\n");
  const CommandResult no_vertices = Average(list, Path("out.txt"), {"--start"});
  EXPECT_EQ(no_vertices.exit_code, 1);
  EXPECT_THAT(no_vertices.error, HasSubstr("--start-from"));
  const auto start = Write("start.txt", "0 1 0 0 0\n1 1 0 0 0\n2 1 0 0 0\n");
  const CommandResult result = Average(list, Path("out.txt"), {"--start-from", start.string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  // The first view keeps the start's orientation.
  EXPECT_THAT(ReadWholeFile(Path("out.txt")), HasSubstr("\n2 1 0 0 "));
  const CommandResult missing =
      Average(list, Path("out.txt"), {"--start-from", Write("short.txt", "0 1 0 0 0\n").string()});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.error, HasSubstr("has no orientation of view 1"));
}

}  // namespace
}  // namespace rotslam
