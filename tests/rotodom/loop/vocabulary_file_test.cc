#include "rotodom/loop/vocabulary_file.h"

#include <functional>
#include <random>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"
#include "tests/rotodom/loop/random_vocabulary.h"

namespace rotslam {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::string Bytes(int value) {
  std::string text;
  for (int k = 0; k < 32; ++k) text += std::to_string(value) + ' ';
  return text;
}

// As ORB-SLAM2 writes it: nodes depth first, a blank behind the descriptor, weights of six digits.
std::string Example() {
  return "2 2  0 0\n0 0 " + Bytes(0) + " 0\n0 0 " + Bytes(255) + " 0\n1 1 " + Bytes(1) +
         " 6.29187\n1 1 " + Bytes(3) + " 0.5\n2 1 " + Bytes(254) + " 2\n2 1 " + Bytes(127) +
         " 1e-05\n";
}

class VocabularyFile : public testing::Test {
 protected:
  Vocabulary Read(const std::string& content) const {
    return ReadVocabulary(folder_.Write("voc", content));
  }

  // The reader's one line; the file is called `voc`.
  std::string Refusal(const std::string& content) const {
    const std::string message = RuntimeErrorOf([&] { Read(content); });
    EXPECT_THAT(message, StartsWith((folder_.path() / "voc").string() + ":"));
    EXPECT_THAT(message, Not(HasSubstr("\n")));
    return message;
  }

  TemporaryFolder folder_;
};

void ExpectEqual(const VocabularyTree& a, const VocabularyTree& b) {
  EXPECT_EQ(a.branching, b.branching);
  EXPECT_EQ(a.depth, b.depth);
  EXPECT_EQ(a.weighting, b.weighting);
  EXPECT_EQ(a.num_children, b.num_children);
  EXPECT_EQ(a.descriptors, b.descriptors);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.ids, b.ids);
}

TEST_F(VocabularyFile, ReadsOrbSlamText) {
  const Vocabulary vocabulary = Read(Example());
  EXPECT_EQ(vocabulary.tree().branching, 2);
  EXPECT_EQ(vocabulary.tree().depth, 2);
  EXPECT_EQ(vocabulary.tree().weighting, Weighting::kTfIdf);
  ASSERT_EQ(vocabulary.num_words(), 4);
  EXPECT_EQ(vocabulary.WeightOf(0), 6.29187F);
  EXPECT_EQ(vocabulary.WeightOf(3), 1e-05F);
  EXPECT_EQ(vocabulary.WordOf({0x0303030303030303U, 0x0303030303030303U, 0x0303030303030303U, 0}),
            1U);
  EXPECT_EQ(vocabulary.WordOf({~0U, ~std::uint64_t{0}, ~std::uint64_t{0}, ~std::uint64_t{0}}), 2U);
}

TEST_F(VocabularyFile, ReadsOtherLineEndsAndBlankLinesAtTheEnd) {
  const std::string windows = std::regex_replace(Example(), std::regex("\n"), "\r\n");
  ExpectEqual(Read(windows + "\r\n").tree(), Read(Example()).tree());
  ExpectEqual(Read(Example() + "\n \n").tree(), Read(Example()).tree());
}

// The order of lines is the words' order, also where it is not level by level.
TEST_F(VocabularyFile, KeepsTheNumbersOfTheFile) {
  const std::string depth_first = "2 3 0 1\n0 0 " + Bytes(0) + "0\n0 1 " + Bytes(255) + "1\n1 0 " +
                                  Bytes(1) + "0\n3 1 " + Bytes(1) + "3\n1 1 " + Bytes(7) + "4\n";
  const Vocabulary vocabulary = Read(depth_first);
  EXPECT_EQ(vocabulary.tree().weighting, Weighting::kTf);
  EXPECT_EQ(vocabulary.WeightOf(0), 1.0F);
  EXPECT_EQ(vocabulary.WeightOf(1), 3.0F);
  EXPECT_EQ(vocabulary.WeightOf(2), 4.0F);
  EXPECT_EQ(EncodeText(vocabulary), depth_first);
  EXPECT_THAT(vocabulary.tree().ids, testing::ElementsAre(0, 1, 2, 3, 5, 4));
}

TEST_F(VocabularyFile, GoesFromTextToBinaryAndBack) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    VocabularyTree tree = RandomTree(5, 4, seed);
    tree.weighting = static_cast<Weighting>(seed);
    for (float& weight : tree.weights) weight *= 1.2345678F;
    if (seed > 1) NumberDepthFirst(tree);
    const Vocabulary vocabulary(tree);
    const std::string binary = EncodeBinary(vocabulary);
    const std::string text = EncodeText(vocabulary);
    ExpectEqual(Read(binary).tree(), vocabulary.tree());
    ExpectEqual(Read(text).tree(), vocabulary.tree());
    EXPECT_EQ(EncodeBinary(Read(text)), binary);
    EXPECT_EQ(EncodeText(Read(binary)), text);
    EXPECT_LT(binary.size(), text.size() / 2);
  }
}

// ---- what is no vocabulary

TEST_F(VocabularyFile, RefusesForeignFiles) {
  EXPECT_THAT(Refusal(""), HasSubstr("is empty"));
  EXPECT_THAT(Refusal("\x89PNG\r\n\x1A\n"), HasSubstr("is an image"));
  EXPECT_THAT(Refusal("\xFF\xD8\xFF\xE0"), HasSubstr("is an image"));
  EXPECT_THAT(Refusal("\x1F\x8B\x08"), AllOf(HasSubstr("gzip"), HasSubstr("unpack")));
  EXPECT_THAT(Refusal("BZh91AY"), HasSubstr("archive"));
  EXPECT_THAT(Refusal("ORBvoc.txt" + std::string(247, '\0') + "ustar  "), HasSubstr("tar archive"));
  EXPECT_THAT(Refusal("%YAML:1.0\n---\nvocabulary:\n"), HasSubstr("YAML"));
  EXPECT_THAT(Refusal(std::string("\x81\x3F\x86\xB1\x14\0\0\0\0", 9)), HasSubstr("DBoW3"));
  EXPECT_THAT(Refusal("A walk in the park\n"),
              AllOf(HasSubstr("no vocabulary"), HasSubstr("ORBvoc.txt")));
  EXPECT_THAT(Refusal(std::string(1000, '\0')), HasSubstr("no vocabulary"));
  EXPECT_THAT(Refusal("\n\n\n"), HasSubstr("no vocabulary"));
}

TEST_F(VocabularyFile, RefusesWhatIsNoFile) {
  EXPECT_THAT(RuntimeErrorOf([&] { ReadVocabulary(folder_.path() / "none"); }),
              HasSubstr("no such file"));
  EXPECT_THAT(RuntimeErrorOf([&] { ReadVocabulary(folder_.path()); }), HasSubstr("is not a file"));
  EXPECT_THAT(RuntimeErrorOf([&] { ReadVocabulary("/dev/zero"); }), HasSubstr("is not a file"));
}

TEST_F(VocabularyFile, RefusesHeaders) {
  EXPECT_THAT(Refusal("1 2 0 0\n"), HasSubstr("voc:1: the branching (k) is 1"));
  EXPECT_THAT(Refusal("999999999999999 2 0 0\n"), HasSubstr("voc:1: expected the branching"));
  EXPECT_THAT(Refusal("10 -6 0 0\n"), HasSubstr("the depth (L) is -6"));
  EXPECT_THAT(Refusal("10 6 6 0\n"), HasSubstr("no scoring 6"));
  EXPECT_THAT(Refusal("10 6 2 0\n"), AllOf(HasSubstr("CHI_SQUARE"), HasSubstr("only L1_NORM")));
  EXPECT_THAT(Refusal("10 6 0 4\n"), HasSubstr("no weighting 4"));
  EXPECT_THAT(Refusal("10 6 0\n"), HasSubstr("ends before the weighting"));
  EXPECT_THAT(Refusal("10 6 0 0 0\n"), HasSubstr("goes on"));
  EXPECT_THAT(Refusal("10 6 0 0\n"), HasSubstr("no nodes"));
}

TEST_F(VocabularyFile, RefusesNodes) {
  // Line 5 of the example with other words in place of "1 1 ... 0.5".
  const auto with_line_5 = [&](const std::string& line) {
    std::istringstream lines(Example());
    std::string text;
    std::string old;
    for (int number = 1; std::getline(lines, old); ++number) {
      text += (number == 5 ? line : old) + "\n";
    }
    const std::string message = Refusal(text);
    EXPECT_THAT(message, HasSubstr("voc:5: "));
    return message;
  };
  EXPECT_THAT(with_line_5("1 1 " + Bytes(3) + "nan"), HasSubstr("weight"));
  EXPECT_THAT(with_line_5("1 1 " + Bytes(3) + "-0.5"), HasSubstr("weight"));
  EXPECT_THAT(with_line_5("1 1 " + Bytes(3) + "inf"), HasSubstr("weight"));
  EXPECT_THAT(with_line_5("1 1 " + Bytes(3) + "1e99"), HasSubstr("weight"));
  EXPECT_THAT(with_line_5("1 1 " + Bytes(3)), HasSubstr("ends before the weight"));
  EXPECT_THAT(with_line_5("1 1 " + Bytes(256) + "1"), HasSubstr("byte"));
  EXPECT_THAT(with_line_5("1 1 " + Bytes(3) + "1 1"), HasSubstr("goes on"));
  EXPECT_THAT(with_line_5("4 1 " + Bytes(3) + "1"), HasSubstr("an earlier node"));
  EXPECT_THAT(with_line_5("-1 1 " + Bytes(3) + "1"), HasSubstr("an earlier node"));
  EXPECT_THAT(with_line_5("3 1 " + Bytes(3) + "1"), HasSubstr("node 3 is a word"));
  EXPECT_THAT(with_line_5("0 1 " + Bytes(3) + "1"), HasSubstr("more children"));
  EXPECT_THAT(with_line_5("1 2 " + Bytes(3) + "1"), HasSubstr("0 or 1"));
  EXPECT_THAT(with_line_5("1 0 " + Bytes(3) + "1"), HasSubstr("neither children nor a word"));
  EXPECT_THAT(with_line_5(""), HasSubstr("empty"));
  EXPECT_THAT(with_line_5("walk"), HasSubstr("found \"walk\""));
}

TEST_F(VocabularyFile, RefusesTreesThatTheirHeaderDoesNotAllow) {
  EXPECT_THAT(Refusal("2 1" + Example().substr(3)), HasSubstr("deeper than the header says (1)"));
  const std::string wider =
      "2 2 0 0\n0 1 " + Bytes(0) + "1\n0 1 " + Bytes(1) + "1\n0 1 " + Bytes(2) + "1\n";
  EXPECT_THAT(Refusal(wider), HasSubstr("more children than the header allows (2)"));
  EXPECT_EQ(Read("9 9" + Example().substr(3)).num_words(), 4);
}

// ---- damage

TEST_F(VocabularyFile, SurvivesTruncation) {
  VocabularyTree tree = RandomTree(8, 4, 5);
  NumberDepthFirst(tree);
  const Vocabulary vocabulary(tree);
  const std::string text = EncodeText(vocabulary);
  for (std::size_t size = 1; size < text.size(); size += 997) {
    Refusal(text.substr(0, size));
  }
  const std::string binary = EncodeBinary(vocabulary);
  ASSERT_GT(binary.size(), 20000U);
  for (std::size_t size = 1; size < binary.size(); size += size < 100 ? 1 : 997) {
    Refusal(binary.substr(0, size));
  }
  Refusal(binary + "x");
}

TEST_F(VocabularyFile, SurvivesTurnedBits) {
  std::mt19937_64 random(1);
  const Vocabulary vocabulary(RandomTree(6, 3, 9));
  const std::string text = EncodeText(vocabulary);
  const std::string binary = EncodeBinary(vocabulary);
  const auto damaged = [&](std::string bytes, std::size_t reach) {
    bytes[random() % reach] ^= static_cast<char>(1 << random() % 8);
    return bytes;
  };
  int num_refused = 0;
  for (int k = 0; k < 300; ++k) {
    // A digit may have become another one, which nothing can tell.
    try {
      Read(damaged(text, text.size()));
    } catch (const std::runtime_error&) {
      ++num_refused;
    }
    Refusal(damaged(binary, binary.size()));
    Refusal(damaged(binary, 48));
  }
  EXPECT_GT(num_refused, 100);
}

}  // namespace
}  // namespace rotslam
