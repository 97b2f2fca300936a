#include "apps/report/run_check.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kNumChecked = 100;

// A run against which nothing speaks.
RunFacts GoodRun() {
  RunFacts facts;
  facts.summary = {{"command", "run"},
                   {"counts", {{"frames", kNumChecked}, {"keyframes", 20}, {"breaks", 0}}},
                   {"ba", {{"observations", 12000}, {"mean_error_px", 0.4}}}};
  for (int n = 0; n < kNumChecked; ++n) {
    PoseRow& row = facts.poses.emplace_back();
    row.frame = n;
    row.state = PoseState::kMeasured;
    row.component = 0;
  }
  facts.segments = {{0, kNumChecked - 1, "translating", 0, "reference", 0.0}};
  return facts;
}

void SetStates(RunFacts& facts, int first, int last, PoseState state, const std::string& note) {
  for (int n = first; n <= last; ++n) {
    facts.poses[n].state = state;
    facts.poses[n].note = note;
  }
}

struct Fault {
  const char* name;
  std::function<void(RunFacts&)> make;
  Verdict verdict;
  const char* frames;
  const char* text;  // in the reason
};

const std::vector<Fault> kFaults = {
    {"Interrupted",
     [](RunFacts& facts) { facts.summary["interrupted"] = true; },
     Verdict::kLookAt,
     "all frames",
     "--resume"},
    {"Unplaced",
     [](RunFacts& facts) {
       SetStates(facts, 0, 9, PoseState::kUnplaced, "");
       SetStates(facts, 20, 20, PoseState::kUnplaced, "");
     },
     Verdict::kLookAt,
     "frames 0-9, 20",
     "mean nothing"},
    {"MostUnplaced",
     [](RunFacts& facts) { SetStates(facts, 0, 60, PoseState::kUnplaced, ""); },
     Verdict::kDoNotUse,
     "frames 0-60",
     "mean nothing"},
    {"NoMap",
     [](RunFacts& facts) { SetStates(facts, 0, kNumChecked - 1, PoseState::kUnplaced, ""); },
     Verdict::kDoNotUse,
     "all frames",
     "there is no map"},
    {"Extrapolated",
     [](RunFacts& facts) { SetStates(facts, 90, 99, PoseState::kExtrapolated, ""); },
     Verdict::kLookAt,
     "frames 90-99",
     "does not reach"},
    {"Interpolated",
     [](RunFacts& facts) {
       SetStates(facts, 10, 12, PoseState::kInterpolated, "");
       SetStates(facts, 30, 33, PoseState::kInterpolated, "");
     },
     Verdict::kLookAt,
     "frames 30-33",
     "interpolated"},
    {"UntiedScale",
     [](RunFacts& facts) {
       facts.segments.push_back({50, 99, "translating", 1, "continuity", 0.0});
     },
     Verdict::kLookAt,
     "frames 50-99",
     "scale"},
    {"Breaks",
     [](RunFacts& facts) { facts.summary["counts"]["breaks"] = 2; },
     Verdict::kLookAt,
     "all frames",
     "3 pieces"},
    {"WeakTies",
     [](RunFacts& facts) { facts.summary["counts"]["weak_ties"] = 1; },
     Verdict::kLookAt,
     "all frames",
     "wrong by degrees"},
    {"NotCalibrated",
     [](RunFacts& facts) { facts.summary["calibration"]["source"] = "images"; },
     Verdict::kLookAt,
     "all frames",
     "the lens is estimated"},
    {"OtherFocalLength",
     [](RunFacts& facts) {
       facts.summary["lens_checks"]["focal"] = {
           {"contradicts", true}, {"by_images_px", 512.3}, {"calibrated_px", 560.0}};
     },
     Verdict::kLookAt,
     "all frames",
     "about 512 px, the calibration says 560 px"},
    {"Readout",
     [](RunFacts& facts) {
       facts.summary["readout"] = {{"source", "images"}, {"readout_s", 0.0213}};
     },
     Verdict::kLookAt,
     "all frames",
     "21.3 ms"},
    {"FewPoints",
     [](RunFacts& facts) { facts.summary["ba"]["observations"] = 1600; },
     Verdict::kLookAt,
     "all frames",
     "80 points"},
    {"FarTooFewPoints",
     [](RunFacts& facts) { facts.summary["ba"]["observations"] = 300; },
     Verdict::kDoNotUse,
     "all frames",
     "15 points"},
    {"StaticContent",
     [](RunFacts& facts) {
       facts.summary["masks"] = {{"static_content", "on_picture"}};
     },
     Verdict::kLookAt,
     "all frames",
     "do not move"},
    {"Fisheye",
     [](RunFacts& facts) {
       facts.summary["lens_checks"] = {{"is_fisheye", true}, {"zooms", 0}};
     },
     Verdict::kDoNotUse,
     "all frames",
     "fisheye"},
    {"Zoom",
     [](RunFacts& facts) {
       facts.summary["lens_checks"] = {
           {"is_fisheye", false},
           {"zooms", 1},
           {"zoom", {{"first_frame", 51}, {"last_frame", 69}, {"factor", 1.4}}}};
     },
     Verdict::kLookAt,
     "frames 51-69",
     "1.40 times"},
    {"FollowedZoom",
     [](RunFacts& facts) {
       facts.summary["lens_checks"] = {
           {"is_fisheye", false},
           {"zooms", 1},
           {"zooms_followed", true},
           {"zoom", {{"first_frame", 51}, {"last_frame", 69}, {"factor", 1.4}}}};
     },
     Verdict::kLookAt,
     "frames 51-69",
     "followed"},
    {"HeldToOdometry",
     [](RunFacts& facts) {
       SetStates(facts, 57, 60, PoseState::kHeld, "orientation held to the odometry: 3 deg");
     },
     Verdict::kLookAt,
     "frames 57-60",
     "disagree"},
    {"LeavesOdometry",
     [](RunFacts& facts) { facts.poses[40].note = "orientation leaves the odometry: by 3 deg"; },
     Verdict::kLookAt,
     "frames 40",
     "odometry"},
    {"Residuals",
     [](RunFacts& facts) { facts.summary["ba"]["mean_error_px"] = 1.5; },
     Verdict::kLookAt,
     "all frames",
     "1.5 px"},
    {"LoopsRefused",
     [](RunFacts& facts) {
       LoopRow refused;
       refused.frame = 80;
       refused.inliers = 200;
       facts.loops = {refused};
     },
     Verdict::kLookAt,
     "frames 80",
     "drift"}};

class CheckFactsOn : public testing::TestWithParam<Fault> {};

TEST_P(CheckFactsOn, GivesVerdictFramesAndReason) {
  RunFacts facts = GoodRun();
  GetParam().make(facts);
  const RunCheck check = CheckFacts(facts);
  EXPECT_EQ(check.verdict, GetParam().verdict);
  ASSERT_EQ(check.reasons.size(), 1U);
  EXPECT_EQ(check.reasons.front().frames, GetParam().frames);
  EXPECT_THAT(check.reasons.front().text, HasSubstr(GetParam().text));
}

INSTANTIATE_TEST_SUITE_P(Faults, CheckFactsOn, testing::ValuesIn(kFaults), [](const auto& fault) {
  return std::string(fault.param.name);
});

TEST(CheckFacts, IsGreenWhereNothingSpeaksAgainstARun) {
  const RunCheck check = CheckFacts(GoodRun());
  EXPECT_EQ(check.verdict, Verdict::kGreen);
  EXPECT_THAT(check.reasons, IsEmpty());
  EXPECT_EQ(Describe(check), "green: nothing speaks against this run");
}

TEST(CheckFacts, IsGreenForACameraThatOnlyRotates) {
  RunFacts facts = GoodRun();
  facts.summary.erase("ba");
  SetStates(facts, 0, kNumChecked - 1, PoseState::kHeld, "position of a pure rotation");
  facts.segments = {{0, kNumChecked - 1, "still", -1, "none", 1.0}};
  EXPECT_EQ(CheckFacts(facts).verdict, Verdict::kGreen);
}

TEST(CheckFacts, MeasuresErrorsInImagesThatWereWorkedWith) {
  RunFacts facts = GoodRun();
  facts.summary["ba"]["mean_error_px"] = 1.5;
  facts.summary["sequence"]["working_scale"] = 0.4;
  EXPECT_EQ(CheckFacts(facts).verdict, Verdict::kGreen);
}

TEST(CheckFacts, PutsTheWorstFirst) {
  RunFacts facts = GoodRun();
  facts.summary["counts"]["breaks"] = 1;
  facts.summary["ba"]["mean_error_px"] = 3.0;
  const RunCheck check = CheckFacts(facts);
  ASSERT_EQ(check.reasons.size(), 2U);
  EXPECT_EQ(check.reasons.front().verdict, Verdict::kDoNotUse);
  EXPECT_EQ(Describe(check), "do not use: 2 reasons");
}

}  // namespace
}  // namespace rotslam
