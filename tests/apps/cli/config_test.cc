#include "apps/cli/input/config.h"

#include <algorithm>
#include <span>
#include <variant>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

struct MatchingOptions {
  double max_distance_px = 30.0;
  bool use_mutual = true;
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_distance_px", max_distance_px);
    visit("use_mutual", use_mutual);
  }
};

enum class Engine { kClp, kGlpk, kOwn };
std::span<const char* const> OptionWords(Engine) {
  static constexpr const char* kWords[] = {"clp", "glpk", "own"};
  return kWords;
}

struct AllOptions {
  int max_features = 2000;
  std::uint64_t seed = 1;
  std::string name = "run";
  Engine engine = Engine::kClp;
  MatchingOptions relocalisation;
  MatchingOptions matching;

  std::optional<std::string> Problem() const {
    if (max_features < 1) return "max_features = " + std::to_string(max_features) + ", must be > 0";
    return std::nullopt;
  }
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("max_features", max_features);
    visit("seed", seed);
    visit("name", name);
    visit("engine", engine);
    visit("relocalisation", relocalisation);
    visit("matching", matching);
  }
};

AllOptions Load(const std::string& yaml) {
  const TemporaryFolder folder;
  AllOptions options;
  LoadOptionsYaml(folder.Write("o.yaml", yaml), options);
  return options;
}

std::string ErrorOf(const std::string& yaml) {
  return RuntimeErrorOf([&] { Load(yaml); });
}

TEST(LoadOptionsYaml, OverridesWhatItNamesAndNothingElse) {
  const AllOptions options = Load(
      "max_features: 500\nseed: 18446744073709551615\nmatching:\n  max_distance_px: 1e1\n"
      "  use_mutual: no\n");
  EXPECT_EQ(options.max_features, 500);
  EXPECT_EQ(options.seed, 18446744073709551615u);
  EXPECT_EQ(options.engine, Engine::kClp);
  EXPECT_EQ(options.matching.max_distance_px, 10.0);
  EXPECT_FALSE(options.matching.use_mutual);
}

TEST(LoadOptionsYaml, TakesEmptyFilesAndEmptyGroups) {
  EXPECT_EQ(Load("").max_features, 2000);
  EXPECT_EQ(Load("# only a comment\n").max_features, 2000);
  EXPECT_EQ(Load("matching:\n").matching.max_distance_px, 30.0);
}

TEST(LoadOptionsYaml, NamesTheNearestKnownKey) {
  EXPECT_THAT(ErrorOf("seed: 2\nmatching:\n  max_distanc_px: 3\n"),
              testing::AllOf(HasSubstr("o.yaml:3: "),
                             HasSubstr("\"matching.max_distanc_px\""),
                             HasSubstr("nearest one is \"matching.max_distance_px\"")));
  EXPECT_THAT(ErrorOf("max_distance_px: 3\n"),
              HasSubstr("nearest one is \"matching.max_distance_px\""));
  EXPECT_THAT(ErrorOf("maching: {use_mutual: yes}\n"), HasSubstr("nearest one is \"matching\""));
  // As near as the first group's option of that name: the more similar group decides.
  EXPECT_THAT(ErrorOf("matchin.use_mutual: no\n"),
              HasSubstr("nearest one is \"matching.use_mutual\""));
}

TEST(LoadOptionsYaml, SaysWhatBecameOfFormerOptions) {
  EXPECT_THAT(ErrorOf("matching:\nkrot: {loose_factor: 3}\n"),
              HasSubstr("option is called \"krot\""));
  EXPECT_EQ(UnknownOption("krot.loose_factor", {}),
            "\"krot.loose_factor\" is fixed now; rotslam run --print-config lists the options");
  for (const char* key : {"ba.bridge", "ba.bridge.loss", "options.ba.bridge.loss", "bridge.loss"}) {
    EXPECT_THAT(UnknownOption(key, {}), HasSubstr("\" is fixed now")) << key;
  }
  EXPECT_EQ(UnknownOption("options.completion", {}),
            "\"options.completion\" is called \"track_completion\" now");
  EXPECT_THAT(UnknownOption("ba.bend", {}), HasSubstr("no option is called"));
}

TEST(LoadOptionsYaml, NamesKeyValueAndType) {
  EXPECT_THAT(ErrorOf("max_features: many\n"),
              HasSubstr("o.yaml:1: \"max_features\" expects a whole number, found \"many\""));
  EXPECT_THAT(ErrorOf("max_features: 1.5\n"), HasSubstr("found \"1.5\""));
  EXPECT_THAT(ErrorOf("max_features: 99999999999\n"), HasSubstr("whole number"));
  EXPECT_THAT(ErrorOf("seed: -1\n"), HasSubstr("a whole number from 0, found \"-1\""));
  EXPECT_THAT(ErrorOf("matching: {use_mutual: 3}\n"), HasSubstr("expects true or false"));
  EXPECT_THAT(ErrorOf("matching: {max_distance_px: .nan}\n"), HasSubstr("expects a number"));
  EXPECT_THAT(ErrorOf("matching: {max_distance_px: [1]}\n"), HasSubstr("found a list"));
  EXPECT_THAT(ErrorOf("name:\n"), HasSubstr("expects text, found nothing"));
  EXPECT_THAT(ErrorOf("matching: 3\n"), HasSubstr("is a group of options"));
}

TEST(LoadOptionsYaml, ReadsWordsOfEnums) {
  EXPECT_EQ(Load("engine: own\n").engine, Engine::kOwn);
  EXPECT_THAT(ErrorOf("engine: cplex\n"),
              HasSubstr("o.yaml:1: \"engine\" expects clp, glpk or own, found \"cplex\""));
  EXPECT_THAT(ErrorOf("engine: [own]\n"), HasSubstr("found a list"));
  AllOptions options;
  options.engine = Engine::kGlpk;
  const std::vector<OptionEntry> entries = DescribeOptions(options);
  const auto engine = std::find_if(
      entries.begin(), entries.end(), [](const auto& entry) { return entry.key == "engine"; });
  ASSERT_NE(engine, entries.end());
  EXPECT_EQ(std::get<std::string>(engine->value), "glpk");
}

TEST(LoadOptionsYaml, RefusesWhatIsNoMapAndKeysTwice) {
  EXPECT_THAT(ErrorOf("- 1\n- 2\n"), HasSubstr("o.yaml:1: expected options"));
  EXPECT_THAT(ErrorOf("seed: 1\nseed: 2\n"), HasSubstr("o.yaml:2: \"seed\" stands here twice"));
  EXPECT_THAT(ErrorOf("a: [1\n"), HasSubstr("not YAML"));
  AllOptions options;
  EXPECT_THAT(RuntimeErrorOf([&] { LoadOptionsYaml("nowhere.yaml", options); }),
              HasSubstr("nowhere.yaml: cannot read"));
}

TEST(LoadOptionsYaml, AsksTheOptionsThemselves) {
  EXPECT_THAT(ErrorOf("max_features: 0\n"), HasSubstr("o.yaml: max_features = 0, must be > 0"));
}

}  // namespace
}  // namespace rotslam
