#include "rotodom/camera/camera_document.h"

#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(CameraDocument, ReadsYamlAsOpenCvDoes) {
  const TemporaryFolder folder;
  const CameraDocument document(folder.Write(
      "a.yaml",
      "%YAML:1.0\na:1\nm:!!opencv-matrix\n\trows:1\n\tcols:2\n\tdata:[1,\n2]\ntime: 12:30:05\n"));
  const Section root = document.root();
  EXPECT_EQ(root.Number("a"), 1.0);
  EXPECT_EQ(root.Line("a"), 2);
  EXPECT_THAT(root.Numbers("m"), ElementsAre(1.0, 2.0));
  EXPECT_EQ(root.Map("m").Line("data"), 6);
  EXPECT_EQ(root.Text("time"), "12:30:05");
}

TEST(CameraDocument, TellsYamlInBracesFromJson) {
  const TemporaryFolder folder;
  const CameraDocument document(folder.Write("a.yaml", "{ fx: 500,\n  data: [1, 2]}\n"));
  EXPECT_EQ(document.root().Number("fx"), 500.0);
  EXPECT_THAT(document.root().Numbers("data"), ElementsAre(1.0, 2.0));
  const CameraDocument cut(folder.Write("b.json", "{\n \"fx\": 500,"));
  EXPECT_THAT(cut.parse_problem(), HasSubstr("JSON"));
}

TEST(CameraDocument, KnowsTheLinesOfJson) {
  const TemporaryFolder folder;
  const CameraDocument document(
      folder.Write("a.json", "{\n\"a\": 1,\n\"b\": [1,\n2,\n3\n],\n\"c\": {\"d\":\ntrue}\n}"));
  const Section root = document.root();
  EXPECT_EQ(root.Line("a"), 2);
  EXPECT_EQ(root.Line("b"), 3);
  EXPECT_EQ(root.node().children[1].children[0].line, 3);
  EXPECT_EQ(root.node().children[1].children[1].line, 4);
  EXPECT_EQ(root.node().children[1].children[2].line, 5);
  EXPECT_EQ(root.Line("c"), 7);
  EXPECT_TRUE(root.Map("c").Flag("d"));
}

TEST(CameraDocument, LeavesOutWhatMayBeHuge) {
  const TemporaryFolder folder;
  const CameraDocument document(folder.Write(
      "a.json", "{\"structure\": [{\"key\": [1, 2]}], \"b\": {\"structure\": 3}, \"views\": 4}"));
  EXPECT_FALSE(document.root().Has("structure"));
  EXPECT_EQ(document.root().Map("b").Number("structure"), 3.0);
  EXPECT_EQ(document.root().Number("views"), 4.0);
}

TEST(CameraDocument, SaysWhereATextCannotBeParsed) {
  const TemporaryFolder folder;
  const auto problem = [&](const std::string& text) {
    return CameraDocument(folder.Write("a.txt", text)).parse_problem();
  };
  EXPECT_THAT(problem("a: 1\nb: [1\nc: 2\n"), HasSubstr("a.txt:"));
  EXPECT_THAT(problem("{\"a\": 1,\n\"b\" 2}"), HasSubstr("a.txt:2: is not JSON"));
  EXPECT_THAT(problem("<a>\n<b>\n</a>"), HasSubstr("is not XML"));
  EXPECT_THAT(problem(std::string(5000, '[')), HasSubstr("a.txt:1"));
  EXPECT_THAT(problem("{\"a\":" + std::string(5000, '[')), HasSubstr("nested too deeply"));
  EXPECT_THAT(problem("a: &x [1]\nb: *x\n"), HasSubstr("a.txt:2: is not YAML: an alias"));
  EXPECT_EQ(problem("a: &x 1\nb: *x\n"), "");
  EXPECT_EQ(problem("P0 400 0 1\n"), "");
}

TEST(CameraDocument, CutsLinesIntoWords) {
  const TemporaryFolder folder;
  const CameraDocument document(
      folder.Write("a.txt", "\xef\xbb\xbf# comment\r\n\r\n1,5 2\t3 \r\n  4\r\n"));
  ASSERT_EQ(document.rows().size(), 2U);
  EXPECT_EQ(document.rows()[0].line, 3);
  EXPECT_THAT(document.rows()[0].words, ElementsAre("1,5", "2", "3"));
  EXPECT_THAT(document.rows()[1].words, ElementsAre("4"));
}

}  // namespace
}  // namespace rotslam
