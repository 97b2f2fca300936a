#include "output/tables/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

struct InnerOptions {
  double distance = 0.25;
  std::uint64_t seed = 18446744073709551615u;
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("distance", distance);
    visit("seed", seed);
  }
};

struct OuterOptions {
  bool use_loops = true;
  InnerOptions inner;
  int count = -4;
  std::string name = "orb";
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("use_loops", use_loops);
    visit("inner", inner);
    visit("count", count);
    visit("name", name);
  }
};

TEST(DescribeOptions, GoesThroughNestedStructsInOrder) {
  std::vector<std::string> keys;
  for (const OptionEntry& entry : DescribeOptions(OuterOptions{})) keys.push_back(entry.key);
  EXPECT_THAT(keys,
              testing::ElementsAre("use_loops", "inner.distance", "inner.seed", "count", "name"));
}

TEST(Summary, NestsOptionsAndKeepsTypes) {
  RunSummary summary;
  summary.options = DescribeOptions(OuterOptions{});
  const auto json = nlohmann::json::parse(SummaryJson(summary));
  EXPECT_EQ(json.at("options"),
            nlohmann::json::parse(R"({"use_loops": true, "count": -4, "name": "orb",
                "inner": {"distance": 0.25, "seed": 18446744073709551615}})"));
}

TEST(Summary, HoldsTheDocumentedKeys) {
  const TemporaryFolder folder;
  RunSummary summary;
  summary.command = "run";
  summary.sequence = {{"path", std::string("images")}, {"frames", std::int64_t{200}}};
  summary.camera = Camera{};
  summary.counts = {{"keyframes", std::int64_t{20}}};
  summary.seconds = {{"features", 1.5}, {"total", 2.5}};
  summary.rotodom = SummaryTable{{"edges", std::int64_t{3}}};
  summary.krot = SummaryKrot{};
  summary.krot->status = "converged";
  summary.krot->more = {{"rounds", std::int64_t{2}}};
  summary.ba = SummaryTable{{"error_px.rms", 0.5}, {"error_px.median", 0.25}};
  summary.segments = {{0, 10, "rotating", 0, "reference", 0.9}};
  summary.loops = SummaryTable{{"accepted", std::int64_t{1}}};
  WriteSummary(folder.path() / "summary.json", summary);
  const auto json = nlohmann::ordered_json::parse(ReadWholeFile(folder.path() / "summary.json"));
  std::vector<std::string> keys;
  for (const auto& entry : json.items()) keys.push_back(entry.key());
  EXPECT_THAT(keys,
              testing::ElementsAre("version",
                                   "command",
                                   "options",
                                   "sequence",
                                   "camera",
                                   "counts",
                                   "seconds",
                                   "rotodom",
                                   "krot",
                                   "ba",
                                   "segments",
                                   "loops"));
  EXPECT_EQ(json["krot"]["status"], "converged");
  EXPECT_TRUE(json["krot"]["gamma_high"].is_null());  // infinity: nothing was proved
  EXPECT_EQ(json["krot"]["rounds"], 2);
  EXPECT_EQ(json["ba"]["error_px"]["median"], 0.25);
  EXPECT_EQ(json["segments"][0]["kind"], "rotating");
  EXPECT_EQ(json["version"], Version());
}

TEST(Summary, TellsOfARollingShutter) {
  RunSummary summary;
  summary.camera = Camera{};
  EXPECT_FALSE(nlohmann::json::parse(SummaryJson(summary))["camera"].contains("readout_s"));
  summary.camera->readout_s = 0.018;
  EXPECT_EQ(nlohmann::json::parse(SummaryJson(summary))["camera"]["readout_s"], 0.018);
  EXPECT_EQ(nlohmann::json::parse(SummaryJson(summary))["camera"]["readout_from"], "top");
}

TEST(Summary, TellsTheDistortionOfEveryModel) {
  RunSummary summary;
  summary.camera = Camera{};
  const auto distortion = [&](CameraModel model) {
    summary.camera->model = model;
    return nlohmann::json::parse(SummaryJson(summary))["camera"]["distortion"].size();
  };
  EXPECT_EQ(distortion(CameraModel::kPinhole), 0u);
  EXPECT_EQ(distortion(CameraModel::kRadtan), 5u);
  EXPECT_EQ(distortion(CameraModel::kEquidistant), 5u);
  EXPECT_EQ(distortion(CameraModel::kRational), 8u);
  EXPECT_EQ(distortion(CameraModel::kFov), 1u);
}

TEST(Summary, LeavesOutWhatDidNotRun) {
  const auto json = nlohmann::json::parse(SummaryJson({}));
  for (const char* key : {"krot", "ba", "segments", "loops", "camera"}) {
    EXPECT_FALSE(json.contains(key)) << key;
  }
}

TEST(Summary, SurvivesPathsThatAreNotUtf8) {
  RunSummary summary;
  summary.sequence = {{"path", std::string("caf\xe9")}};
  EXPECT_THAT(SummaryJson(summary), testing::HasSubstr("caf"));
}

}  // namespace
}  // namespace rotslam
