#include "apps/paper_method/paper_odometry.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "apps/paper_method/paper_options.h"
#include "apps/simulation/simulation.h"

namespace rotslam {
namespace {

const SimulatedSequence& Street() {
  static const SimulatedSequence sequence = [] {
    SimulationOptions options;
    options.kind = SimulationKind::kStreet;
    options.frames = 12;
    options.camera = CameraWithView(620, 188, 80.0);
    return RenderSequence(options, 2);
  }();
  return sequence;
}

PaperOdometryOptions SmallOptions() {
  PaperOdometryOptions options;
  options.odometry = PaperDefaults();
  options.odometry.features.max_features = 1000;
  return options;
}

struct PaperRun {
  std::vector<PaperFrame> frames;
  RotationMap cam_from_world;
  ViewGraph graph;
};

PaperRun Follow(const SimulatedSequence& sequence, const PaperOdometryOptions& options) {
  PaperOdometry odometry(sequence.camera, options);
  PaperRun run;
  for (int k = 0; k < static_cast<int>(sequence.images.size()); ++k) {
    run.frames.push_back(odometry.AddFrame(FrameId{k}, sequence.images[k]));
  }
  run.cam_from_world = odometry.cam_from_world();
  run.graph = odometry.graph();
  return run;
}

// Root mean square of the errors of the turns from frame to frame.
double StepErrorDeg(const RotationMap& cam_from_world, const Trajectory& truth) {
  double squares = 0.0;
  const int count = static_cast<int>(truth.size());
  for (int k = 1; k < count; ++k) {
    const Rotation turn =
        cam_from_world.at(FrameId{k}) * cam_from_world.at(FrameId{k - 1}).Inverse();
    const Rotation true_turn = truth[k].world_from_cam.Inverse() * truth[k - 1].world_from_cam;
    squares += std::pow((turn * true_turn.Inverse()).AngleDeg(), 2);
  }
  return std::sqrt(squares / (count - 1));
}

TEST(PaperOdometry, FollowsAStreet) {
  const PaperRun run = Follow(Street(), SmallOptions());
  for (std::size_t k = 1; k < run.frames.size(); ++k) {
    EXPECT_FALSE(run.frames[k].predicted_only);
    EXPECT_GE(run.frames[k].edges.size(), std::min<std::size_t>(k, 2));
    EXPECT_LE(run.frames[k].edges.size(), 4U);
    for (const RelativeRotation& edge : run.frames[k].edges) EXPECT_GT(edge.num_inliers, 100);
  }
  // Twice what was measured.
  EXPECT_LT(StepErrorDeg(run.cam_from_world, Street().truth), 0.13);
}

TEST(PaperOdometry, GivesTheSameBytesForTheSameSeed) {
  SimulatedSequence sequence = Street();
  sequence.images.resize(5);
  PaperOdometryOptions options = SmallOptions();
  const PaperRun one = Follow(sequence, options);
  options.num_threads = 3;
  const PaperRun three = Follow(sequence, options);
  options.seed = 2;
  const PaperRun other = Follow(sequence, options);
  bool differs = false;
  for (const auto& [frame, rotation] : one.cam_from_world) {
    const Eigen::Vector4d coefficients = rotation.Quaternion().coeffs();
    EXPECT_EQ(coefficients, three.cam_from_world.at(frame).Quaternion().coeffs());
    differs |= coefficients != other.cam_from_world.at(frame).Quaternion().coeffs();
  }
  EXPECT_TRUE(differs);
}

// Past a frame that shows nothing the others still see each other.
TEST(PaperOdometry, GoesOnPastAFrameWithoutAnImage) {
  SimulatedSequence sequence = Street();
  sequence.images.resize(10);
  sequence.truth.resize(10);
  sequence.images[5] = cv::Mat();
  sequence.images[6] = cv::Mat(sequence.images[4].size(), CV_8U, cv::Scalar(90));
  const PaperRun run = Follow(sequence, SmallOptions());
  EXPECT_TRUE(run.frames[5].predicted_only);
  EXPECT_TRUE(run.frames[6].predicted_only);
  EXPECT_FALSE(run.frames[7].predicted_only);
  const Rotation turn =
      run.cam_from_world.at(FrameId{9}) * run.cam_from_world.at(FrameId{0}).Inverse();
  const Rotation true_turn =
      sequence.truth[9].world_from_cam.Inverse() * sequence.truth[0].world_from_cam;
  EXPECT_LT((turn * true_turn.Inverse()).AngleDeg(), 0.5);
}

// There, back, and there once more: the same pictures come again.
TEST(PaperOdometry, FindsALoop) {
  SimulatedSequence sequence;
  sequence.camera = Street().camera;
  for (int k = 0; k < 12; ++k) sequence.images.push_back(Street().images[k]);
  for (int k = 11; k >= 0; --k) sequence.images.push_back(Street().images[k]);
  const PaperRun run = Follow(sequence, SmallOptions());
  const auto has_loop = [](const PaperFrame& frame) {
    return std::any_of(frame.loops.begin(), frame.loops.end(), [](const LoopCheck& check) {
      return check.accepted && check.frame.value - check.match.value > 10;
    });
  };
  EXPECT_TRUE(std::any_of(run.frames.begin(), run.frames.end(), has_loop));
  // The last picture is the first.
  EXPECT_LT(
      (run.cam_from_world.at(FrameId{23}) * run.cam_from_world.at(FrameId{0}).Inverse()).AngleDeg(),
      0.1);
}

TEST(PaperOdometry, RefusesOptionsOutOfRange) {
  PaperOdometryOptions options = SmallOptions();
  options.odometry.averaging.window = 0;
  EXPECT_THROW(PaperOdometry(Street().camera, options), std::invalid_argument);
  EXPECT_THROW(PaperOdometry(Camera(), SmallOptions()), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
