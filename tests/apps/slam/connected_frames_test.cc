#include "apps/slam/connected_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kFrames = 9;
constexpr int kTie = 5;  // its view has nothing in common with those before

void AddEdge(int i, int j, Orientations& orientations) {
  RelativeRotation edge;
  edge.i = FrameId{i};
  edge.j = FrameId{j};
  orientations.graph.AddEdge(edge);
}

// Each frame has edges to the two before it; kTie to one alone, those behind it to none before it.
Orientations TwoViews() {
  Orientations orientations;
  orientations.reports.resize(kFrames);
  for (int k = 0; k < kFrames; ++k) {
    orientations.cam_from_world[FrameId{k}] = Rotation();
    for (const int before : {k - 2, k - 1}) {
      if (before >= 0 && (k < kTie || before >= kTie)) AddEdge(before, k, orientations);
    }
  }
  AddEdge(kTie - 1, kTie, orientations);
  orientations.reports[kTie].weak = orientations.reports[kTie].searched_wide = true;
  return orientations;
}

TEST(FindWeakTies, NamesTheFirstFrameBehindAFewMatchesFoundAnywhere) {
  const Orientations views = TwoViews();
  EXPECT_THAT(FindWeakTies(views), ElementsAre(FrameId{kTie}));
  EXPECT_THAT(FindBreaks(views.graph, views.cam_from_world), IsEmpty());
}

TEST(FindWeakTies, HasNoneWhereOtherFramesOrALoopTieThePieces) {
  Orientations by_next_frame = TwoViews();
  AddEdge(kTie - 1, kTie + 1, by_next_frame);
  EXPECT_THAT(FindWeakTies(by_next_frame), IsEmpty());
  Orientations by_loop = TwoViews();
  AddEdge(0, kTie, by_loop);
  EXPECT_THAT(FindWeakTies(by_loop), IsEmpty());
}

TEST(FindWeakTies, TakesTrackedPointsForSureHoweverFew) {
  Orientations views = TwoViews();
  views.reports[kTie].searched_wide = false;
  EXPECT_THAT(FindWeakTies(views), IsEmpty());
}

TEST(FindWeakTies, ABreakIsNone) {
  Orientations views = TwoViews();
  views.graph = {};
  AddEdge(0, 1, views);
  AddEdge(kTie, kTie + 1, views);
  EXPECT_THAT(FindBreaks(views.graph, views.cam_from_world), ElementsAre(FrameId{kTie}));
  EXPECT_THAT(FindWeakTies(views), IsEmpty());
}

}  // namespace
}  // namespace rotslam
