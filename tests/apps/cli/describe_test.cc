#include "apps/cli/terminal/describe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

TEST(DescribeRounded, KeepsFiveDigits) {
  Camera camera;
  camera.fx = 502.2993847;
  camera.fy = 1489.44449;
  EXPECT_THAT(DescribeRounded(camera), testing::HasSubstr("fx 502.3, fy 1489.4,"));
}

TEST(DescribeMeanError, CountsEveryObservationOnce) {
  BundleSummary large;
  large.num_observations = 300;
  large.after.mean_px = 0.5;
  BundleSummary small;
  small.num_observations = 100;
  small.after.mean_px = 0.1;
  EXPECT_EQ(DescribeMeanError({small, large}), "mean error 0.4 px");
}

TEST(DescribeReadout, GivesMillisecondsAndTheSide) {
  ReadoutEstimate readout;
  readout.readout_s = 0.02031;
  readout.sigma_s = 0.00021;
  readout.readout_from = ReadoutStart::kRight;
  EXPECT_EQ(DescribeReadout(readout), "20.3 +- 0.2 ms from the right");
  EXPECT_EQ(CameraLines(readout), "readout_s: 0.0203, readout_from: right");
}

}  // namespace
}  // namespace rotslam
