#include "apps/cli/run_directory/map_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

using testing::ElementsAre;

// Two components, what nothing places before and between them, and a pure rotation in the second.
MapResult TwoComponents() {
  MapResult result;
  const auto add = [&](int first, int last, PoseState state, int component) {
    for (int n = first; n <= last; ++n) {
      result.cam_from_world[FrameId{n}] = Rotation();
      result.frame_poses[FrameId{n}] = {state, component, {}, ""};
    }
  };
  add(0, 9, PoseState::kUnplaced, -1);
  add(10, 19, PoseState::kMeasured, 0);
  add(20, 24, PoseState::kUnplaced, -1);
  add(25, 29, PoseState::kMeasured, 1);
  add(30, 39, PoseState::kHeld, 1);
  result.components = {{{FrameId{10}, FrameId{19}}}, {{FrameId{25}, FrameId{30}}, true}};
  result.segments.push_back({FrameId{30}, FrameId{39}, 1.0});
  return result;
}

TEST(SegmentsOf, SaysWhatNothingPlaces) {
  const std::vector<Segment> segments = SegmentsOf(TwoComponents());
  std::vector<std::string> lines;
  for (const Segment& segment : segments) {
    lines.push_back(std::to_string(segment.first_frame) + "-" + std::to_string(segment.last_frame) +
                    " " + segment.kind + " " + std::to_string(segment.component) + " " +
                    segment.scale);
  }
  EXPECT_THAT(lines,
              ElementsAre("0-9 unplaced -1 none",
                          "10-19 translating 0 reference",
                          "20-24 unplaced -1 none",
                          "25-29 translating 1 continuity",
                          "30-39 rotating 1 continuity"));
}

TEST(CommentsOn, NamesRunsOfFramesThatAreNotMeasured) {
  std::map<FrameId, FramePose> poses = TwoComponents().frame_poses;
  poses[FrameId{3}].note = "another";
  poses[FrameId{35}].note = "orientation held: by 3 deg";
  poses[FrameId{36}].note = "orientation held: by 4 deg";
  EXPECT_THAT(CommentsOn(poses),
              ElementsAre("frames 0 to 2: unplaced",
                          "frame 3: unplaced, another",
                          "frames 4 to 9: unplaced",
                          "frames 20 to 24: unplaced",
                          "frames 30 to 34: held",
                          "frames 35 to 36: held, orientation held",
                          "frames 37 to 39: held"));
}

}  // namespace
}  // namespace rotslam
