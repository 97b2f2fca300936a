#include "apps/slam/readout_decision.h"

#include <gtest/gtest.h>

#include "tests/rotodom/tracking/rolling_footage.h"

namespace rotslam {
namespace {

constexpr double kReadoutS = 0.02;

SlamOptions TwoThreads(SlamOptions options) {
  options.num_threads = 2;
  return options;
}

Rotation TurnSteadily(double time_s) { return Rotation::Exp({0.0, 0.3 * time_s - 0.6, 0.0}); }

OdometryResult ResultOf(const RollingFootage& footage) {
  OdometryResult result;
  result.graph = footage.graph;
  result.cam_from_world = footage.cam_from_world;
  return result;
}

// Shows the watch all frames, in their order.
void Show(const RollingFootage& footage, ReadoutDecision& watch) {
  const OdometryResult result = ResultOf(footage);
  for (const auto& [frame, points] : footage.frames) watch.Add(frame, points, result);
}

TEST(ReadoutDecision, LooksAfter120Frames) {
  const RollingFootage footage = FilmRolling(Swing, Stay, kReadoutS, ReadoutStart::kTop, 120);
  ReadoutDecision watch(footage.camera, TwoThreads({}));
  EXPECT_TRUE(watch.IsOn());
  Show(footage, watch);
  ASSERT_TRUE(watch.found().has_value());
  EXPECT_NEAR(watch.found()->readout_s, kReadoutS, 0.0005);
  EXPECT_FALSE(watch.IsOn());
}

TEST(ReadoutDecision, LooksAtTheEndOfAShorterSequence) {
  const RollingFootage footage = FilmRolling(Swing, Stay, kReadoutS, ReadoutStart::kBottom, 60);
  ReadoutDecision watch(footage.camera, TwoThreads({}));
  Show(footage, watch);
  EXPECT_FALSE(watch.found().has_value());
  EXPECT_TRUE(watch.IsOn());
  watch.Finish(ResultOf(footage));
  ASSERT_TRUE(watch.found().has_value());
  EXPECT_EQ(watch.found()->readout_from, ReadoutStart::kBottom);
}

TEST(ReadoutDecision, IsDoneWithAGlobalShutter) {
  const RollingFootage footage = FilmRolling(Swing, Stay, 0.0, ReadoutStart::kTop, 120);
  ReadoutDecision watch(footage.camera, TwoThreads({}));
  Show(footage, watch);
  EXPECT_FALSE(watch.found().has_value());
  EXPECT_FALSE(watch.IsOn());
}

TEST(ReadoutDecision, GivesUpAfterSoManyFrames) {
  const RollingFootage footage = FilmRolling(TurnSteadily, Stay, 0.0, ReadoutStart::kTop, 60);
  SlamOptions options;
  options.readout.max_frames = 61;
  ReadoutDecision patient(footage.camera, TwoThreads(options));
  Show(footage, patient);
  EXPECT_TRUE(patient.IsOn());
  options.readout.max_frames = 60;
  ReadoutDecision impatient(footage.camera, TwoThreads(options));
  Show(footage, impatient);
  EXPECT_FALSE(impatient.IsOn());
}

TEST(ReadoutDecision, AsksNothingThatIsKnownOrNotWanted) {
  const RollingFootage footage = FilmRolling(Swing, Stay, kReadoutS, ReadoutStart::kTop, 60);
  Camera camera = footage.camera;
  camera.knows_readout = true;
  SlamOptions unwanted;
  unwanted.readout.enabled = false;
  for (ReadoutDecision watch : {ReadoutDecision(camera, TwoThreads({})),
                                ReadoutDecision(footage.camera, TwoThreads(unwanted))}) {
    EXPECT_FALSE(watch.IsOn());
    Show(footage, watch);
    watch.Finish(ResultOf(footage));
    EXPECT_FALSE(watch.found().has_value());
  }
}

TEST(WithReadout, IsWhatACameraFileWouldHaveSaid) {
  ReadoutEstimate readout;
  readout.readout_s = 0.02031;
  readout.readout_from = ReadoutStart::kRight;
  const Camera camera = WithReadout(Camera(), readout);
  EXPECT_EQ(camera.readout_s, 0.02031);
  EXPECT_EQ(camera.readout_from, ReadoutStart::kRight);
  EXPECT_TRUE(camera.knows_readout);
}

}  // namespace
}  // namespace rotslam
