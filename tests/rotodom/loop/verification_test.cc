#include "rotodom/loop/verification.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>
#include <utility>

#include <Eigen/Eigenvalues>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/rotodom/loop/random_vocabulary.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

using testing::ElementsAre;

// Four views side by side on a ring around the points: 0 to 2 are old, the last one is seen again
// a little later. All orientations are true.
constexpr int kPresent = 3;

Scene RingScene(double outlier_ratio = 0.0) {
  SceneOptions options;
  options.num_views = 72;
  options.num_points = 400;
  options.noise_px = 0.3;
  options.outlier_ratio = outlier_ratio;
  return MakeScene(options);
}

void AddRow(const BinaryDescriptor& descriptor, cv::Mat& rows) {
  cv::Mat row(1, 32, CV_8UC1);
  std::memcpy(row.ptr<std::uint8_t>(), descriptor.data(), 32);
  rows.push_back(row);
}

// What a view shows of the scene, each point described as in all other views but for ten bits.
// @param world  another number, other descriptors.
Features Describe(const Scene& scene, int view, std::uint64_t world = 1) {
  const std::vector<BinaryDescriptor> descriptors = RandomDescriptors(400, world);
  std::mt19937_64 random(100 * world + view);
  Features features;
  features.frame = FrameId{view};
  for (const Track& track : scene.tracks) {
    for (const Observation& observation : track.observations) {
      if (observation.frame != FrameId{view}) continue;
      features.keypoints_px.push_back(observation.keypoint_px);
      features.bearings.push_back(observation.bearing);
      features.levels.push_back(0);
      features.angles_rad.push_back(0.0F);
      features.tracks.push_back(track.id);
      AddRow(Noisy(descriptors[track.id.value], 10, random), features.descriptors);
    }
  }
  return features;
}

// The same look, but every corner is where another one was.
void ShufflePositions(Features& features, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  for (int n = features.size() - 1; n > 0; --n) {
    const auto other = static_cast<int>(random() % (n + 1));
    std::swap(features.keypoints_px[n], features.keypoints_px[other]);
    std::swap(features.bearings[n], features.bearings[other]);
  }
}

// The same look, but every corner is up to `reach_px` in x and y from where it was.
void Displace(Features& features, const Camera& camera, double reach_px, std::uint64_t seed) {
  SceneRandom random(seed);
  for (int n = 0; n < features.size(); ++n) {
    features.keypoints_px[n] +=
        Eigen::Vector2d(random.Uniform(-reach_px, reach_px), random.Uniform(-reach_px, reach_px));
    features.bearings[n] = *camera.Unproject(features.keypoints_px[n]);
  }
}

// All that VerifyLoop takes; a test changes some of it.
struct Case {
  Scene scene;
  Features view;
  std::vector<Features> old_places;  // the candidate is place 1
  RotationMap cam_from_world;
  RotationRates rates;
  int num_consistent = 1;
  bool are_linked = true;
  VerificationOptions options;
  VerificationTools tools;

  LoopEvidence Verify() const {
    std::vector<const Features*> places;
    places.reserve(old_places.size());
    for (const Features& place : old_places) places.push_back(&place);
    return VerifyLoop({view, places, cam_from_world, rates, num_consistent, are_linked},
                      scene.camera,
                      options,
                      tools);
  }

  void Turn(int frame, double angle_deg) {
    Rotation& rotation = cam_from_world.at(FrameId{frame});
    rotation = Rotation::Exp({0.0, angle_deg * kRadFromDeg, 0.0}) * rotation;
  }

  Features& Place(int frame) {
    return *std::find_if(old_places.begin(), old_places.end(), [&](const Features& place) {
      return place.frame == FrameId{frame};
    });
  }
};

Case TruePlace(double outlier_ratio = 0.0) {
  Case c;
  c.scene = RingScene(outlier_ratio);
  c.view = Describe(c.scene, kPresent);
  for (const int frame : {1, 0, 2}) c.old_places.push_back(Describe(c.scene, frame));
  c.cam_from_world = c.scene.true_cam_from_world;
  // Wrong matches are wrong all over the image.
  c.tools.matching.radius_px = c.tools.matching.wide_radius_px = 2000.0;
  return c;
}

std::vector<int> ConnectedFrames(const LoopEvidence& evidence) {
  std::vector<int> frames;
  frames.reserve(evidence.connections.size());
  for (const EdgeWithMatches& connection : evidence.connections) {
    frames.push_back(connection.edge.i.value);
  }
  return frames;
}

void ExpectRefused(const LoopEvidence& evidence) { EXPECT_FALSE(evidence.accepted); }

double ErrorDeg(const Scene& scene, const RelativeRotation& edge) {
  const Rotation truth =
      scene.true_cam_from_world.at(edge.j) * scene.true_cam_from_world.at(edge.i).Inverse();
  return (edge.j_from_i * truth.Inverse()).AngleDeg();
}

TEST(VerifyLoop, AcceptsATruePlace) {
  for (const double outlier_ratio : {0.0, 0.2}) {
    const Case c = TruePlace(outlier_ratio);
    const LoopEvidence evidence = c.Verify();
    ASSERT_TRUE(evidence.accepted) << outlier_ratio;
    EXPECT_LT(evidence.angle_deg, 0.2) << outlier_ratio;
    // Of 400 points; both views are right about a share of (1 - outlier_ratio)^2.
    EXPECT_GT(evidence.num_inliers, outlier_ratio > 0.0 ? 220 : 350);
    EXPECT_THAT(ConnectedFrames(evidence), testing::UnorderedElementsAre(0, 1, 2));
    EXPECT_EQ(evidence.match, evidence.connections.front().edge.i);
    EXPECT_EQ(evidence.num_inliers, evidence.connections.front().edge.num_inliers);
    for (const EdgeWithMatches& connection : evidence.connections) {
      EXPECT_EQ(connection.edge.j, FrameId{kPresent});
      EXPECT_LT(ErrorDeg(c.scene, connection.edge), 0.2) << outlier_ratio;
    }
  }
}

TEST(VerifyLoop, GivesTheMatchesThatAgree) {
  Case c = TruePlace(0.2);
  const LoopEvidence evidence = c.Verify();
  ASSERT_TRUE(evidence.accepted);
  for (const EdgeWithMatches& connection : evidence.connections) {
    const Features& place = c.Place(connection.edge.i.value);
    EXPECT_EQ(connection.matches.frame_i, place.frame);
    EXPECT_EQ(connection.matches.frame_j, c.view.frame);
    ASSERT_EQ(static_cast<int>(connection.matches.pairs.size()), connection.edge.num_inliers);
    int num_right = 0;
    for (const auto& [i, j] : connection.matches.pairs) {
      num_right += place.tracks[i] == c.view.tracks[j] &&
                   !c.scene.outliers.contains({place.tracks[i], place.frame}) &&
                   !c.scene.outliers.contains({c.view.tracks[j], c.view.frame});
    }
    // Some wrong ones lie on their epipolar line by chance.
    EXPECT_GT(num_right, 0.95 * connection.edge.num_inliers);
    EXPECT_FALSE(connection.outliers_j.empty());
  }
}

TEST(VerifyLoop, MeasuresTheDrift) {
  for (const double drift_deg : {0.0, 1.0, 2.5}) {
    Case c = TruePlace();
    c.Turn(kPresent, drift_deg);
    const LoopEvidence evidence = c.Verify();
    EXPECT_TRUE(evidence.accepted) << drift_deg;
    EXPECT_NEAR(evidence.angle_deg, drift_deg, 0.3);
  }
}

TEST(VerifyLoop, RefusesOtherDescriptors) {
  Case c = TruePlace();
  c.num_consistent = 5;
  for (Features& place : c.old_places) place = Describe(c.scene, place.frame.value, 2);
  const LoopEvidence evidence = c.Verify();
  ExpectRefused(evidence);
  EXPECT_EQ(evidence.match, FrameId{1});
  EXPECT_EQ(evidence.num_inliers, 0);
}

TEST(VerifyLoop, RefusesShuffledPositions) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Case c = TruePlace();
    c.num_consistent = 5;
    for (Features& place : c.old_places) ShufflePositions(place, 10 * seed + place.frame.value);
    ExpectRefused(c.Verify());
  }
}

// Matches are searched for where they are expected, so that wrong ones are not far off either.
TEST(VerifyLoop, RefusesWhatAgreesByChance) {
  int most_inliers = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Case c = TruePlace();
    c.num_consistent = 5;
    for (Features& place : c.old_places) {
      Displace(place, c.scene.camera, 10.0, 10 * seed + place.frame.value);
    }
    ExpectRefused(c.Verify());
    // The share of the matches tells it alone, their number does not.
    c.options.max_sigma_deg = c.options.max_witness_sigma_deg = 180.0;
    ExpectRefused(c.Verify());
    c.options.min_inlier_ratio = 0.0;
    most_inliers = std::max(most_inliers, c.Verify().num_inliers);
  }
  RecordProperty("most_inliers", most_inliers);
  EXPECT_GT(most_inliers, VerificationOptions().min_inliers);
}

TEST(VerifyLoop, AsksNoNeighboursWhereTheCandidateSaysNo) {
  Case c = TruePlace();
  c.Place(1) = Describe(c.scene, 1, 2);
  const LoopEvidence evidence = c.Verify();
  ExpectRefused(evidence);
  EXPECT_EQ(evidence.match, FrameId{1});
  EXPECT_EQ(evidence.num_inliers, 0);
}

TEST(VerifyLoop, LeavesOutNeighboursThatSeeSomethingElse) {
  Case c = TruePlace();
  c.Place(0) = Describe(c.scene, 0, 2);
  const LoopEvidence evidence = c.Verify();
  EXPECT_TRUE(evidence.accepted);
  EXPECT_THAT(ConnectedFrames(evidence), testing::UnorderedElementsAre(1, 2));
}

TEST(VerifyLoop, WantsAWitness) {
  Case c = TruePlace();
  c.num_consistent = 5;
  c.old_places.resize(1);
  const LoopEvidence alone = c.Verify();
  ExpectRefused(alone);
  EXPECT_GT(alone.num_inliers, 350);
  EXPECT_EQ(alone.match, FrameId{1});
  c.options.min_edges = 1;
  EXPECT_THAT(ConnectedFrames(c.Verify()), ElementsAre(1));
}

TEST(VerifyLoop, WitnessesMustAgree) {
  Case c = TruePlace();
  c.num_consistent = 5;
  c.Turn(0, 3.0);
  EXPECT_THAT(ConnectedFrames(c.Verify()), testing::UnorderedElementsAre(1, 2));
  c.Turn(2, -3.0);
  ExpectRefused(c.Verify());
  c.options.max_cycle_deg = 4.0;
  EXPECT_THAT(ConnectedFrames(c.Verify()), testing::UnorderedElementsAre(0, 1, 2));
}

TEST(VerifyLoop, NeighboursMayOutvoteTheCandidate) {
  Case c = TruePlace();
  c.Turn(1, 3.0);
  const LoopEvidence evidence = c.Verify();
  EXPECT_THAT(ConnectedFrames(evidence), testing::UnorderedElementsAre(0, 2));
  EXPECT_NE(evidence.match, FrameId{1});
  EXPECT_LT(evidence.angle_deg, 0.3);
}

TEST(VerifyLoop, FewMatchesMustBeConsistent) {
  Case c = TruePlace();
  // More than one edge has, less than all three have.
  c.options.sure_inliers = 600;
  EXPECT_TRUE(c.Verify().accepted);
  c.options.sure_inliers = 100000;
  ExpectRefused(c.Verify());
  c.num_consistent = 2;
  EXPECT_TRUE(c.Verify().accepted);
}

TEST(VerifyLoop, WantsEnoughMatchesThatAgree) {
  Case c = TruePlace(0.2);
  ASSERT_TRUE(c.Verify().accepted);
  c.options.min_inliers = 380;
  ExpectRefused(c.Verify());
  c.options = {};
  c.options.min_inlier_ratio = 0.95;
  ExpectRefused(c.Verify());
}

TEST(VerifyLoop, DriftIsBoundedWhereTheWayIsKnown) {
  Case c = TruePlace();
  c.options.max_drift_deg = 2.0;
  c.options.max_drift_deg_per_sqrt_frame = 0.0;
  c.Turn(kPresent, 4.0);
  const LoopEvidence known = c.Verify();
  ExpectRefused(known);
  EXPECT_NEAR(known.angle_deg, 4.0, 0.3);
  EXPECT_GT(known.num_inliers, 350);
  c.are_linked = false;
  EXPECT_TRUE(c.Verify().accepted);
}

TEST(VerifyLoop, DriftMayGrowWithTheWay) {
  for (const auto& [frame, is_accepted] : {std::pair(20, false), std::pair(900, true)}) {
    Case c = TruePlace();
    c.options.max_drift_deg = 2.0;
    c.options.max_drift_deg_per_sqrt_frame = 0.1;
    c.Turn(kPresent, 4.0);
    c.view.frame = FrameId{frame};
    c.cam_from_world[c.view.frame] = c.cam_from_world.at(FrameId{kPresent});
    EXPECT_EQ(c.Verify().accepted, is_accepted) << frame;
  }
}

// Once round between the two frames, with all turns `scale` times as large as they are.
void GoRound(const Rotation& from,
             const Rotation& to,
             double scale,
             FrameId first,
             FrameId last,
             RotationMap& cam_from_world) {
  const int num_steps = last.value - first.value;
  Eigen::Vector3d turn = (to * from.Inverse()).Log();
  turn *= 1.0 + 2.0 * std::numbers::pi / turn.norm();
  for (int step = 0; step <= num_steps; ++step) {
    cam_from_world[FrameId{first.value + step}] =
        Rotation::Exp(scale * step / num_steps * turn) * from;
  }
}

TEST(VerifyLoop, AllTurnsMayBeTooSmall) {
  Case c = TruePlace();
  const LoopEvidence closed = c.Verify();
  ASSERT_TRUE(closed.accepted);
  const Rotation present = c.cam_from_world.at(FrameId{kPresent});
  c.view.frame = FrameId{60};
  GoRound(
      c.cam_from_world.at(closed.match), present, 0.93, FrameId{3}, c.view.frame, c.cam_from_world);
  const LoopEvidence round = c.Verify();
  EXPECT_TRUE(round.accepted);
  EXPECT_GT(round.angle_deg, 20.0);
  EXPECT_NEAR(round.scaled.turn_scale, 1.0 / 0.93, 0.003);
  EXPECT_LT(round.scaled.angle_deg, 1.0);
  c.options.max_turn_error = 0.02;
  ExpectRefused(c.Verify());
}

TEST(ScaleRotations, FindsTheScaleThatClosesTheWay) {
  const Rotation from = Rotation::Exp({0.1, 0.2, 0.3});
  const Rotation to = Rotation::Exp({0.05, 0.4, 0.0});
  RelativeRotation loop;
  loop.i = FrameId{0};
  loop.j = FrameId{25};
  loop.j_from_i = to * from.Inverse();
  for (const double scale : {0.92, 1.0, 1.05}) {
    RotationMap cam_from_world;
    GoRound(from, to, scale, loop.i, loop.j, cam_from_world);
    const ScaledLoop scaled = ScaleRotations(cam_from_world, loop, 0.1);
    EXPECT_NEAR(scaled.turn_scale, 1.0 / scale, 1e-6);
    EXPECT_LT(scaled.angle_deg, 1e-4);
  }
}

TEST(ScaleRotations, StaysWithinItsBound) {
  const Rotation from;
  const Rotation to = Rotation::Exp({0.0, 0.3, 0.0});
  RelativeRotation loop;
  loop.i = FrameId{0};
  loop.j = FrameId{25};
  loop.j_from_i = to;
  RotationMap cam_from_world;
  GoRound(from, to, 0.8, loop.i, loop.j, cam_from_world);
  const ScaledLoop scaled = ScaleRotations(cam_from_world, loop, 0.1);
  EXPECT_NEAR(scaled.turn_scale, 1.1, 1e-9);
  EXPECT_GT(scaled.angle_deg, 30.0);
}

TEST(ScaleRotations, SaysNothingOfAStraightWay) {
  RelativeRotation loop;
  loop.i = FrameId{0};
  loop.j = FrameId{2};
  loop.j_from_i = Rotation::Exp({0.0, 0.05, 0.0});
  const RotationMap cam_from_world = {{FrameId{0}, Rotation()},
                                      {FrameId{1}, Rotation::Exp({0.0, 0.02, 0.0})},
                                      {FrameId{2}, Rotation::Exp({0.0, 0.03, 0.0})}};
  const ScaledLoop scaled = ScaleRotations(cam_from_world, loop, 0.1);
  EXPECT_EQ(scaled.turn_scale, 1.0);
  EXPECT_NEAR(scaled.angle_deg, 0.02 * kDegFromRad, 1e-9);
}

TEST(VerifyLoop, ARollingShutterMakesEdgesLessCertain) {
  Case c = TruePlace();
  const LoopEvidence global = c.Verify();
  c.scene.camera.readout_s = 0.02;
  const LoopEvidence rolling = c.Verify();
  ASSERT_TRUE(global.accepted && rolling.accepted);
  ASSERT_EQ(ConnectedFrames(rolling), ConnectedFrames(global));
  const double sigma = c.options.shutter_sigma_deg * kRadFromDeg;
  const Eigen::Matrix3d added = sigma * sigma * Eigen::Matrix3d::Identity();
  for (std::size_t k = 0; k < global.connections.size(); ++k) {
    const Eigen::Matrix3d difference =
        rolling.connections[k].edge.covariance - global.connections[k].edge.covariance;
    EXPECT_TRUE(difference.isApprox(added, 1e-9));
  }
}

// A place whose cameras rolled while they were exposed: `sigma` times as far as corners are blurred
// they err along it.
Case BlurredPlace(double sigma, std::uint64_t seed) {
  Case c = TruePlace();
  const Camera& camera = c.scene.camera;
  const Eigen::Vector3d rate(0.0, 0.0, 3.0);
  SceneRandom random(seed);
  const auto blur = [&](Features& features) {
    for (int n = 0; n < features.size(); ++n) {
      const Eigen::Vector2d whole_px =
          BlurVectorOf(camera, features.bearings[n], rate, c.options.blur_s_per_px);
      features.keypoints_px[n] += random.Normal(sigma) * whole_px;
      features.bearings[n] = *camera.Unproject(features.keypoints_px[n]);
    }
    c.rates[features.frame] = rate;
  };
  blur(c.view);
  for (Features& place : c.old_places) blur(place);
  return c;
}

TEST(VerifyLoop, WeighsCornersByTheirBlur) {
  const auto mean_error_deg = [](double blur_s_per_px) {
    double sum = 0.0;
    int count = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      Case c = BlurredPlace(0.3, seed);
      c.options.blur_s_per_px = blur_s_per_px;
      for (const EdgeWithMatches& connection : c.Verify().connections) {
        sum += ErrorDeg(c.scene, connection.edge);
        ++count;
      }
    }
    EXPECT_GE(count, 25) << blur_s_per_px;
    return sum / count;
  };
  EXPECT_LT(mean_error_deg(VerificationOptions{}.blur_s_per_px), 0.85 * mean_error_deg(0.0));
}

// The places are the same, but not how they are turned against each other.
TEST(VerifyLoop, EdgesMustSayTheSameOfBluredCorners) {
  Case c = BlurredPlace(0.5, 1);
  ASSERT_EQ(c.Verify().connections.size(), 3U);
  // Nothing says quite the same; among each other they may differ by their deviations.
  c.options.max_cycle_deg = 1e-9;
  c.options.max_cycle_sigmas = 100.0;
  const LoopEvidence evidence = c.Verify();
  EXPECT_TRUE(evidence.accepted);
  EXPECT_TRUE(evidence.connections.empty());
  EXPECT_EQ(evidence.unproven.size(), 3U);
  // Nobody asks about cameras that stand still, or of which it is not known.
  for (auto& [frame, rate] : c.rates) rate *= 0.01;
  EXPECT_EQ(c.Verify().connections.size(), 3U);
  c.rates.clear();
  EXPECT_EQ(c.Verify().connections.size(), 3U);
}

TEST(VerifyLoop, RefusesUncertainEdges) {
  Case c = TruePlace();
  const LoopEvidence evidence = c.Verify();
  ASSERT_TRUE(evidence.accepted);
  c.options.max_sigma_deg = 1e-4;
  ExpectRefused(c.Verify());
}

TEST(VerifyLoop, UncertainEdgesConfirmCertainOnes) {
  Case c = TruePlace();
  const LoopEvidence evidence = c.Verify();
  ASSERT_EQ(evidence.connections.size(), 3);
  const int most_certain = evidence.match.value;
  // Between the first two.
  double sigma_deg = 0.0;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Matrix3d& covariance = evidence.connections[k].edge.covariance;
    sigma_deg += 0.5 * std::sqrt(covariance.selfadjointView<Eigen::Upper>().eigenvalues()[2]);
  }
  c.options.max_sigma_deg = sigma_deg * kDegFromRad;
  const LoopEvidence confirmed = c.Verify();
  EXPECT_TRUE(confirmed.accepted);
  EXPECT_THAT(ConnectedFrames(confirmed), ElementsAre(most_certain));
  c.options.max_witness_sigma_deg = c.options.max_sigma_deg;
  ExpectRefused(c.Verify());
}

// With a rolling shutter edges between visits are less certain, and so are cycles of them.
TEST(VerifyLoop, CyclesCloseToTheirDeviations) {
  Case c = TruePlace();
  c.num_consistent = 5;
  c.Turn(0, 1.5);
  c.Turn(2, -1.5);
  ExpectRefused(c.Verify());
  c.scene.camera.readout_s = 0.02;
  EXPECT_THAT(ConnectedFrames(c.Verify()), testing::UnorderedElementsAre(0, 1, 2));
  c.options.max_cycle_sigmas = 3.0;
  ExpectRefused(c.Verify());
}

TEST(VerificationOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(VerificationOptions{}.Problem());
  const auto problem = [](auto change) {
    VerificationOptions options;
    change(options);
    return options.Problem().value_or("none");
  };
  using Options = VerificationOptions&;
  EXPECT_TRUE(problem([](Options o) { o.min_inliers = 0; }).starts_with("min_inliers is 0"));
  EXPECT_TRUE(
      problem([](Options o) { o.min_inlier_ratio = 1.0; }).starts_with("min_inlier_ratio is 1"));
  EXPECT_TRUE(problem([](Options o) { o.max_sigma_deg = 0.0; }).starts_with("max_sigma_deg is 0"));
  EXPECT_TRUE(
      problem([](Options o) { o.blur_s_per_px = -1.0; }).starts_with("blur_s_per_px is -1"));
  EXPECT_TRUE(
      problem([](Options o) { o.max_cycle_deg = -1.0; }).starts_with("max_cycle_deg is -1"));
  EXPECT_TRUE(problem([](Options o) {
                o.max_witness_sigma_deg = 0.1;
              }).starts_with("max_witness_sigma_deg is 0.1"));
  EXPECT_TRUE(
      problem([](Options o) { o.max_cycle_sigmas = -1.0; }).starts_with("max_cycle_sigmas is -1"));
  EXPECT_TRUE(problem([](Options o) { o.min_edges = 0; }).starts_with("min_edges is 0"));
  EXPECT_TRUE(
      problem([](Options o) { o.min_witness_deg = -1.0; }).starts_with("min_witness_deg is -1"));
  EXPECT_TRUE(problem([](Options o) { o.sure_inliers = -1; }).starts_with("sure_inliers is -1"));
  EXPECT_TRUE(
      problem([](Options o) { o.max_drift_deg = std::nan(""); }).starts_with("max_drift_deg is "));
  EXPECT_TRUE(problem([](Options o) {
                o.max_drift_deg_per_sqrt_frame = -0.1;
              }).starts_with("max_drift_deg_per_sqrt_frame is -0.1"));
}

}  // namespace
}  // namespace rotslam
