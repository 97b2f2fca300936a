// `rotslam vocabulary`: trains, converts, tells, and refuses in one line.

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

class VocabularyCommand : public SmallSequenceTest {
 protected:
  std::string File(const std::string& name) const { return (folder_.path() / name).string(); }

  CommandResult Train(const std::string& out, const std::vector<std::string>& more = {}) const {
    return Rotslam({"vocabulary", "train", Good().string(), "--max-features=300", "--out", out},
                   more);
  }

  std::string RefusalOf(const std::vector<std::string>& arguments) const {
    return Refusal(Rotslam({"vocabulary"}, arguments));
  }
};

TEST_F(VocabularyCommand, TrainsTellsAndConverts) {
  const CommandResult trained = Train(File("a.rotvoc"), {"--depth=3", "--branching=8"});
  ASSERT_EQ(trained.exit_code, 0) << trained.error;
  EXPECT_THAT(trained.output,
              AllOf(StartsWith("wrote " + File("a.rotvoc")),
                    HasSubstr(" words from 24 images, "),
                    EndsWith(" s\n")));
  EXPECT_THAT(trained.error, AllOf(HasSubstr("features"), HasSubstr("clustering")));

  const CommandResult told = Rotslam({"vocabulary", "info", File("a.rotvoc")});
  EXPECT_EQ(told.exit_code, 0);
  EXPECT_THAT(told.output,
              AllOf(HasSubstr("branching  8\ndepth      3\n"),
                    HasSubstr("weighting  TF_IDF\nscoring    L1_NORM\n"),
                    HasSubstr("bytes      " +
                              std::to_string(std::filesystem::file_size(File("a.rotvoc"))))));

  for (const auto& [in, out] : {std::pair("a.rotvoc", "b.txt"), {"b.txt", "c.rotvoc"}}) {
    const CommandResult converted =
        Rotslam({"vocabulary", "convert", File(in), "--out", File(out)});
    ASSERT_EQ(converted.exit_code, 0) << converted.error;
  }
  EXPECT_EQ(ReadWholeFile(File("c.rotvoc")), ReadWholeFile(File("a.rotvoc")));
  EXPECT_THAT(ReadWholeFile(File("b.txt")), StartsWith("8 3 0 0\n0 "));
}

TEST_F(VocabularyCommand, WritesTheSameBytesWithAnyNumberOfThreads) {
  ASSERT_EQ(Train(File("one"), {"--threads=1", "--quiet"}).exit_code, 0);
  const CommandResult quiet = Train(File("three"), {"--threads=3", "--quiet"});
  EXPECT_EQ(quiet.output + quiet.error, "");
  EXPECT_EQ(ReadWholeFile(File("one")), ReadWholeFile(File("three")));
  ASSERT_EQ(Train(File("seed"), {"--seed=2", "--quiet"}).exit_code, 0);
  EXPECT_NE(ReadWholeFile(File("one")), ReadWholeFile(File("seed")));
}

TEST_F(VocabularyCommand, BringsOne) {
  const CommandResult told = Rotslam({"vocabulary", "info"});
  EXPECT_EQ(told.exit_code, 0);
  EXPECT_THAT(told.output, AllOf(HasSubstr("branching  10\ndepth      5\n"), HasSubstr("TF_IDF")));
}

TEST_F(VocabularyCommand, RefusesInOneLine) {
  const std::string image = Images(Good()).front().string();
  const std::string out = File("out.rotvoc");
  EXPECT_THAT(RefusalOf({"info", File("none")}), HasSubstr("no such file"));
  EXPECT_THAT(RefusalOf({"info", image}), AllOf(HasSubstr(image), HasSubstr("is an image")));
  EXPECT_THAT(RefusalOf({"convert", image, "--out", out}), HasSubstr("is an image"));
  EXPECT_THAT(RefusalOf({"train", image, "--out", out}), HasSubstr("name at least two"));
  EXPECT_THAT(RefusalOf({"train", image, File("none.png"), "--out", out, "--quiet"}),
              AllOf(HasSubstr("none.png"), HasSubstr("cannot be opened; name images")));
  EXPECT_THAT(RefusalOf({"train", Good().string(), "--out", File("no/folder")}),
              HasSubstr("its folder does not exist"));
  EXPECT_THAT(RefusalOf({"train", Good().string(), "--out", out, "--depth", "0"}),
              HasSubstr("depth is 0, must be 1 to 20"));
  EXPECT_THAT(RefusalOf({"train", Good().string(), "--out", out, "--config", image}),
              HasSubstr("not from --config"));
  EXPECT_THAT(RefusalOf({"train", Good().string()}), HasSubstr("--out"));
  EXPECT_THAT(RefusalOf({}), HasSubstr("see rotslam vocabulary --help"));
}

}  // namespace
}  // namespace rotslam
