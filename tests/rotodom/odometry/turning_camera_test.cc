// The odometry on a camera that only turns, in a world that is infinitely far away: how the
// view-graph grows and shrinks, what a jump does, and rolling shutters.

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "rotodom/odometry.h"
#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

constexpr double kFps = 30.0;

using Motion = std::function<Rotation(double time_s)>;  // cam_from_world

Rotation TurnDeg(double x_deg, double y_deg, double z_deg) {
  return Rotation::Exp(kRadFromDeg * Eigen::Vector3d(x_deg, y_deg, z_deg));
}

OdometryOptions FewFeatures() {
  OdometryOptions options;
  options.features.max_features = 400;
  return options;
}

// Every row shows what the camera saw when it was exposed.
std::vector<cv::Mat> Film(const Motion& cam_from_world, int num_frames, double readout_s = 0.0) {
  static const TexturedWorld world;
  Camera camera = SmallCamera();
  camera.readout_s = readout_s;
  std::vector<cv::Mat> images;
  for (int k = 0; k < num_frames; ++k) {
    images.push_back(world.ViewByRow(camera, [&](int row) {
      return cam_from_world(k / kFps + camera.ExposureTime(Eigen::Vector2d(0, row)));
    }));
  }
  return images;
}

std::vector<FrameEstimate> Follow(const std::vector<cv::Mat>& images,
                                  const Camera& camera,
                                  const OdometryOptions& options = FewFeatures(),
                                  int num_threads = 1) {
  RotationalOdometry odometry(camera, options, 1, num_threads);
  std::vector<FrameEstimate> estimates;
  for (int k = 0; k < static_cast<int>(images.size()); ++k) {
    estimates.push_back(odometry.AddFrame(FrameId{k}, k / kFps, images[k]));
  }
  return estimates;
}

std::vector<FrameEstimate> Follow(const std::vector<cv::Mat>& images,
                                  double readout_s = 0.0,
                                  const OdometryOptions& options = FewFeatures(),
                                  int num_threads = 1) {
  Camera camera = SmallCamera();
  camera.readout_s = readout_s;
  return Follow(images, camera, options, num_threads);
}

OdometryResult Collect(const std::vector<FrameEstimate>& estimates) {
  OdometryResult result;
  for (const FrameEstimate& estimate : estimates) result.Add(estimate, true);
  return result;
}

// Root mean square over steps of `gap` frames, deg.
double RelativeErrorDeg(const RotationMap& estimate, const Motion& cam_from_world, int gap) {
  constexpr int kFirst = 0;
  double sum = 0.0;
  int count = 0;
  for (int k = kFirst; k + gap < static_cast<int>(estimate.size()); ++k) {
    const Rotation found = estimate.at(FrameId{k + gap}) * estimate.at(FrameId{k}).Inverse();
    const Rotation truth = cam_from_world((k + gap) / kFps) * cam_from_world(k / kFps).Inverse();
    sum += std::pow((found * truth.Inverse()).AngleDeg(), 2);
    ++count;
  }
  return std::sqrt(sum / count);
}

bool HasEdge(const FrameEstimate& estimate, int i) {
  return std::any_of(
      estimate.connections.begin(),
      estimate.connections.end(),
      [&](const EdgeWithMatches& connection) { return connection.edge.i == FrameId{i}; });
}

// A camera that looks around without ever leaving its first view.
Rotation LookAround(double time_s) {
  return TurnDeg(
      3.0 * std::sin(5.0 * time_s), 4.0 * std::sin(4.0 * time_s), std::sin(3.0 * time_s));
}

// 50 deg from left to right, at 75 deg/s; the image is 65 deg wide.
Rotation PanAcross(double time_s) { return TurnDeg(0.0, -25.0 + 75.0 * time_s, 0.0); }

TEST(RotatingCamera, KeyframeEdgesLastAsLongAsTheOverlap) {
  const int window = ViewGraphOptions{}.window_frames;
  const std::vector<FrameEstimate> staying = Follow(Film(LookAround, 20));
  for (int k = window + 1; k < 20; ++k) {
    EXPECT_TRUE(HasEdge(staying[k], 0)) << "frame " << k;  // the first frame is a keyframe
    EXPECT_FALSE(staying[k].report.weak);
  }

  const std::vector<FrameEstimate> leaving = Follow(Film(PanAcross, 20));
  EXPECT_TRUE(HasEdge(leaving[window + 1], 0));
  int last_with_first = 0;
  int last_with_old = 0;
  for (int k = 0; k < 20; ++k) {
    if (HasEdge(leaving[k], 0)) last_with_first = k;
    for (const EdgeWithMatches& connection : leaving[k].connections) {
      if (connection.edge.i.value < k - window) last_with_old = k;
      EXPECT_GT(connection.edge.num_inliers, ViewGraphOptions{}.min_edge_inliers);
    }
    EXPECT_LE(static_cast<int>(leaving[k].connections.size()),
              window + ViewGraphOptions{}.max_keyframe_edges);
  }
  EXPECT_LT(last_with_first, 19);  // what it showed has gone
  EXPECT_EQ(last_with_old, 19);    // newer keyframes have taken its place
}

TEST(RotatingCamera, DriftsLittleWhileItStays) {
  constexpr double kNoise = 6.0;  // grey levels
  std::vector<cv::Mat> images = Film(LookAround, 40);
  cv::RNG random(1);
  for (cv::Mat& image : images) {
    cv::Mat noise(image.size(), CV_16S);
    random.fill(noise, cv::RNG::NORMAL, 0.0, kNoise);
    cv::add(image, noise, image, cv::noArray(), CV_8U);
  }
  const auto error_deg = [&](int max_keyframe_edges, int gap) {
    OdometryOptions options = FewFeatures();
    options.view_graph.max_keyframe_edges = max_keyframe_edges;
    return RelativeErrorDeg(Collect(Follow(images, 0.0, options)).cam_from_world, LookAround, gap);
  };
  const double step_deg = error_deg(3, 1);
  const double with_deg = error_deg(3, 25);
  const double without_deg = error_deg(0, 25);
  RecordProperty("step_deg", std::to_string(step_deg));
  RecordProperty("with_deg", std::to_string(with_deg));
  RecordProperty("without_deg", std::to_string(without_deg));
  EXPECT_LT(step_deg, 0.005);
  EXPECT_LT(with_deg, 3.0 * step_deg);  // a walk of 25 independent steps has 5
  // Tracks that last carry the drift down already; edges to keyframes follow the same tracks.
  EXPECT_LT(with_deg, 1.1 * without_deg);
}

TEST(RotatingCamera, TheWindowStaysAsLargeAsItIs) {
  const std::vector<FrameEstimate> estimates = Follow(Film(LookAround, 24));
  const int room = AveragingOptions{}.window;
  for (int k = room; k < 24; ++k) {
    EXPECT_EQ(static_cast<int>(estimates[k].window.size()), room);
    EXPECT_EQ(estimates[k].window.begin()->first, FrameId{k - room + 1});
    EXPECT_LE(estimates[k].features.size(), FewFeatures().features.max_features);
  }
}

TEST(RotatingCamera, AJumpIsFoundByDescriptors) {
  constexpr int kJump = 6;
  // 22 deg to the right and a roll of 10 deg between two frames, after standing nearly still.
  const Motion motion = [](double time_s) {
    const bool after = time_s > (kJump - 0.5) / kFps;
    return TurnDeg(2.0 * time_s, after ? 11.0 : -11.0, after ? 10.0 : 0.0);
  };
  const std::vector<FrameEstimate> estimates = Follow(Film(motion, 12));
  for (int k = 0; k < 12; ++k) {
    // The frame after the jump is expected to jump once more.
    if (k != kJump + 1) {
      EXPECT_EQ(estimates[k].report.searched_wide, k == kJump) << "frame " << k;
    }
    EXPECT_FALSE(estimates[k].report.predicted_only) << "frame " << k;
  }
  const double rpe1_deg = RelativeErrorDeg(Collect(estimates).cam_from_world, motion, 1);
  RecordProperty("rpe1_deg", std::to_string(rpe1_deg));
  EXPECT_LT(rpe1_deg, 0.02);
}

// Up to 75 deg/s, and the rate turns round in a third of a second: a frame's skew changes from one
// to the next.
Rotation Shake(double time_s) {
  return TurnDeg(
      2.5 * std::sin(11.0 * time_s), 7.0 * std::sin(9.0 * time_s), 3.0 * std::sin(7.0 * time_s));
}

TEST(RollingShutter, IsTakenOutWhereTheReadoutIsKnown) {
  constexpr double kReadoutS = 0.025;
  const std::vector<cv::Mat> images = Film(Shake, 30, kReadoutS);
  const RotationMap unknown = Collect(Follow(images)).cam_from_world;
  const RotationMap known = Collect(Follow(images, kReadoutS)).cam_from_world;
  const RotationMap twice = Collect(Follow(images, 2.0 * kReadoutS)).cam_from_world;
  for (const int gap : {1, 5}) {
    const double unknown_deg = RelativeErrorDeg(unknown, Shake, gap);
    const double known_deg = RelativeErrorDeg(known, Shake, gap);
    const double twice_deg = RelativeErrorDeg(twice, Shake, gap);
    const std::string at = "_at_gap_" + std::to_string(gap);
    RecordProperty("unknown_deg" + at, std::to_string(unknown_deg));
    RecordProperty("known_deg" + at, std::to_string(known_deg));
    RecordProperty("twice_deg" + at, std::to_string(twice_deg));
    EXPECT_LT(known_deg, 0.25 * unknown_deg) << "gap " << gap;
    EXPECT_LT(known_deg, 0.25 * twice_deg) << "gap " << gap;
    EXPECT_LT(known_deg, 0.015) << "gap " << gap;
  }
}

// A phone held upright: its images are turned clockwise, what was at the top is at the right.
TEST(RollingShutter, StartsAtTheRightOfImagesThatAreTurned) {
  std::vector<cv::Mat> images = Film(Shake, 30, 0.025);
  for (cv::Mat& image : images) cv::rotate(image, image, cv::ROTATE_90_CLOCKWISE);
  Camera camera = SmallCamera();
  std::swap(camera.width, camera.height);
  std::swap(camera.cx, camera.cy);
  camera.readout_s = 0.025;
  const auto error_deg = [&](ReadoutStart start) {
    camera.readout_from = start;
    return RelativeErrorDeg(
        Collect(Follow(images, camera)).cam_from_world,
        [](double time_s) { return TurnDeg(0.0, 0.0, 90.0) * Shake(time_s); },
        1);
  };
  const double right_deg = error_deg(ReadoutStart::kRight);
  RecordProperty("right_deg", std::to_string(right_deg));
  EXPECT_LT(right_deg, 0.01);
  for (const ReadoutStart wrong : {ReadoutStart::kTop, ReadoutStart::kLeft}) {
    EXPECT_GT(error_deg(wrong), 4.0 * right_deg) << Name(wrong);
  }
}

TEST(RollingShutter, AGlobalOneIsNotToBeCorrected) {
  EXPECT_EQ(Camera{}.readout_s, 0.0);
  const std::vector<cv::Mat> images = Film(Shake, 20);
  const auto error_deg = [&](double readout_s) {
    return RelativeErrorDeg(Collect(Follow(images, readout_s)).cam_from_world, Shake, 1);
  };
  const double global_deg = error_deg(0.0);
  RecordProperty("global_deg", std::to_string(global_deg));
  EXPECT_LT(global_deg, 0.003);
  EXPECT_GT(error_deg(0.025), 10.0 * global_deg);
}

// At a steady rate every frame is skewed alike.
TEST(RollingShutter, HurtsLittleAtASteadyRate) {
  const Motion steady = [](double time_s) { return TurnDeg(0.0, -12.0 + 30.0 * time_s, 0.0); };
  const double known_deg =
      RelativeErrorDeg(Collect(Follow(Film(steady, 20, 0.025), 0.025)).cam_from_world, steady, 1);
  RecordProperty("known_deg", std::to_string(known_deg));
  EXPECT_LT(known_deg, 0.003);
}

TEST(RollingShutter, RevisesTheEdgesOfTheFrameBefore) {
  const std::vector<FrameEstimate> rolling = Follow(Film(Shake, 10, 0.025), 0.025);
  EXPECT_TRUE(rolling[0].revised_edges.empty());
  EXPECT_TRUE(rolling[1].revised_edges.empty());
  for (int k = 2; k < 10; ++k) {
    EXPECT_FALSE(rolling[k].revised_edges.empty()) << "frame " << k;
    // At the beginning all of them: the motion there is told by few frames.
    const int oldest = k < ViewGraphOptions{}.window_frames ? 1 : k - 1;
    for (const RelativeRotation& edge : rolling[k].revised_edges) {
      EXPECT_GE(edge.j, FrameId{oldest});
      EXPECT_LT(edge.j, FrameId{k});
      EXPECT_TRUE(HasEdge(rolling[edge.j.value], edge.i.value));
    }
  }
  // They replace those before them.
  std::size_t num_edges = 0;
  for (const FrameEstimate& estimate : rolling) num_edges += estimate.connections.size();
  EXPECT_EQ(Collect(rolling).graph.edges().size(), num_edges);
}

// What the shutter bends must not pass for a baseline.
TEST(RollingShutter, LeavesATurnInPlaceOne) {
  const OdometryResult shaken = Collect(Follow(Film(Shake, 30, 0.025), 0.025));
  int num_rotating = 0;
  for (const RelativeRotation& edge : shaken.graph.edges()) num_rotating += edge.rotation_only;
  const double share = num_rotating / static_cast<double>(shaken.graph.edges().size());
  RecordProperty("share", std::to_string(share));
  EXPECT_GT(share, 0.9);
}

TEST(RollingShutter, SameBytesAtAnyThreadCount) {
  const std::vector<cv::Mat> images = Film(Shake, 10, 0.025);
  const RotationMap one = Collect(Follow(images, 0.025, FewFeatures(), 1)).cam_from_world;
  for (const int num_threads : {2, 5}) {
    const RotationMap many =
        Collect(Follow(images, 0.025, FewFeatures(), num_threads)).cam_from_world;
    ASSERT_EQ(one.size(), many.size());
    for (const auto& [frame, rotation] : one) {
      EXPECT_EQ(rotation.Quaternion().coeffs(), many.at(frame).Quaternion().coeffs());
    }
  }
}

// Stands, turns away by 36 deg in half a second, and stands: up to 470 px/s.
Rotation LookAside(double time_s) {
  const double share = std::clamp((time_s - 0.2) / 0.5, 0.0, 1.0);
  return TurnDeg(0.0, 36.0 * share * share * (3.0 - 2.0 * share) - 18.0, 0.0);
}

constexpr double kExposureS = 0.02;

// 9 px of blur at the fastest.
const std::vector<cv::Mat>& BlurredFilm() {
  static const std::vector<cv::Mat> film = [] {
    const TexturedWorld world;
    std::vector<cv::Mat> images;
    for (int k = 0; k < 27; ++k) {
      images.push_back(world.ExposedView(SmallCamera(), LookAside, k / kFps, kExposureS));
    }
    return images;
  }();
  return film;
}

double TurnedShare(const OdometryResult& result) {
  const std::vector<RelativeRotation>& edges = result.graph.edges();
  const auto turned = std::count_if(
      edges.begin(), edges.end(), [](const RelativeRotation& edge) { return edge.rotation_only; });
  return static_cast<double>(turned) / static_cast<double>(edges.size());
}

TEST(Blur, IsNoMovementWhereBothImagesAreBlurredAlike) {
  OdometryOptions as_they_are = FewFeatures();
  as_they_are.tracking.match_blur = false;
  const OdometryResult blurred = Collect(Follow(BlurredFilm(), 0.0, as_they_are));
  const OdometryResult alike = Collect(Follow(BlurredFilm()));
  const double blurred_deg = RelativeErrorDeg(blurred.cam_from_world, LookAside, 1);
  const double alike_deg = RelativeErrorDeg(alike.cam_from_world, LookAside, 1);
  RecordProperty("deg", std::to_string(blurred_deg) + " -> " + std::to_string(alike_deg));
  RecordProperty(
      "turned", std::to_string(TurnedShare(blurred)) + " -> " + std::to_string(TurnedShare(alike)));
  EXPECT_LT(TurnedShare(blurred), 0.7);
  EXPECT_GT(TurnedShare(alike), 0.95);
  EXPECT_LT(alike_deg, 0.5 * blurred_deg);
}

TEST(Blur, TellsTheTimeOfExposure) {
  RotationalOdometry odometry(SmallCamera(), FewFeatures(), 1, 1);
  for (int k = 0; k < 27; ++k) odometry.AddFrame(FrameId{k}, k / kFps, BlurredFilm()[k]);
  EXPECT_NEAR(odometry.exposure_s(), kExposureS, 0.002);
  RotationalOdometry sharp(SmallCamera(), FewFeatures(), 1, 1);
  const std::vector<cv::Mat> film = Film(LookAside, 27);
  for (int k = 0; k < 27; ++k) sharp.AddFrame(FrameId{k}, k / kFps, film[k]);
  EXPECT_EQ(sharp.exposure_s(), 0.0);
}

TEST(Blur, IsRememberedInTheState) {
  RotationalOdometry odometry(SmallCamera(), FewFeatures(), 1, 1);
  for (int k = 0; k < 13; ++k) odometry.AddFrame(FrameId{k}, k / kFps, BlurredFilm()[k]);
  EXPECT_GT(odometry.exposure_s(), 0.0);
  RotationalOdometry resumed(SmallCamera(), FewFeatures(), 1, 1);
  resumed.RestoreState(odometry.SaveState());
  EXPECT_EQ(resumed.exposure_s(), odometry.exposure_s());
  for (int k = 13; k < 17; ++k) {
    const FrameEstimate a = odometry.AddFrame(FrameId{k}, k / kFps, BlurredFilm()[k]);
    const FrameEstimate b = resumed.AddFrame(FrameId{k}, k / kFps, BlurredFilm()[k]);
    EXPECT_EQ(a.features.keypoints_px, b.features.keypoints_px) << "frame " << k;
  }
}

}  // namespace
}  // namespace rotslam
