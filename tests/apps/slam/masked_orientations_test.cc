#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "apps/slam/map_views.h"
#include "apps/slam/orientation_collector.h"
#include "apps/slam/orientations.h"
#include "apps/slam/slam.h"
#include "tests/apps/slam/image_source.h"

namespace rotslam {
namespace {

constexpr int kNumMaskedFrames = 90;

// A walk of 320 x 240 pixels.
const SimulatedSequence& LongWalk() {
  static const SimulatedSequence walk = RenderWalk(kNumMaskedFrames);
  return walk;
}

// The same with text over much of the picture.
SimulatedSequence WithText(SimulatedSequence sequence) {
  for (cv::Mat& image : sequence.images) {
    for (int y = 25; y < 240; y += 45) {
      for (const auto& [ink, thickness] : {std::pair(0, 5), std::pair(255, 2)}) {
        cv::putText(image,
                    "16.2V 98 31.8M",
                    {10, y},
                    cv::FONT_HERSHEY_DUPLEX,
                    0.9,
                    cv::Scalar::all(ink),
                    thickness);
      }
    }
  }
  return sequence;
}

double TurnErrorDeg(const RotationMap& cam_from_world, const Trajectory& truth) {
  double largest = 0.0;
  for (const auto& [frame, rotation] : cam_from_world) {
    const Rotation found = rotation * cam_from_world.begin()->second.Inverse();
    const Rotation turn = truth[frame.value].world_from_cam.Inverse() * truth[0].world_from_cam;
    largest = std::max(largest, (found * turn.Inverse()).AngleDeg());
  }
  return largest;
}

// Remembers what static content it is told of.
class StaticContentObserver : public SlamObserver {
 public:
  void OnStaticContent(const StaticContent& content) override { told.push_back(content); }

  std::vector<StaticContent> told;
};

Orientations FindIn(const SimulatedSequence& sequence,
                    StaticContentObserver& observer,
                    const OrientationInputs& inputs = {}) {
  ImageSource frames(sequence);
  return FindOrientations(frames, sequence.camera, SlamOptions(), inputs, observer);
}

TEST(MaskedOrientations, HaveNoFeaturesInMaskedParts) {
  SimulatedSequence walk = LongWalk();
  walk.images.resize(12);
  walk.truth.resize(12);
  cv::Mat left_half(240, 320, CV_8U, cv::Scalar(255));
  left_half(cv::Rect(0, 0, 160, 240)) = 0;
  OrientationInputs inputs;
  inputs.masks.AddToAll(Mask(left_half));
  StaticContentObserver observer;
  const Orientations orientations = FindIn(walk, observer, inputs);
  ASSERT_EQ(orientations.features.size(), 12U);
  for (const auto& [frame, features] : orientations.features) {
    EXPECT_GT(features.size(), 50);
    for (const Eigen::Vector2d& px : features.keypoints_px) EXPECT_GT(px.x(), 161.0);
  }
  ImageSource images(walk);
  const MapViews views = ReadMapViews(images, {FrameId{3}}, orientations, [](const auto&) {});
  EXPECT_TRUE(views.at(FrameId{3}).mask.Covers({80.0, 100.0}, 0.0));
  const auto described = DescribeViews(views, walk.camera, {}, 1);
  for (const Eigen::Vector2d& px : described.at(FrameId{3}).keypoints_px) EXPECT_GT(px.x(), 161.0);
}

TEST(MaskedOrientations, CleanSequencesTellNothing) {
  StaticContentObserver observer;
  const Orientations orientations = FindIn(LongWalk(), observer);
  EXPECT_TRUE(observer.told.empty());
  EXPECT_TRUE(orientations.masks.IsEmpty());
}

TEST(MaskedOrientations, TextOnThePictureIsIgnored) {
  StaticContentObserver observer;
  const SimulatedSequence walk = WithText(LongWalk());
  const Orientations orientations = FindIn(walk, observer);
  ASSERT_EQ(observer.told.size(), 1U);
  EXPECT_EQ(observer.told[0].kind, StaticContentKind::kOnPicture);
  EXPECT_EQ(orientations.static_content.kind, StaticContentKind::kOnPicture);
  EXPECT_GT(orientations.masks.common().Share(), 0.1);
  EXPECT_EQ(orientations.timestamps_s.size(), kNumMaskedFrames);
  EXPECT_LT(TurnErrorDeg(orientations.cam_from_world, walk.truth), 0.5);

  OrientationInputs off;
  off.find_static_content = false;
  StaticContentObserver nobody;
  const Orientations kept = FindIn(walk, nobody, off);
  EXPECT_TRUE(nobody.told.empty());
  EXPECT_TRUE(kept.masks.IsEmpty());
}

// A camera that stands at a place of few corners while cars full of them pass.
SimulatedSequence Traffic() {
  SimulatedSequence sequence = LongWalk();
  cv::Mat place;
  cv::GaussianBlur(LongWalk().images[0], place, {}, 2.0);
  if (place.channels() == 3) cv::cvtColor(place, place, cv::COLOR_BGR2GRAY);
  cv::Mat car(70, 120, CV_8U);
  cv::RNG(3).fill(car, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(car, car, {}, 1.5);
  for (int k = 0; k < kNumMaskedFrames; ++k) {
    cv::Mat image = place.clone();
    for (const auto& [x, y] : {std::pair(5 * k, 40),
                               std::pair(5 * k + 230, 40),
                               std::pair(1000 - 4 * k, 150),
                               std::pair(1220 - 4 * k, 150)}) {
      const cv::Rect box(x % 460 - 120, y, car.cols, car.rows);
      const cv::Rect seen = box & cv::Rect({0, 0}, image.size());
      if (!seen.empty()) car(seen - box.tl()).copyTo(image(seen));
    }
    cv::Mat noise(image.size(), CV_16S);
    cv::RNG(100 + k).fill(noise, cv::RNG::NORMAL, 0.0, 1.5);
    cv::add(image, noise, image, cv::noArray(), CV_8U);
    sequence.images[k] = image;
  }
  return sequence;
}

TEST(MaskedOrientations, ACameraThatStandsIsStill) {
  StaticContentObserver observer;
  const SimulatedSequence traffic = Traffic();
  ImageSource frames(traffic);
  const SlamResult result = RunSlam(frames, traffic.camera, SlamOptions(), observer);
  ASSERT_EQ(observer.told.size(), 1U);
  EXPECT_TRUE(result.orientations.CameraStands());
  EXPECT_TRUE(result.map.rotates_throughout);
  EXPECT_TRUE(result.map.failure.empty());
  ASSERT_EQ(result.map.segments.size(), 1U);
  ASSERT_EQ(result.map.segments[0].still.size(), 1U);
  EXPECT_EQ(result.map.segments[0].still[0].last, FrameId{kNumMaskedFrames - 1});
  for (const auto& [frame, rotation] : result.map.cam_from_world) {
    EXPECT_LT(rotation.AngleDeg(), 1e-9);
  }
}

}  // namespace
}  // namespace rotslam
