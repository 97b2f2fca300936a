// `rotslam solve` on the kinds of input that it reads.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/export/colmap_model.h"
#include "output/export/known_rotation_file.h"
#include "output/trajectory/trajectory.h"
#include "tests/apps/command_line.h"
#include "tests/output/known_rotation_inputs.h"
#include "tests/scenes/alignment.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsSupersetOf;

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
                IsSupersetOf({"cloud.ply",
                              "keyframes_tum.txt",
                              "map.bin",
                              "map_all_frames.bin",
                              "poses.csv",
                              "removed.csv",
                              "residuals.csv",
                              "rotations.csv",
                              "segments.csv",
                              "summary.json",
                              "trajectory_tum.txt",
                              "views.csv"}));
    const nlohmann::json krot = Summary(out)["krot"];
    EXPECT_EQ(krot["status"], "converged");
    EXPECT_GT(krot["gamma_low_px"], 0.0);
    EXPECT_LE(krot["gamma_high_px"].get<double>(), 1.011 * krot["gamma_low_px"].get<double>());
    const double high_px = krot["final"]["gamma_high_px"].get<double>();
    EXPECT_LE(krot["final"]["gamma_low_px"].get<double>(), high_px);
    EXPECT_LE(high_px, krot["final"]["largest_residual_px"].get<double>());
    EXPECT_GT(krot["final"]["gamma_low_px"], 0.0);
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

// A line of residuals.csv.
struct Residual {
  std::string track;
  std::string view;
  double largest_px = 0.0;  // over the axes; NaN without a point
  std::string state;
};

std::vector<Residual> ReadResiduals(const fs::path& file) {
  std::vector<Residual> residuals;
  const std::vector<std::string> lines = Lines(ReadWholeFile(file));
  EXPECT_EQ(lines.front(), "track,view,dx_px,dy_px,state");
  for (std::size_t k = 1; k < lines.size(); ++k) {
    std::vector<std::string> fields;
    std::istringstream stream(lines[k]);
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    EXPECT_EQ(fields.size(), 5u) << lines[k];
    const auto number = [](const std::string& text) {
      return text.empty() ? std::nan("") : std::abs(std::stod(text));
    };
    residuals.push_back(
        {fields[0], fields[1], std::max(number(fields[2]), number(fields[3])), fields[4]});
  }
  return residuals;
}

fs::path Case(const std::string& name) {
  return fs::path(ROTSLAM_SHARED_DIR) / "cases/inputs/parts" / name;
}

// What is written without bundle adjustment has the residual that the bracket's upper end says.
TEST_F(SolveTest, WritesTheSolutionOfTheBisection) {
  WriteColmapText(Path("model"), Street());
  const CommandResult result =
      Rotslam({"solve", Path("model").string(), "--out", Path("out").string(), "--no-adjust"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const nlohmann::json summary = Summary(Path("out"));
  EXPECT_EQ(summary["options"]["krot"]["start"], "bisection");
  EXPECT_FALSE(summary.contains("ba"));
  const double high_px = summary["krot"]["gamma_high_px"];
  EXPECT_GE(summary["krot"]["gamma_low_px"], 0.99 * high_px);
  double largest_px = 0.0;
  int num_kept = 0;
  for (const Residual& one : ReadResiduals(Path("out") / "residuals.csv")) {
    if (one.state != "kept") continue;
    largest_px = std::max(largest_px, one.largest_px);
    ++num_kept;
  }
  EXPECT_EQ(num_kept, summary["krot"]["bracket_observations"]);
  EXPECT_NEAR(largest_px, high_px, 1e-6);
  // Rotations come out as they went in.
  const Scene scene = Street();
  const Trajectory poses = ReadTrajectory(Path("out") / "keyframes_tum.txt");
  ASSERT_EQ(poses.size(), scene.cam_from_world.size());
  for (const StampedPose& pose : poses) {
    const FrameId view{static_cast<int>(pose.timestamp_s) - 1};
    EXPECT_LT((pose.world_from_cam * scene.cam_from_world.at(view)).AngleDeg(), 1e-5);
  }
}

// Orientations that are exact, held by their sigma or by the flag, lead to better positions than
// those that follow the keypoints' noise.
TEST_F(SolveTest, HoldsOrientationsAsTightlyAsTheyAreKnown) {
  SceneOptions options;
  options.path = ScenePath::kRing;
  options.num_views = 20;
  options.num_points = 150;
  options.noise_px = 1.0;
  const Scene scene = MakeScene(options);
  KnownRotationInput input;
  input.camera = scene.camera;
  input.cam_from_world = scene.cam_from_world;
  input.tracks = scene.tracks;
  WriteKnownRotation(Path("free.txt"), input);
  for (const auto& [view, rotation] : scene.cam_from_world) input.sigma_rad[view] = 1e-6;
  WriteKnownRotation(Path("tight.txt"), input);
  const auto error = [&](const std::string& name, const std::vector<std::string>& more) {
    const CommandResult result =
        Rotslam({"solve", Path(name).string(), "--out", Path("out").string()}, more);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return ErrorOf(Path("out"), scene, 0);
  };
  const double free = error("free.txt", {});
  const double held = error("free.txt", {"--rotation-sigma-deg", "0"});
  const double tight = error("tight.txt", {});
  EXPECT_LT(held, 0.8 * free);
  EXPECT_NEAR(tight, held, 0.05 * free);
  EXPECT_NEAR(error("free.txt", {"--rotation-sigma-deg", "6e-5"}), held, 0.05 * free);
  EXPECT_NEAR(error("tight.txt", {"--rotation-sigma-deg", "100"}), free, 0.05 * free);
}

TEST_F(SolveTest, OtherConventionsAreRecognised) {
  const Scene scene = [] {
    SceneOptions options;
    options.num_views = 15;
    options.num_points = 300;
    options.noise_px = 0.3;
    return MakeScene(options);
  }();
  KnownRotationInput input;
  input.camera = scene.camera;
  input.tracks = scene.tracks;
  const auto refusal = [&](auto change) {
    for (const auto& [view, rotation] : scene.cam_from_world) {
      input.cam_from_world[view] = change(rotation);
    }
    WriteKnownRotation(Path("in.txt"), input);
    const CommandResult result =
        Rotslam({"solve", Path("in.txt").string(), "--out", Path("out").string(), "--quiet"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(Lines(result.error).size(), 1u) << result.error;
    return result.error;
  };
  EXPECT_THAT(refusal([](const Rotation& r) { return r.Inverse(); }),
              HasSubstr("deg (median), taken for world->camera by 0."));
  Eigen::Matrix3d body_from_cam;
  body_from_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  EXPECT_THAT(refusal([&](const Rotation& r) { return Rotation::FromMatrix(body_from_cam) * r; }),
              HasSubstr("of a body whose axes -y, -z, x are the camera's x, y, z"));
}

TEST_F(SolveTest, CasesThatPeopleBring) {
  if (!fs::exists(Case("solve_ok.txt"))) GTEST_SKIP() << Case("") << " is not here";
  const auto solve = [&](const std::string& name) {
    return Rotslam({"solve", Case(name).string(), "--out", Path(name).string()});
  };
  const CommandResult ok = solve("solve_ok.txt");
  ASSERT_EQ(ok.exit_code, 0) << ok.error;
  const std::string poses = ReadWholeFile(Path("solve_ok.txt") / "keyframes_tum.txt");

  const CommandResult large = solve("solve_ids_over_2_31.txt");
  ASSERT_EQ(large.exit_code, 0) << large.error;
  EXPECT_EQ(ReadWholeFile(Path("solve_ids_over_2_31.txt") / "keyframes_tum.txt"), poses);
  EXPECT_THAT(ReadWholeFile(Path("solve_ids_over_2_31.txt") / "views.csv"),
              HasSubstr("\n0,3000000000,"));
  EXPECT_EQ(ReadResiduals(Path("solve_ids_over_2_31.txt") / "residuals.csv")[0].view, "3000000001");

  const CommandResult doubled = solve("solve_duplicated_observation.txt");
  ASSERT_EQ(doubled.exit_code, 0) << doubled.error;
  EXPECT_THAT(doubled.error, HasSubstr("first track 0 in view 1: 1 merged"));
  EXPECT_EQ(ReadWholeFile(Path("solve_duplicated_observation.txt") / "keyframes_tum.txt"), poses);

  const CommandResult two = solve("solve_two_views.txt");
  ASSERT_EQ(two.exit_code, 0) << two.error;
  EXPECT_EQ(ReadTrajectory(Path("solve_two_views.txt") / "keyframes_tum.txt").size(), 2u);
  EXPECT_THAT(two.error, HasSubstr("18 views could not be placed: "));

  const CommandResult inverted = solve("solve_rotations_inverted.txt");
  EXPECT_EQ(inverted.exit_code, 1);
  EXPECT_THAT(inverted.error, HasSubstr("taken for world->camera"));
}

// A view that two points see has no place, and is named.
TEST_F(SolveTest, NamesWhatHasNoPlace) {
  Scene scene = Street();
  int left = 2;
  for (Track& track : scene.tracks) {
    std::erase_if(track.observations, [&](const Observation& observation) {
      return observation.frame == FrameId{5} && left-- <= 0;
    });
  }
  WriteColmapText(Path("model"), scene);
  const CommandResult result =
      Rotslam({"solve", Path("model").string(), "--out", Path("out").string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("1 view could not be placed: 6 (2 observations of tracks)"));
  EXPECT_EQ(ReadTrajectory(Path("out") / "trajectory_tum.txt").size(), 12u);
  EXPECT_EQ(ReadTrajectory(Path("out") / "keyframes_tum.txt").size(), 11u);
  EXPECT_THAT(ReadWholeFile(Path("out") / "poses.csv"), HasSubstr(",unplaced,"));
}

TEST_F(SolveTest, AColmapModelComesOutAsOne) {
  const Scene scene = Street();
  WriteColmapBinary(Path("model"), scene);
  const CommandResult result =
      Rotslam({"solve", Path("model").string(), "--out", Path("out").string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const ColmapModel before = ReadColmapModel(Path("model"));
  const ColmapModel after = ReadColmapModel(Path("out") / "sparse/0");
  EXPECT_EQ(after.image_name, before.image_name);
  EXPECT_EQ(after.images.size(), before.images.size());
  EXPECT_GT(after.point_id.size(), 0.9 * static_cast<double>(before.point_id.size()));
  std::set<std::uint64_t> ids;
  for (const auto& [track, id] : before.point_id) ids.insert(id);
  for (const auto& [track, id] : after.point_id) EXPECT_TRUE(ids.contains(id)) << id;
  for (const auto& [frame, image] : after.images) {
    EXPECT_EQ(image.keypoints_px, before.images.at(frame).keypoints_px);
  }
  CenterMap centers;
  for (const auto& [frame, center] : after.reconstruction.center_in_world) {
    centers[FrameId{frame.value - 1}] = center;
  }
  const CenterMap& truth = scene.true_center_in_world;
  EXPECT_LT(CompareCenters(centers, truth, AlignCenters(centers, truth)).max, 0.05);
}

// A model whose every other image is from a camera of its own.
void WriteTwoCameras(const fs::path& folder,
                     const Scene& scene,
                     const Camera& even,
                     const Camera& odd) {
  WriteColmapText(folder, scene);
  ColmapModel model = ReadColmapModel(folder);
  model.cameras = {{1, even}, {7, odd}};
  for (auto& [frame, image] : model.images) {
    image.camera = frame.value % 2 == 0 ? 1 : 7;
    for (Eigen::Vector2d& keypoint_px : image.keypoints_px) {
      const auto bearing = scene.camera.Unproject(keypoint_px - Eigen::Vector2d(0.5, 0.5));
      keypoint_px = *model.cameras.at(image.camera).Project(*bearing) + Eigen::Vector2d(0.5, 0.5);
    }
  }
  WriteColmapModel(folder, model, model.reconstruction, ColmapForm::kText);
}

TEST_F(SolveTest, SeveralCamerasGoInAndComeOut) {
  const Scene scene = Street();
  Camera other = scene.camera;
  other.model = CameraModel::kRadtan;
  other.fx = other.fy = 0.8 * scene.camera.fx;
  other.distortion[0] = -0.1;
  WriteTwoCameras(Path("two"), scene, scene.camera, other);
  const CommandResult result =
      Rotslam({"solve", Path("two").string(), "--out", Path("out").string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error,
              AllOf(HasSubstr("the images have 2 cameras"), HasSubstr("model after:  12 images")));
  EXPECT_LT(ErrorOf(Path("out"), scene, 1), 0.05);
  const ColmapModel after = ReadColmapModel(Path("out") / "sparse/0");
  EXPECT_EQ(after.cameras, ReadColmapModel(Path("two")).cameras);
  EXPECT_LT(FiguresOf(after, after.reconstruction).mean_error_px, 0.6);
  for (const auto& [frame, image] : after.images)
    EXPECT_EQ(image.camera, frame.value % 2 == 0 ? 1 : 7);
  // The map has none of these cameras.
  EXPECT_EQ(Rotslam({"plot", Path("out").string()}).exit_code, 0);
  for (const char* format : {"colmap", "nerf", "openmvg"}) {
    const CommandResult exported = Rotslam(
        {"export", Path("out").string(), "--to", format, "--out", Path("exported").string()});
    EXPECT_EQ(exported.exit_code, 1);
    EXPECT_THAT(exported.error, HasSubstr("its images have several cameras"));
  }
}

// A fisheye sees what a pinhole stretches: an error of a pixel far from its centre is many there.
TEST_F(SolveTest, FisheyesAreNotTakenForPinholes) {
  const Scene scene = Street();
  Camera even = scene.camera;
  even.model = CameraModel::kEquidistant;
  Camera odd = even;
  odd.fx = odd.fy = 1.2 * even.fx;
  odd.distortion[0] = 0.01;
  WriteTwoCameras(Path("two"), scene, even, odd);
  const ColmapModel model = ReadColmapModel(Path("two"));
  EXPECT_EQ(model.camera.model, CameraModel::kEquidistant);
  // A pixel of the image is what the deviation says, wherever it is.
  for (const Track& track : model.reconstruction.tracks) {
    for (const Observation& one : track.observations) {
      const Camera& camera = one.frame.value % 2 == 0 ? even : odd;
      const Eigen::Vector2d seen_px = *camera.Project(one.bearing);
      Eigen::Matrix2d moved;
      for (int k = 0; k < 2; ++k) {
        const auto bearing = camera.Unproject(seen_px + 1e-3 * Eigen::Vector2d::Unit(k));
        moved.col(k) = (*model.camera.Project(*bearing) - one.keypoint_px) / 1e-3;
      }
      EXPECT_NEAR(one.sigma_px, std::sqrt(std::abs(moved.determinant())), 1e-3);
    }
  }
}

// What `run` leaves goes into other commands, and so does this.
TEST_F(SolveTest, OtherCommandsTakeItsFolder) {
  WriteColmapText(Path("model"), Street());
  ASSERT_EQ(Rotslam({"solve", Path("model").string(), "--out", Path("out").string(), "--quiet"})
                .exit_code,
            0);
  for (const char* format :
       {"tum", "kitti", "euroc", "csv", "g2o", "ply", "colmap", "colmap-db", "nerf", "openmvg"}) {
    const CommandResult exported = Rotslam({"export",
                                            Path("out").string(),
                                            "--to",
                                            format,
                                            "--out",
                                            (Path("exported") / format).string()});
    EXPECT_EQ(exported.exit_code, 0) << format << exported.error;
  }
  EXPECT_EQ(ReadColmapModel(Path("exported") / "colmap").image_name.begin()->second, "image0.png");
  const CommandResult report = Rotslam({"report", Path("out").string()});
  EXPECT_EQ(report.exit_code, 0) << report.error;
  const CommandResult plot =
      Rotslam({"plot", Path("out").string(), "--out", Path("plots").string()});
  EXPECT_EQ(plot.exit_code, 0) << plot.error;
  const CommandResult again =
      Rotslam({"solve", Path("out").string(), "--out", Path("again").string(), "--quiet"});
  EXPECT_EQ(again.exit_code, 0) << again.error;
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
