#include "apps/slam/map_views.h"

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "tests/ba/ba_scene.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Images 0.png to 5.png, each of one grey value: ten times its number.
class MapViewsTest : public testing::Test {
 protected:
  void SetUp() override {
    for (int k = 0; k < 6; ++k) {
      cv::imwrite((folder_.path() / (std::to_string(k) + ".png")).string(),
                  cv::Mat(20, 30, CV_8U, cv::Scalar(10.0 * k)));
    }
  }

  MapViews Read(const SequenceOptions& options, const std::set<FrameId>& frames) {
    SequenceSource images(folder_.path(), options);
    return Read(images, frames);
  }

  MapViews Read(ImageProvider& images, const std::set<FrameId>& frames) {
    problems_.clear();
    return ReadMapViews(images, frames, Orientations(), [&](const std::string& problem) {
      problems_.push_back(problem);
    });
  }

  const TemporaryFolder folder_;
  std::vector<std::string> problems_;
};

TEST_F(MapViewsTest, AreTheImagesOfTheFramesAskedFor) {
  const MapViews views = Read({.first = 1, .stride = 2}, {FrameId{0}, FrameId{2}});
  EXPECT_THAT(problems_, IsEmpty());
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views.at(FrameId{0}).image.at<std::uint8_t>(3, 4), 10);
  EXPECT_EQ(views.at(FrameId{2}).image.at<std::uint8_t>(3, 4), 50);
  EXPECT_EQ(views.at(FrameId{2}).half.size(), cv::Size(15, 10));
}

TEST_F(MapViewsTest, SayWhatCannotBeReadAgain) {
  SequenceSource images(folder_.path(), {});
  fs::resize_file(folder_.path() / "3.png", 10);
  fs::resize_file(folder_.path() / "4.png", 0);
  EXPECT_EQ(Read(images, {FrameId{2}, FrameId{3}, FrameId{4}, FrameId{5}}).size(), 2U);
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("3.png"), HasSubstr("4.png")));
  EXPECT_EQ(Read(images, {FrameId{2}, FrameId{9}}).size(), 1U);
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("frame 9")));
  fs::remove_all(folder_.path());
  EXPECT_TRUE(Read(images, {FrameId{2}}).empty());
  EXPECT_THAT(problems_, ElementsAre(HasSubstr("no such file")));
}

// A camera that walks and turns past points, every other frame in the map.
struct RollingWalk {
  static constexpr int kNumFrames = 7;
  static constexpr double kStepS = 0.1;
  static constexpr int kNumPoints = 60;

  RollingWalk() {
    camera.readout_s = 0.03;
    for (int k = 0; k < kNumFrames; ++k) {
      const FrameId frame{k};
      orientations.timestamps_s.push_back(kStepS * k);
      orientations.cam_from_world[frame] = Rotation::Exp(kStepS * k * rate);
      if (k % 2 != 0) continue;
      map.cam_from_world[frame] = orientations.cam_from_world[frame];
      map.center_in_world[frame] = CenterAt(kStepS * k);
      views[frame] = {};
    }
    cv::RNG random(5);
    for (int n = 0; n < kNumPoints; ++n) {
      const auto uniform = [&](double from, double to) { return random.uniform(from, to); };
      const Eigen::Vector3d point(uniform(-1.0, 1.0), uniform(-0.8, 0.8), uniform(4.0, 6.0));
      Track& track = tracks.emplace_back();
      track.id = TrackId{n};
      map.point_in_world[track.id] = point;
      for (int k = 0; k < kNumFrames; ++k) {
        const Eigen::Vector3d in_cam = orientations.cam_from_world.at(FrameId{k}) *
                                       Eigen::Vector3d(point - CenterAt(kStepS * k));
        Observation& observation = track.observations.emplace_back();
        observation.frame = FrameId{k};
        observation.keypoint_px = camera.Project(in_cam).value();
        observation.bearing = in_cam.normalized();
      }
    }
  }

  // Stops, goes faster and faster.
  static Eigen::Vector3d CenterAt(double time_s) { return time_s * time_s * kAcceleration / 2.0; }
  static Eigen::Vector3d VelocityAt(double time_s) { return time_s * kAcceleration; }

  static inline const Eigen::Vector3d kAcceleration{0.6, -0.3, 0.9};
  const Eigen::Vector3d rate{0.05, -0.1, 0.15};
  Camera camera = BaCamera();
  Orientations orientations;
  std::vector<Track> tracks;
  Reconstruction map;
  MapViews views;
};

TEST(SetMotions, TakesThemFromTheFramesAround) {
  RollingWalk walk;
  walk.views[FrameId{3}] = {};  // without a place
  SetMotions({walk.orientations, walk.tracks, walk.camera, {}}, walk.map, walk.views);
  for (const auto& [frame, view] : walk.views) {
    const AngularMotion& motion = view.motion;
    EXPECT_LT((motion.coefficients.col(0) - walk.rate).norm(), 1e-9) << frame.value;
    const Eigen::Vector3d velocity =
        frame == FrameId{3} ? Eigen::Vector3d::Zero()
                            : RollingWalk::VelocityAt(RollingWalk::kStepS * frame.value);
    EXPECT_LT((view.velocity - velocity).norm(), 1e-3) << frame.value;
  }
}

TEST(SetMotions, LeavesAGlobalShutterAlone) {
  RollingWalk walk;
  walk.camera.readout_s = 0.0;
  SetMotions({walk.orientations, walk.tracks, walk.camera, {}}, walk.map, walk.views);
  for (const auto& [frame, view] : walk.views) EXPECT_TRUE(view.velocity.isZero(0.0));
}

TEST(DescribeViews, FindsCornersAsAGlobalShutterSeesThem) {
  const Camera global = BaCamera();
  cv::Mat image(global.height, global.width, CV_8U);
  cv::RNG random(3);
  for (int row = 0; row < image.rows; row += 20) {
    for (int column = 0; column < image.cols; column += 20) {
      image(cv::Rect(column, row, 20, 20) & cv::Rect({}, image.size())) = random.uniform(0, 256);
    }
  }
  MapViews views;
  views[FrameId{7}] = MakeMapView(image);
  views[FrameId{7}].motion.coefficients.col(0) << 0.0, 0.9, 0.0;
  const Features corners = DescribeViews(views, global, {}, 1).at(FrameId{7});
  EXPECT_EQ(corners.frame, FrameId{7});
  EXPECT_GT(corners.size(), 100);
  EXPECT_EQ(corners.descriptors.rows, corners.size());
  Camera rolling = global;
  rolling.readout_s = 0.03;
  const Features moved = DescribeViews(views, rolling, {}, 1).at(FrameId{7});
  ASSERT_EQ(moved.size(), corners.size());
  Features expected = corners;
  MoveToMidFrame(rolling, views[FrameId{7}].motion, expected);
  EXPECT_EQ(moved.keypoints_px, expected.keypoints_px);
  EXPECT_NE(moved.keypoints_px, corners.keypoints_px);
}

}  // namespace
}  // namespace rotslam
