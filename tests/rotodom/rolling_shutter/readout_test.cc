#include "rotodom/rolling_shutter/readout.h"

#include <gtest/gtest.h>

#include "rotodom/types/rotation.h"
#include "tests/rotodom/tracking/rolling_footage.h"

namespace rotslam {
namespace {

TEST(EstimateReadout, FindsItsLengthAndTheSideWhereItStarts) {
  for (const ReadoutStart from :
       {ReadoutStart::kTop, ReadoutStart::kBottom, ReadoutStart::kLeft, ReadoutStart::kRight}) {
    SCOPED_TRACE(Name(from));
    const auto readout = FilmRolling(Swing, Stay, 0.02, from, 60).Estimate();
    ASSERT_TRUE(readout.has_value());
    EXPECT_TRUE(readout->IsRolling());
    EXPECT_FALSE(readout->IsGlobal());
    EXPECT_EQ(readout->readout_from, from);
    EXPECT_NEAR(readout->readout_s, 0.02, 0.0005);
    EXPECT_LT(readout->sigma_s, 0.0005);
  }
}

TEST(EstimateReadout, FindsItOfACameraThatMovesAgainstItsTurn) {
  const auto readout =
      FilmRolling(Swing, MoveAgainstSwing, 0.025, ReadoutStart::kTop, 60).Estimate();
  ASSERT_TRUE(readout.has_value());
  EXPECT_TRUE(readout->IsRolling());
  EXPECT_EQ(readout->readout_from, ReadoutStart::kTop);
  EXPECT_NEAR(readout->readout_s, 0.025, 0.001);
}

TEST(EstimateReadout, KnowsAGlobalShutter) {
  for (const CenterAt& way : {CenterAt(Stay), CenterAt(MoveAgainstSwing)}) {
    const auto readout = FilmRolling(Swing, way, 0.0, ReadoutStart::kTop, 60).Estimate();
    ASSERT_TRUE(readout.has_value());
    EXPECT_FALSE(readout->IsRolling());
    EXPECT_TRUE(readout->IsGlobal());
  }
}

// Of pan720, frames 30 to 79, whose shutter is global, with a lens of k1 = -0.05 left in.
TEST(ReadoutEstimate, ASmallShearMayBeALensThatWasLeftIn) {
  ReadoutEstimate estimate;
  estimate.readout_s = 0.00297;
  estimate.sigma_s = 0.00046;
  estimate.gain_sigmas = 4.25;
  estimate.least_gain_sigmas = 2.04;
  estimate.shear_px = 0.258;
  estimate.noise_px = 0.05;
  estimate.frame_s = 1.0 / 30.0;
  EXPECT_FALSE(estimate.IsRolling());
  // As much of a walk's readout of 20 ms as it takes.
  estimate.shear_px = 0.5;
  EXPECT_TRUE(estimate.IsRolling());
}

TEST(EstimateReadout, ASteadyTurnDoesNotTell) {
  const TurnAt steady = [](double time_s) { return Rotation::Exp({0.0, 0.5 * time_s - 0.5, 0.0}); };
  const auto readout = FilmRolling(steady, Stay, 0.02, ReadoutStart::kTop, 60).Estimate();
  EXPECT_FALSE(readout && readout->IsRolling());
}

TEST(EstimateReadout, NeedsPairsOfViews) {
  EXPECT_FALSE(FilmRolling(Swing, Stay, 0.02, ReadoutStart::kTop, 3).Estimate().has_value());
  RollingFootage footage = FilmRolling(Swing, Stay, 0.02, ReadoutStart::kTop, 30);
  footage.graph = ViewGraph();
  EXPECT_FALSE(footage.Estimate().has_value());
}

TEST(EstimateReadout, IsTheSameAtAnyNumberOfThreads) {
  const RollingFootage footage = FilmRolling(Swing, MoveAgainstSwing, 0.02, ReadoutStart::kTop, 30);
  const auto one = footage.Estimate(1);
  const auto three = footage.Estimate(3);
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->readout_s, three->readout_s);
  EXPECT_EQ(one->sigma_s, three->sigma_s);
  EXPECT_EQ(one->gain_sigmas, three->gain_sigmas);
}

}  // namespace
}  // namespace rotslam
