#include "rotodom/camera/camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

namespace rotslam {
namespace {

// @param numbers  fx fy cx cy, then the distortion.
Camera MakeCamera(CameraModel model, int width, int height, const std::array<double, 12>& numbers) {
  Camera camera;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.fx = numbers[0];
  camera.fy = numbers[1];
  camera.cx = numbers[2];
  camera.cy = numbers[3];
  for (int k = 0; k < 8; ++k) camera.distortion[k] = numbers[4 + k];
  return camera;
}

struct NamedCamera {
  std::string name;
  Camera camera;
};

void PrintTo(const NamedCamera& named, std::ostream* out) { *out << named.name; }

// Published calibrations of phones and webcams, and lenses made up to be hard: PlainFisheye sees
// 180 degrees, FovWide 170 from corner to corner.
const std::vector<NamedCamera>& Cameras() {
  static const std::vector<NamedCamera> kCameras = {
      {"Kitti",
       MakeCamera(CameraModel::kPinhole, 1241, 376, {718.856, 718.856, 607.1928, 185.2157})},
      {"TumFr1",
       MakeCamera(CameraModel::kRadtan,
                  640,
                  480,
                  {517.306408,
                   516.469215,
                   318.643040,
                   255.313989,
                   0.262383,
                   -0.953104,
                   -0.005358,
                   0.002628,
                   1.163314})},
      {"Euroc",
       MakeCamera(CameraModel::kRadtan,
                  752,
                  480,
                  {458.654,
                   457.296,
                   367.215,
                   248.375,
                   -0.28340811,
                   0.07395907,
                   0.00019359,
                   1.76187114e-05,
                   0.0})},
      {"TumViFisheye",
       MakeCamera(CameraModel::kEquidistant,
                  512,
                  512,
                  {190.97847715,
                   190.97330707,
                   254.93170606,
                   256.89744288,
                   0.00348238,
                   0.00071503,
                   -0.00205323,
                   0.00020294,
                   0.0})},
      {"PlainFisheye",
       MakeCamera(CameraModel::kEquidistant, 1000, 1000, {318.0, 318.0, 499.5, 499.5})},
      {"Rational",
       MakeCamera(CameraModel::kRational,
                  480,
                  360,
                  {380.0, 382.0, 250.0, 172.0, 3.1, 1.4, 0.0005, -0.0007, 0.06, 3.4, 2.2, 0.32})},
      // Made up after what an Azure Kinect has: numerator and denominator nearly cancel.
      {"RationalKinect",
       MakeCamera(CameraModel::kRational,
                  1280,
                  720,
                  {605.3,
                   605.1,
                   637.9,
                   365.1,
                   0.5211,
                   -2.7194,
                   0.00074,
                   -0.00015,
                   1.5703,
                   0.3976,
                   -2.5302,
                   1.4916})},
      {"RationalWithoutDenominator",
       MakeCamera(CameraModel::kRational,
                  752,
                  480,
                  {458.654, 457.296, 367.215, 248.375, -0.2834, 0.0739, 0.0002, 2e-5, 0.0})},
      {"Fov", MakeCamera(CameraModel::kFov, 640, 480, {260.0, 261.0, 318.0, 243.0, 0.93})},
      {"FovWide", MakeCamera(CameraModel::kFov, 1000, 1000, {700.0, 700.0, 499.5, 499.5, 1.5})},
      {"FovOfAPinhole", MakeCamera(CameraModel::kFov, 640, 480, {500.0, 500.0, 320.0, 240.0})}};
  return kCameras;
}

class EveryCamera : public testing::TestWithParam<NamedCamera> {};

TEST_P(EveryCamera, ProjectUndoesUnprojectOverTheImage) {
  const Camera& camera = GetParam().camera;
  double worst_px = 0.0;
  for (int row = 0; row <= 40; ++row) {
    for (int column = 0; column <= 40; ++column) {
      const Eigen::Vector2d pixel((camera.width - 1) * column / 40.0,
                                  (camera.height - 1) * row / 40.0);
      const auto bearing = camera.Unproject(pixel);
      ASSERT_TRUE(bearing) << pixel.transpose();
      EXPECT_NEAR(bearing->norm(), 1.0, 1e-14);
      const auto again = camera.Project(3.7 * *bearing);
      ASSERT_TRUE(again) << pixel.transpose();
      worst_px = std::max(worst_px, (*again - pixel).norm());
    }
  }
  EXPECT_LT(worst_px, 1e-9);
}

TEST_P(EveryCamera, JacobianEqualsCentralDifferences) {
  const Camera& camera = GetParam().camera;
  for (int row = 0; row <= 10; ++row) {
    for (int column = 0; column <= 10; ++column) {
      const Eigen::Vector2d pixel((camera.width - 1) * column / 10.0,
                                  (camera.height - 1) * row / 10.0);
      const Eigen::Vector3d point = 2.5 * camera.Unproject(pixel).value();
      Eigen::Matrix<double, 2, 3> J;
      ASSERT_TRUE(camera.Project(point, &J));
      constexpr double kStep = 1e-5;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
        const Eigen::Vector2d slope =
            (camera.Project(point + step).value() - camera.Project(point - step).value()) /
            (2.0 * kStep);
        EXPECT_LT((J.col(axis) - slope).norm(), 1e-6 * (1.0 + slope.norm()))
            << "axis " << axis << " at " << pixel.transpose();
      }
    }
  }
}

// OpenCV's distortion of a camera; kFov is a model that OpenCV does not have.
std::vector<double> OpenCvDistortion(const Camera& camera) {
  const std::size_t count = DistortionNames(camera.model).size();
  return {camera.distortion.begin(), camera.distortion.begin() + std::max<std::size_t>(count, 4)};
}

TEST_P(EveryCamera, AgreesWithOpenCv) {
  const Camera& camera = GetParam().camera;
  if (camera.model == CameraModel::kFov) GTEST_SKIP() << "OpenCV does not have this model";
  const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const std::vector<double> coefficients = OpenCvDistortion(camera);
  std::vector<cv::Point2d> pixels;
  for (int row = 0; row <= 8; ++row) {
    for (int column = 0; column <= 8; ++column) {
      pixels.emplace_back(camera.width * (0.2 + 0.075 * column),
                          camera.height * (0.2 + 0.075 * row));
    }
  }
  std::vector<cv::Point2d> planes;
  if (camera.model == CameraModel::kEquidistant) {
    cv::fisheye::undistortPoints(pixels, planes, K, coefficients);
  } else {
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-13);
    cv::undistortPoints(pixels, planes, K, coefficients, cv::noArray(), cv::noArray(), until);
  }
  for (std::size_t n = 0; n < pixels.size(); ++n) {
    const Eigen::Vector3d bearing = camera.Unproject({pixels[n].x, pixels[n].y}).value();
    const Eigen::Vector3d theirs = Eigen::Vector3d(planes[n].x, planes[n].y, 1.0).normalized();
    EXPECT_LT((bearing - theirs).norm(), 1e-7) << pixels[n];

    const std::vector<cv::Point3d> points = {{bearing.x(), bearing.y(), bearing.z()}};
    std::vector<cv::Point2d> projected;
    if (camera.model == CameraModel::kEquidistant) {
      cv::fisheye::projectPoints(
          points, projected, cv::Vec3d::all(0), cv::Vec3d::all(0), K, coefficients);
    } else {
      cv::projectPoints(points, cv::Vec3d::all(0), cv::Vec3d::all(0), K, coefficients, projected);
    }
    EXPECT_LT(cv::norm(projected[0] - pixels[n]), 1e-8);
  }
}

TEST_P(EveryCamera, RefusesWhatIsNoNumber) {
  const Camera& camera = GetParam().camera;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(camera.Project({nan, 0.0, 1.0}));
  EXPECT_FALSE(camera.Project({0.0, 0.0, nan}));
  EXPECT_FALSE(camera.Project({0.0, 0.0, 0.0}));
  EXPECT_FALSE(camera.Project({0.0, 0.0, -1.0}));
  EXPECT_FALSE(camera.Unproject({nan, 10.0}));
  EXPECT_FALSE(camera.Problem());
}

INSTANTIATE_TEST_SUITE_P(Camera, EveryCamera, testing::ValuesIn(Cameras()), [](const auto& test) {
  return test.param.name;
});

TEST(Camera, StopsAtTheFoldOfTheDistortion) {
  // d(r) = r - 0.3 r^3 turns back at r = 1 / sqrt(0.9) = 1.0541, where it is worth 0.7027.
  const Camera barrel =
      MakeCamera(CameraModel::kRadtan, 640, 480, {300.0, 300.0, 320.0, 240.0, -0.3});
  EXPECT_TRUE(barrel.Project({1.05, 0.0, 1.0}));
  EXPECT_FALSE(barrel.Project({1.06, 0.0, 1.0}));
  EXPECT_FALSE(barrel.Project({5.0, 0.0, 1.0}));  // would land inside the image again
  EXPECT_FALSE(barrel.Unproject({320.0 + 300.0 * 0.71, 240.0}));
  // Just inside the fold, from a start beyond it.
  const Eigen::Vector2d near_fold(320.0, 240.0 - 300.0 * 0.7025);
  const auto bearing = barrel.Unproject(near_fold);
  ASSERT_TRUE(bearing);
  EXPECT_LT((barrel.Project(*bearing).value() - near_fold).norm(), 1e-9);

  const Camera fisheye =
      MakeCamera(CameraModel::kEquidistant, 640, 480, {200.0, 200.0, 320.0, 240.0, -0.1});
  // d(theta) = theta - 0.1 theta^3 turns back at theta = 1.8257, behind the image plane.
  EXPECT_TRUE(fisheye.Project({std::sin(1.82), 0.0, std::cos(1.82)}));
  EXPECT_FALSE(fisheye.Project({std::sin(1.83), 0.0, std::cos(1.83)}));
  EXPECT_FALSE(fisheye.Unproject({320.0 + 200.0 * 1.218, 240.0}));
  EXPECT_TRUE(fisheye.Unproject({320.0 + 200.0 * 1.217, 240.0}));
}

TEST(Camera, FindsAFoldThatHidesBetweenTwoIncreasingParts) {
  // d' = 1 + 3 k1 s + 5 k2 s^2 is negative only for s in (0.4, 0.6).
  const double k2 = 1.0 / (5.0 * 0.24);
  const double k1 = -1.0 / (3.0 * 0.24);
  const Camera camera =
      MakeCamera(CameraModel::kRadtan, 640, 480, {300.0, 300.0, 320.0, 240.0, k1, k2});
  EXPECT_TRUE(camera.Project({std::sqrt(0.399), 0.0, 1.0}));
  EXPECT_FALSE(camera.Project({std::sqrt(0.401), 0.0, 1.0}));
  EXPECT_FALSE(camera.Project({std::sqrt(0.7), 0.0, 1.0}));
}

TEST(Camera, RationalProjectsAsOpenCvOverTheWholeImage) {
  for (const NamedCamera& named : Cameras()) {
    const Camera& camera = named.camera;
    if (camera.model != CameraModel::kRational) continue;
    const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    for (double y = 0.0; y < camera.height; y += 11.7) {
      for (double x = 0.0; x < camera.width; x += 11.7) {
        const Eigen::Vector3d p = 2.0 * camera.Unproject({x, y}).value();
        const std::vector<cv::Point3d> points = {{p.x(), p.y(), p.z()}};
        std::vector<cv::Point2d> theirs;
        cv::projectPoints(
            points, cv::Vec3d::all(0), cv::Vec3d::all(0), K, OpenCvDistortion(camera), theirs);
        const Eigen::Vector2d ours = camera.Project(p).value();
        EXPECT_LT(std::hypot(ours.x() - theirs[0].x, ours.y() - theirs[0].y), 1e-10) << named.name;
      }
    }
  }
}

// The same from the definitions: d(r) on a fine grid, until it does not increase or D has a zero.
double FoldBySearch(const Camera& camera) {
  const auto& k = camera.distortion;
  double before = 0.0;
  for (double r = 1e-5; r < 10.0; r += 1e-5) {
    const double s = r * r;
    const double D = 1.0 + s * (k[5] + s * (k[6] + s * k[7]));
    const double d = r * (1.0 + s * (k[0] + s * (k[1] + s * k[4]))) / D;
    if (!(D > 0.0) || !(d > before)) return r;
    before = d;
  }
  return 10.0;
}

TEST(Camera, RationalStopsAtTheFirstFoldOrPole) {
  const std::vector<std::array<double, 6>> lenses = {
      // k1 k2 k3 k4 k5 k6
      {0.0, 0.0, 0.0, 1.0, 0.0, 0.0},     // r / (1 + s): turns back at 1
      {0.0, 0.0, 0.0, -0.25, 0.0, 0.0},   // a pole at 2, up to which it increases
      {-1.0, 0.0, 0.0, -1.0, 0.01, 0.0},  // nearly cancels
      {-0.3, 0.0, 0.0, 0.0, 0.0, 0.0},    // kRadtan's own fold
      {3.1, 1.4, 0.06, 3.4, 2.2, 0.32},   //
      {0.5211, -2.7194, 1.5703, 0.3976, -2.5302, 1.4916},
      {0.0, 0.0, 0.0, -1.9, 0.95, 0.0},  // rises steeply, then falls
      {0.2, 0.1, 0.0, 0.0, 0.0, 0.3}};
  for (const auto& [k1, k2, k3, k4, k5, k6] : lenses) {
    const Camera camera =
        MakeCamera(CameraModel::kRational,
                   640,
                   480,
                   {300.0, 300.0, 320.0, 240.0, k1, k2, 0.0, 0.0, k3, k4, k5, k6});
    const double fold = FoldBySearch(camera);
    SCOPED_TRACE(Describe(camera) + ", fold at " + std::to_string(fold));
    for (const double share : {0.1, 0.3, 0.6, 0.9, 0.99, 0.9999}) {
      const Eigen::Vector3d point(0.6 * share * fold, -0.8 * share * fold, 1.0);
      const auto pixel = camera.Project(point);
      ASSERT_TRUE(pixel) << share;
      // Next to a pole neighbouring doubles are pixels apart, millions of pixels from the image.
      if (pixel->norm() > 1e5) continue;
      const auto bearing = camera.Unproject(*pixel);
      ASSERT_TRUE(bearing) << share;
      // At the fold itself the pixel says little about the bearing, so pixels are compared.
      const auto again = camera.Project(*bearing);
      ASSERT_TRUE(again) << share;
      EXPECT_LT((*again - *pixel).norm(), 1e-9 * (1.0 + pixel->norm() / 1e3)) << share;
      EXPECT_LT(bearing->cross(point.normalized()).norm(), 1e-6) << share;
    }
    if (fold == 10.0) continue;
    for (const double share : {1.0001, 1.01, 1.5, 3.0, 30.0}) {
      EXPECT_FALSE(camera.Project({0.6 * share * fold, -0.8 * share * fold, 1.0})) << share;
    }
  }
  // The largest distorted radius of r / (1 + s) is one half.
  const Camera camera =
      MakeCamera(CameraModel::kRational,
                 640,
                 480,
                 {300.0, 300.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0});
  EXPECT_TRUE(camera.Unproject({320.0 + 149.999, 240.0}));
  EXPECT_FALSE(camera.Unproject({320.0 + 150.001, 240.0}));
}

TEST(Camera, FovIsAnArcTangentOfTheRadius) {
  const double w = 0.93;
  const Camera camera = MakeCamera(CameraModel::kFov, 640, 480, {260.0, 261.0, 318.0, 243.0, w});
  for (const Eigen::Vector2d& plane :
       {Eigen::Vector2d(0.3, -0.4), Eigen::Vector2d(30.0, 40.0), Eigen::Vector2d(1e-9, 0.0)}) {
    const double r = plane.norm();
    const double d = std::atan(2.0 * r * std::tan(0.5 * w)) / w;
    const Eigen::Vector2d expected(318.0 + 260.0 * plane.x() * d / r,
                                   243.0 + 261.0 * plane.y() * d / r);
    EXPECT_LT((camera.Project(3.0 * plane.homogeneous()).value() - expected).norm(), 1e-11);
  }
  // Every point in front is seen, and nothing beyond pi / (2 w).
  EXPECT_TRUE(camera.Project({1e6, 0.0, 1.0}));
  EXPECT_FALSE(camera.Project({1.0, 0.0, 0.0}));
  const double end = 0.5 * std::numbers::pi / w;
  EXPECT_TRUE(camera.Unproject({318.0 + 260.0 * (end - 1e-3), 243.0}));
  EXPECT_FALSE(camera.Unproject({318.0 + 260.0 * (end + 1e-3), 243.0}));
}

TEST(Camera, FovWithoutAFieldOfViewIsAPinhole) {
  Camera fov = MakeCamera(CameraModel::kFov, 640, 480, {500.0, 501.0, 320.0, 240.0});
  Camera pinhole = fov;
  pinhole.model = CameraModel::kPinhole;
  const Eigen::Vector3d point(0.7, -0.4, 1.3);
  for (const double w : {0.0, 1e-300, 1e-11, 1e-9, 1e-6, -1e-6}) {
    fov.distortion[0] = w;
    Eigen::Matrix<double, 2, 3> J;
    Eigen::Matrix<double, 2, 3> J_pinhole;
    EXPECT_LT((fov.Project(point, &J).value() - pinhole.Project(point, &J_pinhole).value()).norm(),
              1e-9);
    EXPECT_LT((J - J_pinhole).norm(), 1e-9);
    const Eigen::Vector2d pixel(-30.0, 700.0);
    EXPECT_LT((fov.Unproject(pixel).value() - pinhole.Unproject(pixel).value()).norm(), 1e-11);
  }
  fov.distortion[0] = 3.2;
  EXPECT_THAT(fov.Problem().value(), testing::StartsWith("w is 3.2, must be a field of view"));
}

TEST(Camera, ProblemNamesTheField) {
  const Camera good = Cameras().front().camera;
  Camera camera = good;
  camera.fx = 0.0;
  EXPECT_THAT(camera.Problem().value(), testing::StartsWith("fx is 0"));
  camera = good;
  camera.fy = -3.0;
  EXPECT_THAT(camera.Problem().value(), testing::StartsWith("fy is -3"));
  camera = good;
  camera.cy = std::numeric_limits<double>::infinity();
  EXPECT_THAT(camera.Problem().value(), testing::StartsWith("cy"));
  camera = good;
  camera.height = 0;
  EXPECT_THAT(camera.Problem().value(), testing::HasSubstr("1241x0"));
  camera = good;
  camera.distortion[1] = 0.1;
  EXPECT_THAT(camera.Problem().value(), testing::HasSubstr("pinhole"));
  for (const double readout_s : {-0.001, 1.0, 20.0, std::numeric_limits<double>::quiet_NaN()}) {
    camera = good;
    camera.readout_s = readout_s;
    EXPECT_THAT(camera.Problem().value_or("none"), testing::StartsWith("readout_s is "));
  }
  camera = good;
  camera.readout_s = 0.033;
  EXPECT_EQ(camera.Problem(), std::nullopt);
}

TEST(Camera, AGlobalShutterExposesAllRowsAtOnce) {
  const Camera camera = Cameras().front().camera;
  EXPECT_EQ(camera.readout_s, 0.0);
  for (const double y_px : {0.0, 100.0, 375.0}) {
    EXPECT_EQ(camera.ExposureTime({20.0, y_px}), 0.0);
  }
}

TEST(Camera, ARollingShutterExposesRowAfterRow) {
  Camera camera = Cameras().front().camera;
  camera.readout_s = 0.03;
  const double last = camera.height - 1;
  const auto time = [&](double y_px) { return camera.ExposureTime({20.0, y_px}); };
  EXPECT_NEAR(time(0.5 * last), 0.0, 1e-15);  // counted from the middle of the frame
  // The readout ends with the last row's own share, which is less than a hundredth of it here.
  EXPECT_NEAR(time(last) - time(0.0), camera.readout_s, 1e-2 * 0.03);
  for (double y_px = 0.0; y_px < last; y_px += 7.5) {
    EXPECT_LT(time(y_px), time(y_px + 1.0));
    EXPECT_NEAR(time(y_px), -time(last - y_px), 1e-15);
    EXPECT_EQ(time(y_px), camera.ExposureTime({300.0, y_px}));
  }
}

TEST(Camera, ARollingShutterStartsAtAnySide) {
  Camera camera = Cameras().front().camera;
  camera.readout_s = 0.03;
  const Eigen::Vector2d size_px(camera.width, camera.height);
  const Eigen::Vector2d px(25.0, 40.0);
  const Eigen::Vector2d from_middle_s =
      0.03 * ((px.array() + 0.5) / size_px.array() - 0.5).matrix();
  for (const auto& [start, time_s] : {std::pair("top", from_middle_s.y()),
                                      std::pair("bottom", -from_middle_s.y()),
                                      std::pair("left", from_middle_s.x()),
                                      std::pair("right", -from_middle_s.x())}) {
    camera.readout_from = FindReadoutStart(start).value();
    EXPECT_STREQ(Name(camera.readout_from), start);
    EXPECT_NEAR(camera.ExposureTime(px), time_s, 1e-15) << start;
  }
  EXPECT_EQ(FindReadoutStart("up"), std::nullopt);
}

TEST(Camera, DescribesItselfInOneLine) {
  EXPECT_EQ(Describe(Cameras()[0].camera),
            "pinhole, fx 718.856, fy 718.856, cx 607.1928, cy 185.2157, no distortion, 1241x376");
  EXPECT_EQ(Describe(Cameras()[2].camera),
            "radtan, fx 458.654, fy 457.296, cx 367.215, cy 248.375, k1 -0.28340811, k2 "
            "0.07395907, p1 0.00019359, p2 1.76187114e-05, k3 0, 752x480");
  Camera rolling = Cameras()[0].camera;
  rolling.readout_s = 0.025;
  EXPECT_EQ(Describe(rolling), Describe(Cameras()[0].camera) + ", rolling shutter 0.025 s");
}

}  // namespace
}  // namespace rotslam
