#include "output/tables/segments.h"

#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

TEST(SegmentsCsv, ReadsWhatItHasWritten) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "segments.csv";
  WriteSegments(path, {{0, 41, "translating", 0, "reference", 0.0}, {42, 60, "still", -1, "none"}});
  const std::vector<Segment> read = ReadSegmentsCsv(path);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].first_frame, 0);
  EXPECT_EQ(read[0].last_frame, 41);
  EXPECT_EQ(read[0].kind, "translating");
  EXPECT_EQ(read[0].scale, "reference");
  EXPECT_EQ(read[1].component, -1);
  EXPECT_EQ(read[1].kind, "still");
}

}  // namespace
}  // namespace rotslam
