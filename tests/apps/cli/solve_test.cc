// `rotslam solve` on the kinds of input that it reads.

#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/export/known_rotation_file.h"
#include "output/trajectory/trajectory.h"
#include "tests/apps/command_line.h"
#include "tests/output/known_rotation_inputs.h"
#include "tests/scenes/alignment.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

Scene Street() {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 12;
  options.num_points = 500;
  options.noise_px = 0.3;
  return MakeScene(options);
}

nlohmann::json Summary(const fs::path& folder) {
  return nlohmann::json::parse(ReadWholeFile(folder / "summary.json"));
}

// @param shift  of the views' numbers against the scene's.
double ErrorOf(const fs::path& folder, const Scene& scene, int shift) {
  CenterMap centers;
  for (const StampedPose& pose : ReadTrajectory(folder / "keyframes_tum.txt")) {
    centers[FrameId{static_cast<int>(pose.timestamp_s) - shift}] = pose.center_in_world;
  }
  EXPECT_EQ(centers.size(), scene.cam_from_world.size());
  return CompareCenters(
             centers, scene.true_center_in_world, AlignCenters(centers, scene.true_center_in_world))
      .max;
}

class SolveTest : public testing::Test {
 protected:
  fs::path Path(const std::string& name) const { return folder_.path() / name; }

 private:
  const TemporaryFolder folder_;
};

TEST_F(SolveTest, FindsTheSameStreetFromEveryKindOfInput) {
  const Scene scene = Street();
  KnownRotationInput input;
  input.camera = scene.camera;
  input.cam_from_world = scene.cam_from_world;
  input.tracks = scene.tracks;
  WriteKnownRotation(Path("ours.txt"), input);
  WriteColmapText(Path("text"), scene);
  WriteColmapBinary(Path("binary"), scene);
  WriteBal(Path("bal.txt"), scene);
  const auto solve = [&](const std::string& name, int shift) {
    const fs::path out = Path("out_" + name);
    const CommandResult result = Rotslam({"solve", Path(name).string(), "--out", out.string()});
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.error, HasSubstr("largest residual in ["));
    EXPECT_LT(ErrorOf(out, scene, shift), 0.05) << name;
    EXPECT_THAT(FileNames(out),
                ElementsAre("cloud.ply", "keyframes_tum.txt", "removed.csv", "summary.json"));
    const nlohmann::json krot = Summary(out)["krot"];
    EXPECT_EQ(krot["status"], "converged");
    EXPECT_GT(krot["gamma_low_px"], 0.0);
    EXPECT_LE(krot["gamma_high_px"].get<double>(), 1.011 * krot["gamma_low_px"].get<double>());
  };
  solve("ours.txt", 0);
  solve("text", 1);
  solve("binary", 1);
  solve("bal.txt", 0);
  EXPECT_EQ(ReadWholeFile(Path("out_text") / "keyframes_tum.txt"),
            ReadWholeFile(Path("out_binary") / "keyframes_tum.txt"));
}

TEST_F(SolveTest, AveragesRelativeRotations) {
  const Scene scene = Street();
  KnownRotationInput input;
  input.camera = scene.camera;
  input.tracks = scene.tracks;
  // Orientations that would lead nowhere.
  for (const auto& [view, rotation] : scene.cam_from_world) {
    input.cam_from_world[view] = Rotation::Exp({0.0, 0.7 * view.value, 0.0});
  }
  WriteKnownRotation(Path("ours.txt"), input);
  std::ofstream graph(Path("graph.txt"));
  graph.precision(12);
  for (const auto& [i, cam_i] : scene.cam_from_world) {
    for (const auto& [j, cam_j] : scene.cam_from_world) {
      if (j <= i || j.value > i.value + 3) continue;
      const Eigen::Vector4d q = (cam_j * cam_i.Inverse()).Quaternion().coeffs();
      graph << i.value << " " << j.value << " " << q.transpose() << "\n";
    }
  }
  graph << "100 101 0 0 0 1\n";  // of views that are not there
  graph.close();
  const auto solve = [&](const std::string& name) {
    return Rotslam({"solve",
                    Path("ours.txt").string(),
                    "--relative-rotations",
                    Path(name).string(),
                    "--out",
                    Path("out").string()});
  };
  const CommandResult result = solve("graph.txt");
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("12 views have an orientation"));
  // The world is turned: distances of centres tell.
  std::vector<StampedPose> poses = ReadTrajectory(Path("out") / "keyframes_tum.txt");
  ASSERT_EQ(poses.size(), scene.true_center_in_world.size());
  const auto length = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - b).norm();
  };
  const auto& truth = scene.true_center_in_world;
  const double scale = length(poses.back().center_in_world, poses.front().center_in_world) /
                       length(truth.rbegin()->second, truth.begin()->second);
  for (std::size_t k = 1; k < poses.size(); ++k) {
    const int view = static_cast<int>(poses[k].timestamp_s);
    EXPECT_NEAR(length(poses[k].center_in_world, poses[0].center_in_world) / scale,
                length(truth.at(FrameId{view}), truth.begin()->second),
                0.05);
  }
  std::ofstream(Path("far.txt")) << "100 101 0 0 0 1\n";
  const CommandResult far = solve("far.txt");
  EXPECT_EQ(far.exit_code, 1);
  EXPECT_THAT(far.error, HasSubstr("ties no two views"));
}

TEST_F(SolveTest, TakesTheStartThatIsAskedForAndLeavesTheCertificateOut) {
  WriteColmapText(Path("model"), Street());
  for (const char* start : {"l1", "bisection", "positioning"}) {
    const CommandResult result =
        Rotslam({"solve", Path("model").string(), "--out", Path(start).string(), "--krot", start});
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_EQ(Summary(Path(start))["options"]["krot"]["start"], start);
  }
  const CommandResult bare = Rotslam({"solve",
                                      Path("model").string(),
                                      "--out",
                                      Path("bare").string(),
                                      "--no-certificate",
                                      "--quiet"});
  ASSERT_EQ(bare.exit_code, 0) << bare.error;
  EXPECT_EQ(bare.error, "");
  EXPECT_EQ(Summary(Path("bare"))["krot"]["gamma_low_px"], 0.0);
  const CommandResult both = Rotslam({"solve",
                                      Path("model").string(),
                                      "--out",
                                      Path("both").string(),
                                      "--no-certificate",
                                      "--krot",
                                      "bisection"});
  EXPECT_EQ(both.exit_code, 1);
  EXPECT_THAT(Lines(both.error), ElementsAre(HasSubstr("leaves out the bisection")));
}

TEST_F(SolveTest, SaysWhyObservationsAreNotInTheMap) {
  Scene scene = Street();
  Observation& wrong = scene.tracks.front().observations.front();
  wrong.keypoint_px += Eigen::Vector2d(60.0, 40.0);
  const std::string line =
      std::to_string(scene.tracks.front().id.value) + "," + std::to_string(wrong.frame.value) + ",";
  KnownRotationInput input;
  input.camera = scene.camera;
  input.cam_from_world = scene.cam_from_world;
  input.tracks = scene.tracks;
  WriteKnownRotation(Path("ours.txt"), input);
  const CommandResult result =
      Rotslam({"solve", Path("ours.txt").string(), "--out", Path("out").string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const std::vector<std::string> lines = Lines(ReadWholeFile(Path("out") / "removed.csv"));
  EXPECT_EQ(lines.front(), "track,view,reason");
  EXPECT_THAT(lines, Contains(testing::StartsWith(line)));
}

TEST_F(SolveTest, SaysInOneLineWhatIsWrong) {
  const auto complaint = [&](const std::string& input) {
    const CommandResult result =
        Rotslam({"solve", Path(input).string(), "--out", Path("out").string(), "--quiet"});
    EXPECT_EQ(result.exit_code, 1) << input;
    EXPECT_EQ(Lines(result.error).size(), 1U) << result.error;
    return result.error;
  };
  EXPECT_THAT(complaint("missing"), HasSubstr("No such file"));
  std::ofstream(Path("text.txt")) << "hello world\n";
  EXPECT_THAT(complaint("text.txt"), HasSubstr("neither our text"));
  std::ofstream(Path("bal.txt")) << "3 3 4000000\n";
  EXPECT_THAT(complaint("bal.txt"), HasSubstr("says 4000000 observations"));
  SceneOptions pivot;
  pivot.path = ScenePath::kPivot;
  WriteColmapText(Path("pivot"), MakeScene(pivot));
  EXPECT_THAT(complaint("pivot"), HasSubstr("no parallax"));
}

}  // namespace
}  // namespace rotslam
