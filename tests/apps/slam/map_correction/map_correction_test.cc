#include "apps/slam/map_correction/map_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/walk_scene.h"

namespace rotslam {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;

// A walk whose late frames have been adjusted in a wrong place, one of them looking like an early
// one. Corners of the last ones are not known before somebody asks.
class CorrectMapsTest : public testing::Test {
 protected:
  static constexpr int kFirstAsked = 12;

  CorrectMapsTest() {
    map_ = walk_.LateMoved(kAway);
    Adjust(map_);
    sources_.lookalikes = {{FrameId{11}, FrameId{8}}};
    for (const auto& [frame, place] : walk_.places) {
      if (frame.value < kFirstAsked) sources_.places[frame] = place;
    }
  }

  void Adjust(const Reconstruction& start) {
    BundleProblem problem;
    problem.camera = walk_.camera;
    problem.start = start;
    BundleOptions options;
    options.lens.refine_distortion = false;
    refined_.bundles = {RefineBundle(problem, options)};
    refined_.components = {{}};
    for (const auto& [frame, center] : start.center_in_world) {
      refined_.components[0].keyframes.insert(frame);
    }
    refined_.camera = walk_.camera;
  }

  void DescribeWhenAsked() {
    sources_.describe = [this](const Reconstruction& map, const std::set<FrameId>& frames) {
      asked_.push_back(frames);
      std::map<FrameId, Features> described;
      for (const FrameId frame : frames) {
        EXPECT_TRUE(map.center_in_world.contains(frame));
        described[frame] = walk_.places.at(frame);
      }
      return described;
    };
  }

  std::set<FrameId> Correct() {
    sources_.calibrated = walk_.camera;
    sources_.tracks = map_.tracks;
    sources_.seed = 0;
    return CorrectMaps(sources_, {}, {}, refined_);
  }

  static Features Blank(FrameId frame) {
    Features place;
    place.frame = frame;
    place.descriptors = cv::Mat(0, 32, CV_8U);
    return place;
  }

  // Observations of early points.
  int NumFoundIn(FrameId frame) const {
    int count = 0;
    for (const Track& track : refined_.bundles[0].reconstruction.tracks) {
      for (const Observation& observation : track.observations) {
        count += track.id.value < kNumPoints && observation.frame == frame ? 1 : 0;
      }
    }
    return count;
  }

  Walk walk_;
  Reconstruction map_;
  RefinedComponents refined_;
  MapCorrectionSources sources_;
  std::vector<std::set<FrameId>> asked_;
};

TEST_F(CorrectMapsTest, LooksForFramesWithoutDescriptionWhereOthersMove) {
  DescribeWhenAsked();
  EXPECT_EQ(Correct().size(), std::size_t{kNumFrames - kFirstLate});
  EXPECT_THAT(asked_, ElementsAre(std::set<FrameId>{FrameId{12}, FrameId{13}}));
  EXPECT_GT(NumFoundIn(FrameId{12}), 50);
  EXPECT_GT(NumFoundIn(FrameId{13}), 50);
  const Reconstruction& corrected = refined_.bundles[0].reconstruction;
  for (const auto& [frame, center] : walk_.truth.center_in_world) {
    EXPECT_LT((corrected.center_in_world.at(frame) - center).norm(), 0.05) << frame.value;
  }
}

TEST_F(CorrectMapsTest, AsksForFramesBesideThoseThatMove) {
  DescribeWhenAsked();
  sources_.places.erase(FrameId{9});  // stands right
  Correct();
  ASSERT_FALSE(asked_.empty());
  EXPECT_THAT(asked_[0], Contains(FrameId{9}));
}

TEST_F(CorrectMapsTest, ComparesFramesBesideThoseThatMoveAlsoWithoutPointsInCommon) {
  DescribeWhenAsked();
  for (Track& track : map_.tracks) {
    const FrameId other{track.id.value % 2 == 0 ? 11 : 12};
    if (track.id.value >= kNumPoints) {
      std::erase_if(track.observations, [&](const auto& one) { return one.frame == other; });
    }
  }
  Adjust(map_);
  Correct();
  EXPECT_GT(NumFoundIn(FrameId{12}), 50);
}

TEST_F(CorrectMapsTest, DoesWithoutImages) {
  EXPECT_EQ(Correct().size(), std::size_t{kNumFrames - kFirstLate});
  EXPECT_EQ(NumFoundIn(FrameId{12}) + NumFoundIn(FrameId{13}), 0);
}

TEST_F(CorrectMapsTest, FindsPlacesThatNoMapHolds) {
  // A pair is told the other way round. The places next to it show nothing.
  sources_.lookalikes = {{FrameId{8}, FrameId{12}}};
  sources_.places[FrameId{12}] = walk_.places.at(FrameId{12});
  for (const int blank : {9, 10, 11}) sources_.places[FrameId{blank}] = Blank(FrameId{blank});
  Adjust(PartOf(map_, false));
  EXPECT_EQ(Correct(), std::set<FrameId>{FrameId{12}});
  ASSERT_EQ(refined_.bundles.size(), 1U);
  EXPECT_TRUE(refined_.components[0].keyframes.contains(FrameId{12}));
  const CenterMap& centers = refined_.bundles[0].reconstruction.center_in_world;
  ASSERT_TRUE(centers.contains(FrameId{12}));
  EXPECT_LT((centers.at(FrameId{12}) - walk_.truth.center_in_world.at(FrameId{12})).norm(), 0.05);
}

TEST_F(CorrectMapsTest, FindsFramesApartByThoseBeforeThem) {
  sources_.lookalikes.clear();
  for (Track& track : map_.tracks) {
    std::erase_if(track.observations, [](const auto& one) { return one.frame == FrameId{11}; });
  }
  Adjust(PartOf(map_, false));
  sources_.unregistered = {FrameId{11}};
  EXPECT_THAT(Correct(), Contains(FrameId{11}));
  ASSERT_EQ(refined_.bundles.size(), 1U);
  const CenterMap& centers = refined_.bundles[0].reconstruction.center_in_world;
  ASSERT_TRUE(centers.contains(FrameId{11}));
  EXPECT_LT((centers.at(FrameId{11}) - walk_.truth.center_in_world.at(FrameId{11})).norm(), 0.05);
}

TEST_F(CorrectMapsTest, JoinsMapsWhereOneFollowsTheOther) {
  sources_.lookalikes.clear();
  Adjust(PartOf(map_, true));
  const RefinedComponents late = refined_;
  Adjust(PartOf(map_, false));
  refined_.components.push_back(late.components[0]);
  refined_.bundles.push_back(late.bundles[0]);
  EXPECT_EQ(Correct().size(), std::size_t{kNumFrames - kFirstLate});
  ASSERT_EQ(refined_.bundles.size(), 1U);
  const CenterMap& centers = refined_.bundles[0].reconstruction.center_in_world;
  for (const auto& [frame, center] : walk_.truth.center_in_world) {
    EXPECT_LT((centers.at(frame) - center).norm(), 0.05) << frame.value;
  }
}

TEST_F(CorrectMapsTest, AsksForNothingWhereAllStandsRight) {
  DescribeWhenAsked();
  Correct();
  asked_.clear();
  EXPECT_TRUE(Correct().empty());
  EXPECT_TRUE(asked_.empty());
}

}  // namespace
}  // namespace rotslam
