#include "rotodom/tracking/shutter.h"

#include <gtest/gtest.h>

#include "rotodom/types/rotation.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

class MoveToMidFrameTest : public testing::TestWithParam<ReadoutStart> {};
INSTANTIATE_TEST_SUITE_P(ReadoutStarts,
                         MoveToMidFrameTest,
                         testing::Values(ReadoutStart::kTop, ReadoutStart::kRight),
                         [](const auto& start) { return Name(start.param); });

TEST_P(MoveToMidFrameTest, PutsCornersWhereAGlobalShutterSeesThem) {
  Camera camera = BaCamera();
  camera.readout_s = 0.03;
  camera.readout_from = GetParam();
  const Eigen::Vector3d rate(0.4, -0.8, 0.5);
  Features corners;
  std::vector<Eigen::Vector3d> bearings;
  for (const double y : {40.0, 200.0, 330.0}) {
    // What the pixel sees as it is exposed.
    const Eigen::Vector2d px(150.0, y);
    corners.keypoints_px.push_back(px);
    corners.bearings.push_back(*camera.Unproject(px));
    bearings.emplace_back(Rotation::Exp(-camera.ExposureTime(px) * rate) * corners.bearings.back());
  }
  const Features seen = corners;
  MoveToMidFrame(camera, rate, corners);
  for (int n = 0; n < corners.size(); ++n) {
    EXPECT_LT((corners.bearings[n] - bearings[n]).norm(), 1e-12);
    EXPECT_LT((corners.keypoints_px[n] - *camera.Project(bearings[n])).norm(), 1e-9);
  }
  EXPECT_GT((corners.keypoints_px[0] - seen.keypoints_px[0]).norm(), 1.0);

  camera.readout_s = 0.0;
  corners = seen;
  MoveToMidFrame(camera, rate, corners);
  EXPECT_EQ(corners.keypoints_px, seen.keypoints_px);
}

}  // namespace
}  // namespace rotslam
