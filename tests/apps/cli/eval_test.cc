#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "output/trajectory/trajectory.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

const std::filesystem::path kShared = ROTSLAM_SHARED_DIR;
const std::filesystem::path kPythonTool = kShared / "tools/check_trajectory.py";

struct CommandResult {
  int exit_code = -1;
  std::string output;  // standard output and error
};

CommandResult RunCommand(const std::string& command) {
  std::FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  CommandResult result;
  std::array<char, 4096> buffer;
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) result.output += buffer.data();
  result.exit_code = WEXITSTATUS(pclose(pipe));
  return result;
}

CommandResult RunEval(const std::string& arguments) {
  return RunCommand(std::string(ROTSLAM_EXECUTABLE) + " eval " + arguments);
}

// What keeps this machine from running the independent tool; empty when nothing does.
std::string WhyNoPythonTool() {
  if (!std::filesystem::exists(kPythonTool)) return kPythonTool.string() + " is not here";
  if (RunCommand("/usr/bin/python3 -c 'import numpy'").exit_code != 0) {
    return "needs /usr/bin/python3 with numpy (Debian: python3-numpy)";
  }
  return "";
}

// Runs both tools with the same files and compares every number to 1e-6 (relative above one).
void ExpectAgreement(const std::string& arguments, const std::string& formats) {
  SCOPED_TRACE(arguments);
  const CommandResult ours = RunEval(arguments + " --json");
  const CommandResult theirs = RunCommand("/usr/bin/python3 " + kPythonTool.string() + " " +
                                          arguments + " " + formats + " --json");
  ASSERT_EQ(ours.exit_code, 0) << ours.output;
  ASSERT_EQ(theirs.exit_code, 0) << theirs.output;
  const auto our_json = nlohmann::json::parse(ours.output);
  const auto their_json = nlohmann::json::parse(theirs.output);
  ASSERT_EQ(our_json.size(), their_json.size());
  for (const auto& [key, value] : their_json.items()) {
    if (value.is_null()) {
      EXPECT_TRUE(our_json.at(key).is_null()) << key;
      continue;
    }
    ASSERT_TRUE(our_json.at(key).is_number()) << key;
    const double expected = value.get<double>();
    EXPECT_NEAR(our_json.at(key).get<double>(), expected, 1e-6 * std::max(1.0, std::abs(expected)))
        << key;
  }
}

// A noisy copy in another world, at the given share of its poses and shifted in time.
void WriteEstimate(const std::filesystem::path& path,
                   const Trajectory& truth,
                   double time_shift_s,
                   double keep_ratio) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const auto noise = [&](double sigma) {
    return Eigen::Vector3d(
        sigma * normal(generator), sigma * normal(generator), sigma * normal(generator));
  };
  const Rotation other_from_world = Rotation::Exp({1.0, 2.0, -0.5});
  Trajectory estimate;
  for (StampedPose pose : truth) {
    if (uniform(generator) > keep_ratio) continue;
    pose.timestamp_s += time_shift_s;
    pose.world_from_cam = other_from_world * pose.world_from_cam * Rotation::Exp(noise(0.02));
    pose.center_in_world = 0.3 * (other_from_world * pose.center_in_world) + noise(0.01);
    estimate.push_back(pose);
  }
  WriteTumTrajectory(path, estimate);
}

TEST(EvalCommand, AgreesWithThePythonToolOnKitti) {
  if (const std::string why = WhyNoPythonTool(); !why.empty()) GTEST_SKIP() << why;
  const std::filesystem::path references = kShared / "data/references";
  if (!std::filesystem::exists(references)) GTEST_SKIP() << references << " is not here";
  const std::string truth_kitti = (kShared / "data/kitti00/poses.txt").string();
  const std::string times = (kShared / "data/kitti00/times.txt").string();
  for (const char* name : {"mro", "orbslam2", "pnec", "colmap"}) {
    const std::string estimate = (references / (std::string("kitti00_") + name + ".txt")).string();
    ExpectAgreement((references / "kitti00_truth.txt").string() + " " + estimate + " --images 200",
                    "");
    ExpectAgreement(truth_kitti + " " + estimate + " --times " + times, "--gt-format kitti");
  }
  ExpectAgreement(truth_kitti + " " + truth_kitti, "--gt-format kitti --est-format kitti");
}

TEST(EvalCommand, AgreesWithThePythonToolWhereTruthIsInterpolated) {
  if (const std::string why = WhyNoPythonTool(); !why.empty()) GTEST_SKIP() << why;
  const TemporaryFolder folder;
  const std::string estimate = (folder.path() / "estimate.txt").string();
  for (const char* name : {"7scenes_kitchen/groundtruth_tum.txt",
                           "tum_fr1_rpy/groundtruth.txt",
                           "pan720/groundtruth_tum.txt",
                           "euroc_v101_keyframes/groundtruth_cam0_tum.txt"}) {
    const std::filesystem::path truth = kShared / "data" / name;
    if (!std::filesystem::exists(truth)) GTEST_SKIP() << truth << " is not here";
    // A share of the poses keeps the quadratic metric of the slow tool within seconds.
    WriteEstimate(estimate, ReadTrajectory(truth), 0.004, 0.2);
    ExpectAgreement(truth.string() + " " + estimate + " --images 400", "");
    ExpectAgreement(truth.string() + " " + estimate + " --max-gap 3", "");
  }
}

TEST(EvalCommand, PrintsATableForPeople) {
  const TemporaryFolder folder;
  const auto path =
      folder.Write("t.txt", "0 0 0 0 0 0 0 1\n0.1 1 0 0 0 0 0 1\n0.2 1 1 0 0 0 0 1\n");
  const CommandResult result = RunEval(path.string() + " " + path.string() + " --images 4");
  EXPECT_EQ(result.exit_code, 0);
  for (const char* text : {"RPE_1 ", "RPE_n ", "75.00  % of the images", "shorter than 100 m"}) {
    EXPECT_THAT(result.output, testing::HasSubstr(text));
  }
}

TEST(EvalCommand, ReportsInOneLineWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string good = folder.Write("good.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n").string();
  const std::string bad = folder.Write("bad.txt", "0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n").string();
  for (const std::string& arguments : {good + " " + bad,
                                       good + " " + good,
                                       good + " " + folder.path().string(),
                                       good + " " + (folder.path() / "none").string()}) {
    const CommandResult result = RunEval(arguments);
    EXPECT_EQ(result.exit_code, 1) << arguments;
    EXPECT_THAT(result.output, testing::StartsWith("rotslam: ")) << arguments;
    EXPECT_EQ(std::count(result.output.begin(), result.output.end(), '\n'), 1) << result.output;
  }
}

// One trajectory and its truth in many forms.
const std::filesystem::path kCases = kShared / "cases/inputs/eval";

TEST(EvalCommand, ReadsTheFilesThatPeopleBring) {
  if (!std::filesystem::exists(kCases)) GTEST_SKIP() << kCases << " is not here";
  struct Case {
    const char* truth;
    const char* estimate;
    const char* note;  // a part of one of the notes; empty for none at all
    const char* more = "";
  };
  // With all 120 poses the error is 0.0631; lost ones change it a little.
  const std::vector<Case> cases = {
      {"gt.txt", "est.txt", ""},
      {"gt.txt", "est_bom.txt", ""},
      {"gt.txt", "est_bom_nohead.txt", ""},
      {"gt.txt", "est_comma.txt", ""},
      {"gt.txt", "est_semicolon.txt", ""},
      {"gt.txt", "est_decimalcomma.txt", "decimal points"},
      {"gt.txt", "est_header.txt", ""},
      {"gt.txt", "est_trailing.txt", "is not used"},
      {"gt.txt", "est_frameidx9.txt", "taken for an index"},
      {"gt.txt", "est_orb3_ns.txt", "taken for ns"},
      {"gt.txt", "est_euroc8.csv", ""},
      {"gt.txt", "est_dup.txt", "1 pose left out whose time is there before"},
      {"gt.txt", "est_nan.txt", "1 pose left out that is marked as lost"},
      {"gt.txt", "est_zeroq.txt", "1 pose left out that is marked as lost"},
      {"gt.txt", "est_kitti.txt", "paired in their order"},
      {"gt.txt", "est_kitti13.txt", "paired in their order"},
      {"gt.txt", "est_kitti16.txt", "paired in their order"},
      {"gt.txt", "est_kitti.txt", "", "--times"},
      {"gt_kitti.txt", "est_kitti.txt", ""},
      {"gt_kitti.txt", "est.txt", "paired in their order"},
      {"gt_kitti.txt", "est.txt", "", "--times"},
      {"gt_dup.txt", "est.txt", "1 pose left out whose time is there before"},
      {"gt_euroc17.csv", "est.txt", "velocities and biases are not used"},
      {"gt_tumvi8.csv", "est.txt", ""},
      {"gt_seconds_qw.csv", "est.txt", "gt_seconds_qw.csv is taken for qw first"},
      {"gt_tartan.txt", "est.txt", "paired in their order"},
      {"gt_idx.txt", "est.txt", "paired in their order"},
      {"gt_idx.txt", "est.txt", "taken for lines of", "--times"},
      {"gt_worldtocam.txt", "est.txt", "gt_worldtocam.txt is taken for world->camera"},
      {"gt_body.txt", "est.txt", "which is taken out", "--align-axes"},
      {"gt_off.txt", "est.txt", "", "--time-offset 3600"}};
  std::set<std::string> named = {"times.txt"};
  for (const Case& one : cases) {
    SCOPED_TRACE(std::string(one.truth) + " " + one.estimate + " " + one.more);
    named.insert({one.truth, one.estimate});
    std::string more = one.more;
    if (more == "--times") more += " " + (kCases / "times.txt").string();
    const CommandResult result = RunEval((kCases / one.truth).string() + " " +
                                         (kCases / one.estimate).string() + " --json " + more);
    EXPECT_EQ(result.exit_code, 0) << result.output;
    if (result.exit_code != 0) continue;
    const auto json = nlohmann::json::parse(result.output);
    EXPECT_NEAR(json.at("rpe1").get<double>(), 0.0631, 0.0015);
    EXPECT_GE(json.at("n").get<int>(), 115);
    const std::string notes = json.contains("notes") ? json["notes"].dump() : "";
    EXPECT_THAT(notes, testing::HasSubstr(one.note));
    EXPECT_EQ(notes.empty(), std::string(one.note).empty()) << notes;
  }
  for (const auto& entry : std::filesystem::directory_iterator(kCases)) {
    EXPECT_TRUE(named.contains(entry.path().filename())) << entry.path();
  }
}

TEST(EvalCommand, SaysWhatItLeavesToThePerson) {
  if (!std::filesystem::exists(kCases)) GTEST_SKIP() << kCases << " is not here";
  const auto with_estimate = [](const char* truth) {
    return RunEval((kCases / truth).string() + " " + (kCases / "est.txt").string());
  };
  const CommandResult body = with_estimate("gt_body.txt");
  EXPECT_EQ(body.exit_code, 0);
  EXPECT_THAT(body.output, testing::HasSubstr("note: the estimate's axes are those of the truth"));
  EXPECT_THAT(body.output, testing::HasSubstr("--align-axes takes it out"));
  const CommandResult off = with_estimate("gt_off.txt");
  EXPECT_EQ(off.exit_code, 1);
  EXPECT_THAT(off.output, testing::HasSubstr("3600.000 s apart: --time-offset 3600"));
  EXPECT_EQ(std::count(off.output.begin(), off.output.end(), '\n'), 1);
}

}  // namespace
}  // namespace rotslam
