// Which frames an export has, and in which of its outputs.

#include "apps/cli/export/placed_frames.h"

#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/scene_map.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::ElementsAre;

constexpr const char* kHeader = "first_frame,last_frame,kind,component,scale,evidence\n";

// Frames 0, 10, ... 80.
RunMap Map() { return MapOfScene(ExportScene()); }

std::set<int> Numbers(const std::set<FrameId>& frames) {
  std::set<int> numbers;
  for (const FrameId frame : frames) numbers.insert(frame.value);
  return numbers;
}

TEST(PlacedFrames, AreAllOfThemWithoutATable) {
  const TemporaryFolder folder;
  const PlacedFrames placed = FindPlacedFrames(folder.path(), Map());
  ASSERT_EQ(placed.components.size(), 1u);
  EXPECT_EQ(placed.components[0].size(), 9u);
  EXPECT_TRUE(placed.unplaced.empty());
}

TEST(PlacedFrames, AreOneComponentPerScale) {
  const TemporaryFolder folder;
  folder.Write("segments.csv",
               std::string(kHeader) +
                   "0,20,translating,0,reference,0\n21,29,rotating,0,reference,1\n"
                   "30,45,translating,1,tracks,0\n46,55,unplaced,0,none,0\n"
                   "56,80,translating,2,continuity,0\n");
  const PlacedFrames placed = FindPlacedFrames(folder.path(), Map());
  ASSERT_EQ(placed.components.size(), 2u);
  EXPECT_THAT(Numbers(placed.components[0]), ElementsAre(0, 10, 20, 30, 40));
  EXPECT_THAT(Numbers(placed.components[1]), ElementsAre(60, 70, 80));
  EXPECT_THAT(Numbers(placed.unplaced), ElementsAre(50));
}

TEST(PlacedFrames, AreNoneThatMoveWithoutAMap) {
  const TemporaryFolder folder;
  folder.Write("segments.csv",
               std::string(kHeader) + "0,40,translating,-1,none,0\n41,80,rotating,-1,none,1\n");
  const PlacedFrames placed = FindPlacedFrames(folder.path(), Map());
  ASSERT_EQ(placed.components.size(), 1u);
  EXPECT_THAT(Numbers(placed.components[0]), ElementsAre(50, 60, 70, 80));
  EXPECT_THAT(Numbers(placed.unplaced), ElementsAre(0, 10, 20, 30, 40));
  EXPECT_THAT(Numbers(FramesAtRest(folder.path(), Map())), ElementsAre(50, 60, 70, 80));
}

// At the end of a pure rotation a frame shows what only the next component has points of.
TEST(PlacedFrames, AtRestBelongToThePointsThatTheySee) {
  const TemporaryFolder folder;
  folder.Write("segments.csv",
               std::string(kHeader) +
                   "0,20,translating,0,reference,0\n21,50,rotating,0,reference,1\n"
                   "51,80,translating,1,continuity,0\n");
  RunMap map = Map();
  std::erase_if(map.tracks, [](MapTrack& entry) {
    const auto is_in_first = [](const Observation& seen) { return seen.frame.value <= 40; };
    auto& seen = entry.track.observations;
    const bool is_of_first = entry.track.id.value % 2 == 0;
    for (std::size_t k = seen.size(); k-- > 0;) {
      if (is_in_first(seen[k]) == is_of_first) continue;
      seen.erase(seen.begin() + static_cast<std::ptrdiff_t>(k));
      entry.fits.erase(entry.fits.begin() + static_cast<std::ptrdiff_t>(k));
      entry.levels.erase(entry.levels.begin() + static_cast<std::ptrdiff_t>(k));
    }
    return seen.empty();
  });
  const PlacedFrames placed = FindPlacedFrames(folder.path(), map);
  ASSERT_EQ(placed.components.size(), 2u);
  EXPECT_THAT(Numbers(placed.components[0]), ElementsAre(0, 10, 20, 30, 40));
  EXPECT_THAT(Numbers(placed.components[1]), ElementsAre(50, 60, 70, 80));
}

TEST(PlacedFrames, AreToldInRanges) {
  EXPECT_EQ(DescribeFrames({FrameId{3}, FrameId{7}, FrameId{8}, FrameId{9}, FrameId{40}}),
            "3, 7-9, 40");
  std::set<FrameId> odd;
  for (int k = 0; k < 50; ++k) odd.insert(FrameId{2 * k + 1});
  EXPECT_EQ(DescribeFrames(odd), "1, 3, 5, 7, 9, 11, 13, 15, ...");
}

}  // namespace
}  // namespace rotslam
