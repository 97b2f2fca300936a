#include "apps/slam/working_size/working_size.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "apps/slam/slam.h"
#include "apps/slam/working_size/original_size.h"
#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

constexpr int kUsual_px = 1600;

// A lens of each model, in images of 2882 x 2164 pixels.
std::vector<Camera> LensesOfLargeImages() {
  std::vector<Camera> cameras;
  for (const CameraModel model : AllCameraModels()) {
    Camera& camera = cameras.emplace_back();
    camera.model = model;
    camera.width = 2882;
    camera.height = 2164;
    camera.fx = 2301.7;
    camera.fy = 2299.3;
    camera.cx = 1433.2;
    camera.cy = 1090.6;
    camera.readout_s = 0.02;
    const auto num_coefficients = DistortionNames(model).size();
    if (model == CameraModel::kFov) camera.distortion[0] = 0.8;
    if (num_coefficients >= 4) camera.distortion = {-0.05, 0.02, 0.001, -0.002};
    if (model == CameraModel::kRational) camera.distortion[5] = 0.03;
  }
  return cameras;
}

TEST(WorkingSize, LeavesImagesWithinTheLimitAlone) {
  for (const cv::Size& size : {cv::Size(1600, 1200), cv::Size(1241, 376), cv::Size(480, 1600)}) {
    const WorkingSize working(size, kUsual_px);
    EXPECT_FALSE(working.IsReduced());
    EXPECT_EQ(working.scale(), 1.0);
    EXPECT_EQ(working.size(), size);
    const cv::Mat image(size, CV_8UC3, cv::Scalar(1, 2, 3));
    EXPECT_EQ(working.Reduced(image).data, image.data);
  }
}

TEST(WorkingSize, HasOneScaleForBothAxesNearTheLimit) {
  struct Case {
    cv::Size original;
    cv::Size reduced;
  };
  for (const auto& [original, reduced] : {Case{{2880, 2160}, {1440, 1080}},
                                          Case{{3840, 2160}, {1536, 864}},
                                          Case{{2160, 3840}, {864, 1536}},
                                          Case{{4000, 2250}, {1600, 900}},
                                          Case{{4032, 3024}, {1344, 1008}},
                                          Case{{5472, 3648}, {1560, 1040}},
                                          Case{{1920, 1080}, {1536, 864}},
                                          Case{{1921, 1083}, {1536, 864}}}) {
    const WorkingSize working(original, kUsual_px);
    EXPECT_TRUE(working.IsReduced());
    EXPECT_EQ(working.size(), reduced) << SizeText(original);
    const cv::Mat image(original, CV_8UC1, cv::Scalar(7));
    EXPECT_EQ(working.Reduced(image).size(), reduced);
  }
}

TEST(WorkingSize, ReducesImagesAboutPixelCentres) {
  const WorkingSize working({500, 402}, 200);
  ASSERT_DOUBLE_EQ(working.scale(), 0.4);
  cv::Mat ramp(402, 500, CV_32F);
  for (int y = 0; y < ramp.rows; ++y) {
    for (int x = 0; x < ramp.cols; ++x) ramp.at<float>(y, x) = static_cast<float>(x + 1000 * y);
  }
  const cv::Mat reduced = working.Reduced(ramp);
  for (const cv::Point at : {cv::Point(0, 0), cv::Point(17, 40), cv::Point(150, 130)}) {
    const double x = (at.x + 0.5) / working.scale() - 0.5;
    const double y = (at.y + 0.5) / working.scale() - 0.5;
    EXPECT_NEAR(reduced.at<float>(at), x + 1000.0 * y, 0.05);
  }
}

TEST(WorkingSize, ReducedCamerasSeePointsAtReducedPixels) {
  for (const Camera& camera : LensesOfLargeImages()) {
    const WorkingSize working({camera.width, camera.height}, kUsual_px);
    const Camera reduced = working.Reduced(camera);
    EXPECT_EQ(cv::Size(reduced.width, reduced.height), working.size());
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.0, 0.0, 1.0),
                                         Eigen::Vector3d(0.4, -0.3, 1.0),
                                         Eigen::Vector3d(-0.9, 0.7, 2.0)}) {
      const auto px = camera.Project(point);
      const auto reduced_px = reduced.Project(point);
      ASSERT_TRUE(px && reduced_px) << Name(camera.model);
      const Eigen::Vector2d expected = ((px->array() + 0.5) * working.scale() - 0.5).matrix();
      EXPECT_LT((*reduced_px - expected).norm(), 1e-9) << Name(camera.model);
    }
    EXPECT_EQ(working.Original(reduced, camera), camera) << Name(camera.model);
  }
}

TEST(WorkingSize, RefinedCamerasComeBackInOriginalPixels) {
  const Camera camera = LensesOfLargeImages().front();
  const WorkingSize working({camera.width, camera.height}, kUsual_px);
  Camera refined = working.Reduced(camera);
  refined.fx *= 1.02;
  refined.cx += 3.0;
  const Camera original = working.Original(refined, camera);
  EXPECT_NEAR(original.fx, 1.02 * camera.fx, 1e-9);
  EXPECT_NEAR(original.cx, camera.cx + 3.0 / working.scale(), 1e-9);
  EXPECT_EQ(original.fy, camera.fy);
  EXPECT_EQ(original.cy, camera.cy);
}

TEST(WorkingSize, RefusesImagesAndCamerasOfAnotherSize) {
  const WorkingSize working({2880, 2160}, kUsual_px);
  EXPECT_THROW(working.Reduced(cv::Mat(480, 640, CV_8UC1)), std::invalid_argument);
  EXPECT_THROW(working.Reduced(Camera()), std::invalid_argument);
  EXPECT_TRUE(working.Reduced(cv::Mat()).empty());
}

TEST(WorkingSize, MasksWhatIsMaskedInPart) {
  const WorkingSize working({645, 483}, 320);
  cv::Mat image(483, 645, CV_8U, cv::Scalar(255));
  image.at<std::uint8_t>(101, 203) = 0;
  const Mask mask{image};
  const cv::Mat reduced = working.Reduced(mask).ToImage();
  EXPECT_EQ(reduced.size(), working.size());
  EXPECT_EQ(static_cast<int>(reduced.total()) - cv::countNonZero(reduced), 1);
  const cv::Mat original = working.Original(Mask{reduced}).ToImage();
  EXPECT_EQ(original.size(), image.size());
  EXPECT_EQ(original.at<std::uint8_t>(101, 203), 0);
}

TEST(WorkingSize, TracksComeBack) {
  const WorkingSize working({4000, 2250}, kUsual_px);
  std::vector<Track> tracks(1);
  tracks[0].observations.push_back({FrameId{3}, {1999.5, 7.25}, Eigen::Vector3d::UnitZ(), 2.5});
  std::vector<Track> same = tracks;
  ToWorkingSize(working, same);
  EXPECT_NEAR(same[0].observations[0].keypoint_px.x(), 799.5, 1e-9);
  EXPECT_NEAR(same[0].observations[0].sigma_px, 1.0, 1e-12);
  ToOriginalSize(working, same);
  EXPECT_LT((same[0].observations[0].keypoint_px - tracks[0].observations[0].keypoint_px).norm(),
            1e-9);
  EXPECT_NEAR(same[0].observations[0].sigma_px, 2.5, 1e-12);
}

SlamOptions OptionsOfReducedWalk() {
  SlamOptions options;
  options.max_image_side_px = 200;
  options.rotodom.features.max_features = 600;
  options.num_threads = 2;
  return options;
}

TEST(RunSlamAtWorkingSize, GivesResultsOfTheOriginalImages) {
  const SimulatedSequence walk = RenderWalk(24);
  ImageSource frames(walk);
  cv::Mat lower_edge(240, 320, CV_8U, cv::Scalar(255));
  lower_edge.rowRange(225, 240) = 0;
  SlamInputs inputs;
  inputs.masks.AddToAll(Mask(lower_edge));
  SlamObserver nobody;
  const SlamResult result = RunSlam(frames, walk.camera, OptionsOfReducedWalk(), nobody, inputs);
  EXPECT_NEAR(result.orientations.working_scale, 4.0 / 7.0, 1e-12);
  EXPECT_EQ(result.orientations.camera, walk.camera);
  EXPECT_EQ(cv::norm(result.orientations.masks.common().ToImage(), lower_edge, cv::NORM_INF), 0.0);
  ASSERT_TRUE(result.map.failure.empty()) << result.map.failure;
  EXPECT_EQ(result.map.camera.width, 320);

  double largest_x = 0.0;
  for (const auto& [frame, features] : result.orientations.features) {
    for (int k = 0; k < features.size(); ++k) {
      largest_x = std::max(largest_x, features.keypoints_px[k].x());
      const auto px = walk.camera.Project(features.bearings[k]);
      ASSERT_TRUE(px);
      EXPECT_LT((*px - features.keypoints_px[k]).norm(), 1e-6);
    }
  }
  EXPECT_GT(largest_x, 280.0);

  int num_observations = 0;
  for (const Track& track : result.map.map.tracks) {
    for (const Observation& seen : track.observations) {
      const Eigen::Vector3d point = result.map.map.cam_from_world.at(seen.frame) *
                                    Eigen::Vector3d(result.map.map.point_in_world.at(track.id) -
                                                    result.map.map.center_in_world.at(seen.frame));
      const auto px = result.map.camera.Project(point);
      ASSERT_TRUE(px);
      EXPECT_LT((*px - seen.keypoint_px).norm(), 8.0);
      ++num_observations;
    }
  }
  EXPECT_GT(num_observations, 200);

  const auto& truth = walk.truth;
  for (const auto& [frame, rotation] : result.map.cam_from_world) {
    const Rotation found = rotation * result.map.cam_from_world.begin()->second.Inverse();
    const Rotation turn = truth[frame.value].world_from_cam.Inverse() * truth[0].world_from_cam;
    EXPECT_LT((found * turn.Inverse()).AngleDeg(), 0.5) << frame.value;
  }
}

TEST(RunSlamAtWorkingSize, EstimatesTheLensInOriginalPixels) {
  const SimulatedSequence walk = RenderWalk(48);
  ImageSource frames(walk);
  SlamInputs inputs;
  inputs.estimate_lens = true;
  SlamObserver nobody;
  const SlamResult result = RunSlam(frames,
                                    UncalibratedCamera({320, 240}, 1.15 * walk.camera.fx),
                                    OptionsOfReducedWalk(),
                                    nobody,
                                    inputs);
  ASSERT_TRUE(result.lens);
  EXPECT_NEAR(result.lens->camera.fx / walk.camera.fx, 1.0, 0.1);
  EXPECT_EQ(result.lens->camera.width, 320);
  EXPECT_NEAR(result.map.camera.fx / walk.camera.fx, 1.0, 0.1);
}

}  // namespace
}  // namespace rotslam
