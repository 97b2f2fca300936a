// `rotslam run` and `rotslam rotations` from pictures to files, on small sequences with exact
// truth.

#include <algorithm>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/graph/g2o.h"
#include "tests/apps/run_directory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::Not;

constexpr std::size_t kNumFrames = 60;

class RunCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    for (const std::string kind : {"gimbal", "handheld"}) {
      const CommandResult simulated = Rotslam({"simulate",
                                               kind,
                                               "--width=320",
                                               "--height=240",
                                               "--frames=" + std::to_string(kNumFrames),
                                               "--out=" + Sequence(kind).string()});
      ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
      const CommandResult run =
          Rotslam({"run", Sequence(kind).string(), "--no-report", "--out=" + Out(kind).string()});
      ASSERT_EQ(run.exit_code, 0) << run.error;
      said_[kind] = run.error;
    }
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  static fs::path Sequence(const std::string& kind) { return shared_->path() / kind; }
  static fs::path Out(const std::string& kind) { return shared_->path() / (kind + "_out"); }
  static fs::path Truth(const std::string& kind) { return Sequence(kind) / "groundtruth_tum.txt"; }
  // What the run printed on the way.
  static std::string Said(const std::string& kind) { return said_[kind]; }

 private:
  static inline const TemporaryFolder* shared_ = nullptr;
  static inline std::map<std::string, std::string> said_;
};

class OnBothSequences : public RunCommand, public testing::WithParamInterface<const char*> {
 protected:
  fs::path Sequence() const { return RunCommand::Sequence(GetParam()); }
  fs::path Out() const { return RunCommand::Out(GetParam()); }
  fs::path Truth() const { return RunCommand::Truth(GetParam()); }
};

INSTANTIATE_TEST_SUITE_P(Run, OnBothSequences, testing::Values("gimbal", "handheld"));

TEST_P(OnBothSequences, WritesItsFilesAndNoOthers) {
  EXPECT_THAT(FileNames(Out()), ElementsAreArray(RunFiles()));
}

TEST_P(OnBothSequences, GivesEveryFrameAPose) {
  const Trajectory truth = ReadTrajectory(Truth());
  const Trajectory poses = ReadTrajectory(Out() / "trajectory_tum.txt");
  const Trajectory kitti = ReadTrajectory(Out() / "trajectory_kitti.txt");
  const Trajectory rotations = ReadTrajectory(Out() / "rotations_tum.txt");
  ASSERT_EQ(truth.size(), kNumFrames);
  ASSERT_EQ(poses.size(), kNumFrames);
  ASSERT_EQ(kitti.size(), kNumFrames);
  ASSERT_EQ(rotations.size(), kNumFrames);
  for (std::size_t k = 0; k < kNumFrames; ++k) {
    EXPECT_NEAR(poses[k].timestamp_s, truth[k].timestamp_s, 1e-9);
    EXPECT_EQ(rotations[k].timestamp_s, poses[k].timestamp_s);
    EXPECT_EQ(rotations[k].center_in_world, Eigen::Vector3d::Zero());
    // Both files hold twelve digits of the same pose.
    EXPECT_LT((kitti[k].world_from_cam.Inverse() * poses[k].world_from_cam).Angle(), 1e-10);
    EXPECT_LT((kitti[k].center_in_world - poses[k].center_in_world).norm(), 1e-9);
  }
}

TEST_P(OnBothSequences, KeyframesAreFramesOfTheTrajectory) {
  const std::vector<std::string> all = Lines(ReadWholeFile(Out() / "trajectory_tum.txt"));
  const std::vector<std::string> keyframes = Lines(ReadWholeFile(Out() / "keyframes_tum.txt"));
  EXPECT_GE(keyframes.size(), 5u);
  EXPECT_LT(keyframes.size(), kNumFrames);
  for (const std::string& line : keyframes) EXPECT_THAT(all, testing::Contains(line));
}

TEST_P(OnBothSequences, CloudHoldsThousandsOfPoints) {
  // 6,749 handheld and 7,735 gimbal.
  EXPECT_GT(CountPlyPoints(Out() / "cloud.ply"), 2000);
}

TEST_P(OnBothSequences, OrientationsAreThoseOfTheCamera) {
  // 0.02 deg both, root mean square; the truth of the rendering is exact.
  EXPECT_LT(Compare(Truth(), Out() / "rotations_tum.txt").rpe1_deg, 0.06);
  EXPECT_LT(Compare(Truth(), Out() / "trajectory_tum.txt").rpe1_deg, 0.06);
  EXPECT_LT(Compare(Truth(), Out() / "trajectory_tum.txt").rpen_deg, 0.3);
}

TEST_P(OnBothSequences, ViewGraphCanBeRead) {
  const PoseGraph pose_graph = ReadG2o(Out() / "view_graph.g2o");
  const Trajectory rotations = ReadTrajectory(Out() / "rotations_tum.txt");
  ASSERT_EQ(pose_graph.cam_from_world.size(), kNumFrames);
  // Four neighbours each where nothing goes wrong.
  EXPECT_GE(pose_graph.graph.edges().size(), 3 * kNumFrames);
  for (const auto& [frame, cam_from_world] : pose_graph.cam_from_world) {
    EXPECT_LT((cam_from_world * rotations[frame.value].world_from_cam).Angle(), 1e-6);
  }
  for (const RelativeRotation& edge : pose_graph.graph.edges()) {
    const Rotation j_from_i =
        pose_graph.cam_from_world.at(edge.j) * pose_graph.cam_from_world.at(edge.i).Inverse();
    EXPECT_LT((j_from_i.Inverse() * edge.j_from_i).Angle(), 0.02);
  }
}

void ExpectFinite(const nlohmann::ordered_json& json, const std::string& name) {
  if (json.is_structured()) {
    for (const auto& [key, value] : json.items()) ExpectFinite(value, name + "." + key);
  }
  EXPECT_FALSE(json.is_null()) << name << " is null: the number was not finite";
}

TEST_P(OnBothSequences, SummarySaysWhatWasDone) {
  const nlohmann::ordered_json summary = ReadSummary(Out());
  std::vector<std::string> keys;
  for (const auto& [key, value] : summary.items()) keys.push_back(key);
  EXPECT_THAT(keys,
              ElementsAre("version",
                          "command",
                          "options",
                          "sequence",
                          "camera",
                          "lens_checks",
                          "counts",
                          "seconds",
                          "rotodom",
                          "krot",
                          "ba",
                          "segments",
                          "loops"));
  for (const auto& [key, value] : summary.items()) {
    if (key != "options") ExpectFinite(value, key);  // an option may be infinite
  }
  EXPECT_EQ(summary["command"], "run");
  EXPECT_EQ(summary["counts"]["frames"], kNumFrames);
  EXPECT_EQ(summary["counts"]["unreadable_frames"], 0);
  EXPECT_EQ(summary["counts"]["keyframes"], ReadTrajectory(Out() / "keyframes_tum.txt").size());
  EXPECT_LE(CountPlyPoints(Out() / "cloud.ply"), summary["counts"]["points"].get<std::int64_t>());
  EXPECT_EQ(summary["krot"]["status"], "converged");
  EXPECT_LE(summary["krot"]["gamma_low"].get<double>(),
            summary["krot"]["gamma_high"].get<double>());
  const auto& last = summary["krot"]["final"];
  EXPECT_LE(last["gamma_low_px"].get<double>(), last["gamma_high_px"].get<double>());
  EXPECT_LE(last["gamma_high_px"].get<double>(), last["largest_residual_px"].get<double>());
  EXPECT_LE(summary["ba"]["final_cost"].get<double>(), summary["ba"]["initial_cost"].get<double>());
  EXPECT_LT(summary["ba"]["mean_error_px"].get<double>(), 0.5);
  EXPECT_GT(summary["ba"]["completed_observations"].get<int>(), 0);
  EXPECT_EQ(summary["camera"]["model"], "pinhole");
}

TEST_P(OnBothSequences, SegmentsCoverAllFramesOnce) {
  int next = 0;
  for (const SegmentRow& row : ReadSegments(Out() / "segments.csv")) {
    EXPECT_EQ(row.first, next);
    EXPECT_LE(row.first, row.last);
    next = row.last + 1;
  }
  EXPECT_EQ(next, static_cast<int>(kNumFrames));
}

// Lines and cells of rotations.csv, the names of the columns first.
std::vector<std::vector<std::string>> ReadRotationsCsv(const fs::path& path) {
  std::vector<std::vector<std::string>> rows;
  for (const std::string& line : Lines(ReadWholeFile(path))) {
    std::istringstream cells(line + ",");
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

TEST_P(OnBothSequences, RotationsCsvTellsWhatIsKnownOfEveryFrame) {
  const auto rows = ReadRotationsCsv(Out() / "rotations.csv");
  const Trajectory rotations = ReadTrajectory(Out() / "rotations_tum.txt");
  ASSERT_EQ(rows.size(), kNumFrames + 1);
  for (std::size_t k = 0; k < kNumFrames; ++k) {
    const std::vector<std::string>& row = rows[k + 1];
    ASSERT_EQ(row.size(), rows[0].size());
    EXPECT_EQ(std::stoul(row[0]), k);
    EXPECT_NEAR(std::stod(row[1]), rotations[k].timestamp_s, 1e-6);
    const Rotation rotation(Eigen::Quaterniond(
        std::stod(row[5]), std::stod(row[2]), std::stod(row[3]), std::stod(row[4])));
    EXPECT_LT((rotation * rotations[k].world_from_cam.Inverse()).Angle(), 1e-9);
    for (int axis = 6; axis < 9; ++axis) {
      const double sigma_deg = std::stod(row[axis]);
      // The first frame is the world; the others drift by hundredths of a degree.
      EXPECT_EQ(sigma_deg > 0.0, k > 0) << k;
      EXPECT_LT(sigma_deg, 0.5) << k;
    }
    EXPECT_GE(std::stoi(row[9]), 2) << k;
  }
  EXPECT_GT(std::stod(rows.back()[7]), std::stod(rows[2][7]));
}

TEST_F(RunCommand, AveragingFlagOverridesTheConfiguration) {
  const TemporaryFolder folder;
  const fs::path config = folder.Write("off.yaml", "rotodom: {averaging: {mode: \"off\"}}\n");
  const auto rotations = [&](const std::string& name, const std::vector<std::string>& more) {
    const fs::path out = folder.path() / name;
    std::vector<std::string> arguments = more;
    arguments.insert(arguments.end(), {"--last=20", "--out=" + out.string()});
    const CommandResult result = Rotslam({"rotations", Sequence("handheld").string()}, arguments);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return ReadWholeFile(out / "rotations_tum.txt");
  };
  const std::string window = rotations("default", {});
  EXPECT_EQ(rotations("window", {"--config=" + config.string(), "--averaging=window"}), window);
  const std::string off = rotations("off", {"--averaging=off"});
  EXPECT_NE(off, window);
  EXPECT_EQ(rotations("configured", {"--config=" + config.string()}), off);
  EXPECT_NE(rotations("global", {"--averaging=global"}), window);
  EXPECT_NE(Rotslam({"rotations", Sequence("handheld").string(), "--averaging=some"}).exit_code, 0);
}

TEST_P(OnBothSequences, RotationsStopsAfterTheSameOrientations) {
  const TemporaryFolder folder;
  const CommandResult result =
      Rotslam({"rotations", Sequence().string(), "--no-report", "--out=" + folder.path().string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(
      FileNames(folder.path()),
      ElementsAre(
          "loops.csv", "rotations.csv", "rotations_tum.txt", "summary.json", "view_graph.g2o"));
  for (const char* name : {"loops.csv", "rotations.csv", "rotations_tum.txt", "view_graph.g2o"}) {
    EXPECT_EQ(ReadWholeFile(folder.path() / name), ReadWholeFile(Out() / name)) << name;
  }
  EXPECT_EQ(ReadSummary(folder.path())["command"], "rotations");
  EXPECT_EQ(ReadSummary(folder.path())["options"], ReadSummary(Out())["options"]);
}

TEST_F(RunCommand, HandheldPositionsAreThoseOfTheCamera) {
  const TrajectoryMetrics metrics =
      Compare(Truth("handheld"), Out("handheld") / "trajectory_tum.txt");
  ASSERT_TRUE(metrics.ate_m.has_value());
  // 0.16 % of the way.
  EXPECT_LT(*metrics.ate_m, 0.006 * metrics.path_length_m);
}

TEST_F(RunCommand, SaysWhyThereAreFewPoints) {
  EXPECT_THAT(Said("handheld"), Not(HasSubstr("too little")));
  const TemporaryFolder folder;
  const CommandResult result = Rotslam({"run",
                                        Sequence("handheld").string(),
                                        "--last=4",
                                        "--no-report",
                                        "--out=" + folder.path().string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const auto counts = ReadSummary(folder.path())["counts"];
  const auto points = counts["points"].get<std::int64_t>();
  const auto shallow = counts["shallow_points"].get<std::int64_t>();
  const auto alone = counts["cloud_outliers"].get<std::int64_t>();
  EXPECT_GT(shallow, points);
  EXPECT_THAT(result.error,
              HasSubstr("cloud: " + std::to_string(points) + " points; " + std::to_string(shallow) +
                        " seen under less than 2 deg and " + std::to_string(alone) + " isolated"));
  EXPECT_THAT(
      result.error,
      HasSubstr("warning: the cloud holds " + std::to_string(points) + " of " +
                std::to_string(points + shallow + alone) + " points: the camera has moved"));
}

// Part of a trajectory as a metric sees it.
double AteOfFrames(const Trajectory& truth, const Trajectory& estimate, int first, int last) {
  const Trajectory part(estimate.begin() + first, estimate.begin() + last + 1);
  const TrajectoryMetrics metrics = ComputeMetrics(AssociatePoses(truth, part, {}), {});
  EXPECT_TRUE(metrics.ate_m.has_value());
  return metrics.ate_m.value_or(1e9) / metrics.path_length_m;
}

TEST_F(RunCommand, GimbalStandsWhileItOnlyRotates) {
  const Trajectory truth = ReadTrajectory(Truth("gimbal"));
  const Trajectory poses = ReadTrajectory(Out("gimbal") / "trajectory_tum.txt");
  std::vector<SegmentRow> true_turns = ReadSegments(Sequence("gimbal") / "segments_truth.csv");
  std::vector<SegmentRow> turns = ReadSegments(Out("gimbal") / "segments.csv");
  const auto moves = [](const SegmentRow& row) { return row.kind != "rotating"; };
  std::erase_if(true_turns, moves);
  std::erase_if(turns, moves);
  ASSERT_EQ(true_turns.size(), 1u);
  ASSERT_EQ(turns.size(), 1u);
  EXPECT_LE(turns[0].first, true_turns[0].first);
  EXPECT_GE(turns[0].last, true_turns[0].last);
  // A camera that brakes and starts softly creeps: 0.3 mm show as 0.03 px at the walls, little more
  // than matches may err by in common. 18 to 41 are right and found.
  for (int frame = turns[0].first; frame <= turns[0].last; ++frame) {
    const Eigen::Vector3d off =
        truth[frame].center_in_world - truth[true_turns[0].first].center_in_world;
    EXPECT_LT(off.norm(), 3e-4) << frame;
  }

  std::vector<std::string> lines = Lines(ReadWholeFile(Out("gimbal") / "trajectory_tum.txt"));
  // Said in front of the poses: nothing ties the scale behind the turn.
  ASSERT_EQ(lines.size(), kNumFrames + 2u);
  EXPECT_EQ(lines.front().find("# frames "), 0u) << lines.front();
  EXPECT_NE(lines.front().find("whose scale nothing measures"), std::string::npos);
  EXPECT_NE(lines[1].find("held, position of a pure rotation"), std::string::npos) << lines[1];
  EXPECT_THAT(Said("gimbal"),
              HasSubstr("the map from frame " + std::to_string(turns[0].last + 1) +
                        " on shares no points with the part before"));
  EXPECT_THAT(Said("gimbal"), HasSubstr(" 1 pure-rotation segment, "));
  lines.erase(lines.begin(), lines.begin() + 2);
  const auto position_text = [&](int frame) {
    std::istringstream words(lines[frame]);
    std::string time, x, y, z;
    words >> time >> x >> y >> z;
    return x + " " + y + " " + z;
  };
  for (int frame = turns[0].first; frame <= turns[0].last; ++frame) {
    EXPECT_EQ(position_text(frame), position_text(turns[0].first)) << frame;
  }
  // Nothing ties the scales on both sides of the turn: each side is measured by itself.
  EXPECT_LT(AteOfFrames(truth, poses, 0, turns[0].first), 0.02);
  EXPECT_LT(AteOfFrames(truth, poses, turns[0].last, kNumFrames - 1), 0.02);
  // By default things stay as far away as they were, which is about true of this room.
  const TrajectoryMetrics metrics = Compare(Truth("gimbal"), Out("gimbal") / "trajectory_tum.txt");
  EXPECT_LT(metrics.ate_m.value_or(1e9), 0.06 * metrics.path_length_m);
}

// A camera that turns about an axis some centimetres behind it.
class OffAxisRotation : public testing::Test {
 protected:
  // What the run says.
  std::string Run(const std::vector<std::string>& flags) {
    const CommandResult simulated =
        Rotslam({"simulate", "gimbal", "--out=" + Sequence().string()}, flags);
    EXPECT_EQ(simulated.exit_code, 0) << simulated.error;
    const CommandResult run = Rotslam({"run", Sequence().string(), "--out=" + Out().string()});
    EXPECT_EQ(run.exit_code, 0) << run.error;
    return run.error;
  }

  fs::path Sequence() const { return folder_.path() / "arm"; }
  fs::path Truth() const { return Sequence() / "groundtruth_tum.txt"; }
  fs::path Out() const { return folder_.path() / "out"; }

 private:
  TemporaryFolder folder_;
};

// Points that come into view in such a turn move by a few pixels at most until they leave it.
TEST_F(OffAxisRotation, KeepsTheScale) {
  const std::string said = Run({"--lever-arm=0.05", "--turn-deg=180", "--frames=60"});
  const Trajectory truth = ReadTrajectory(Truth());
  const Trajectory poses = ReadTrajectory(Out() / "trajectory_tum.txt");
  ASSERT_EQ(poses.size(), kNumFrames);
  const auto scale_of = [&](int first, int last) {
    const Trajectory part(poses.begin() + first, poses.begin() + last + 1);
    return ComputeMetrics(AssociatePoses(truth, part, {}), {}).scale.value_or(0.0);
  };
  EXPECT_NEAR(scale_of(42, 59) / scale_of(0, 18), 1.0, 0.02);
  EXPECT_THAT(said, Not(HasSubstr("shares no points with the part before")));
}

// Where such a turn begins, each pair of frames takes it for one in place, and all of them there
// together for one through another lens; the whole turn tells. Held there the path is 0.31 m off.
TEST_F(OffAxisRotation, IsHeldNowhere) {
  Run({"--lever-arm=0.03",
       "--turn-axis=pitch",
       "--turn-deg=90",
       "--frames=90",
       "--width=480",
       "--height=360",
       "--seed=24"});
  EXPECT_THAT(ReadWholeFile(Out() / "segments.csv"), Not(HasSubstr("rotating")));
  EXPECT_LT(Compare(Truth(), Out() / "trajectory_tum.txt").ate_m.value_or(1e9), 0.01);
}

// How far the path strays in frames 18 to 41, in which the camera only turns; shares of all its
// way.
double StrayingInTurn(const fs::path& sequence, const fs::path& config) {
  const TemporaryFolder folder;
  const CommandResult run = Rotslam(
      {"run", sequence.string(), "--out=" + folder.path().string(), "--config=" + config.string()});
  EXPECT_EQ(run.exit_code, 0) << run.error;
  const Trajectory truth = ReadTrajectory(sequence / "groundtruth_tum.txt");
  const Trajectory poses = ReadTrajectory(folder.path() / "trajectory_tum.txt");
  const Trajectory before(poses.begin(), poses.begin() + 18);
  const TrajectoryMetrics metrics = ComputeMetrics(AssociatePoses(truth, before, {}), {});
  double astray_m = 0.0;
  for (int frame = 18; frame < 42; ++frame) {
    EXPECT_EQ(truth[frame].center_in_world, truth[18].center_in_world);
    const Eigen::Vector3d moved = poses[frame].center_in_world - poses[18].center_in_world;
    astray_m = std::max(astray_m, metrics.scale.value_or(0.0) * moved.norm());
  }
  return astray_m / ComputeMetrics(AssociatePoses(truth, truth, {}), {}).path_length_m;
}

// What holding is good for: without it the camera that turns in place by 240 deg goes astray, by
// more than a tenth of its whole way (0.77 m of 2.2 m).
TEST(TurnInPlace, WithoutHoldingGoesAstray) {
  const TemporaryFolder folder;
  const fs::path sequence = folder.path() / "wide";
  const CommandResult simulated = Rotslam({"simulate",
                                           "gimbal",
                                           "--width=320",
                                           "--height=240",
                                           "--frames=60",
                                           "--turn-deg=240",
                                           "--out=" + sequence.string()});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
  const fs::path off = folder.Write("off.yaml", "pure_rotation_segments: {enabled: false}\n");
  const fs::path on = folder.Write("on.yaml", "pure_rotation_segments: {enabled: true}\n");
  EXPECT_GT(StrayingInTurn(sequence, off), 0.1);
  EXPECT_EQ(StrayingInTurn(sequence, on), 0.0);
}

TEST_F(RunCommand, TakesFirstLastAndStride) {
  const TemporaryFolder folder;
  const CommandResult result = Rotslam({"run",
                                        Sequence("handheld").string(),
                                        "--out=" + folder.path().string(),
                                        "--first=3",
                                        "--last=50",
                                        "--stride=2"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("24 frames"));
  const Trajectory truth = ReadTrajectory(Truth("handheld"));
  const Trajectory poses = ReadTrajectory(folder.path() / "trajectory_tum.txt");
  ASSERT_EQ(poses.size(), 24u);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    EXPECT_NEAR(poses[k].timestamp_s, truth[3 + 2 * k].timestamp_s, 1e-9);
  }
  EXPECT_LT(Compare(Truth("handheld"), folder.path() / "trajectory_tum.txt").rpe1_deg, 0.1);
}

}  // namespace
}  // namespace rotslam
