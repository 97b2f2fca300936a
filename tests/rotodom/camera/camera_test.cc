#include "rotodom/camera/camera.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

namespace rotslam {
namespace {

Camera MakeCamera(CameraModel model, int width, int height, const std::array<double, 9>& numbers) {
  Camera camera;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.fx = numbers[0];
  camera.fy = numbers[1];
  camera.cx = numbers[2];
  camera.cy = numbers[3];
  for (int k = 0; k < 5; ++k) camera.distortion[k] = numbers[4 + k];
  return camera;
}

struct NamedCamera {
  std::string name;
  Camera camera;
};

void PrintTo(const NamedCamera& named, std::ostream* out) { *out << named.name; }

// Published calibrations; kEquidistantWide sees 180 degrees.
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
       MakeCamera(CameraModel::kEquidistant, 1000, 1000, {318.0, 318.0, 499.5, 499.5})}};
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

TEST_P(EveryCamera, AgreesWithOpenCv) {
  const Camera& camera = GetParam().camera;
  const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const auto& k = camera.distortion;
  std::vector<cv::Point2d> pixels;
  for (int row = 0; row <= 8; ++row) {
    for (int column = 0; column <= 8; ++column) {
      pixels.emplace_back(camera.width * (0.2 + 0.075 * column),
                          camera.height * (0.2 + 0.075 * row));
    }
  }
  std::vector<cv::Point2d> planes;
  if (camera.model == CameraModel::kEquidistant) {
    const cv::Vec4d coefficients(k[0], k[1], k[2], k[3]);
    cv::fisheye::undistortPoints(pixels, planes, K, coefficients);
  } else {
    const cv::Vec<double, 5> coefficients(k[0], k[1], k[2], k[3], k[4]);
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
      const cv::Vec4d coefficients(k[0], k[1], k[2], k[3]);
      cv::fisheye::projectPoints(
          points, projected, cv::Vec3d::all(0), cv::Vec3d::all(0), K, coefficients);
    } else {
      const cv::Vec<double, 5> coefficients(k[0], k[1], k[2], k[3], k[4]);
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
