#include "output/tables/lens_curve.h"

#include <cmath>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

Camera WideLens(CameraModel model) {
  Camera camera;
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 300.0;
  camera.cx = 330.0;
  camera.cy = 230.0;
  camera.distortion = {-0.1, 0.01};
  return camera;
}

TEST(LensRadius, CountsRadialTermsAlone) {
  Camera camera = WideLens(CameraModel::kRadtan);
  camera.distortion[2] = 0.01;
  const double t = std::tan(0.5);
  EXPECT_NEAR(
      *LensRadius(camera, 0.5), 300.0 * t * (1.0 - 0.1 * t * t + 0.01 * t * t * t * t), 1e-9);
  EXPECT_FALSE(LensRadius(camera, 1.7)) << "behind the image plane";
  EXPECT_TRUE(LensRadius(WideLens(CameraModel::kEquidistant), 1.7));
}

TEST(LensCurve, IsLensRadiusAtEqualSteps) {
  for (const CameraModel model : {CameraModel::kRadtan, CameraModel::kEquidistant}) {
    const Camera camera = WideLens(model);
    const auto curve = LensCurve(camera, CurveCovariance::Zero(), 8);
    ASSERT_EQ(curve.size(), 8U);
    for (int k = 0; k < 8; ++k) {
      EXPECT_NEAR(curve[k].radius_px, 50.0 * (k + 1), 1e-9);
      EXPECT_NEAR(*LensRadius(camera, curve[k].angle_rad), curve[k].radius_px, 1e-6);
      EXPECT_EQ(curve[k].sigma_px, 0.0);
    }
  }
}

TEST(LensCurve, KnowsWhatErrorsHaveInCommon) {
  const Camera camera = WideLens(CameraModel::kRadtan);
  CurveCovariance covariance = CurveCovariance::Zero();
  covariance(kLensFocal, kLensFocal) = 0.01 * 0.01;
  covariance(kLensCenter, kLensCenter) = 1.0;
  const auto focal = LensCurve(camera, covariance, 4);
  EXPECT_NEAR(focal[3].sigma_px, 4.0, 1e-9) << "1 % of 400 px; the principal point does not count";
  // A first coefficient that makes up for the focal length at that radius.
  const double s = std::pow(std::tan(focal[3].angle_rad), 2);
  const double share = 1.0 - 0.1 * s + 0.01 * s * s;
  const double both = 0.01 * share / s;
  covariance(kLensDistortion, kLensDistortion) = both * both;
  covariance(kLensFocal, kLensDistortion) = covariance(kLensDistortion, kLensFocal) = -0.01 * both;
  const auto bound = LensCurve(camera, covariance, 4);
  EXPECT_NEAR(bound[3].sigma_px, 0.0, 1e-6);
  EXPECT_GT(bound[1].sigma_px, 0.1);
}

}  // namespace
}  // namespace rotslam
