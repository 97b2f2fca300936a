#include "ba/bundle_adjustment.h"

#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

bool SameBits(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::memcmp(a.data(), b.data(), sizeof(double) * 3) == 0;
}

bool SameBits(const Rotation& a, const Rotation& b) {
  return std::memcmp(a.Quaternion().coeffs().data(),
                     b.Quaternion().coeffs().data(),
                     sizeof(double) * 4) == 0;
}

bool SameBits(const Reconstruction& a, const Reconstruction& b) {
  if (a.cam_from_world.size() != b.cam_from_world.size() ||
      a.center_in_world.size() != b.center_in_world.size() ||
      a.point_in_world.size() != b.point_in_world.size()) {
    return false;
  }
  for (const auto& [id, value] : a.cam_from_world) {
    if (!SameBits(value, b.cam_from_world.at(id))) return false;
  }
  for (const auto& [id, value] : a.center_in_world) {
    if (!SameBits(value, b.center_in_world.at(id))) return false;
  }
  for (const auto& [id, value] : a.point_in_world) {
    if (!SameBits(value, b.point_in_world.at(id))) return false;
  }
  return true;
}

TEST(RefineBundle, FindsTheTruthOnACleanStreet) {
  const BaScene scene = MakeBaScene({});
  // Twenty metres of path: 0.2 deg and up to a metre off.
  const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.2, 1.0), ExactOptions());
  ASSERT_TRUE(result.Usable()) << result.message;
  EXPECT_LT(CenterError(result.reconstruction, scene.truth), 1e-6);
  EXPECT_LT(MaxRotationErrorDeg(result.reconstruction, scene.truth), 1e-5);
  EXPECT_LT(result.summary.after.rms_px, 1e-4);
  EXPECT_GT(result.summary.before.rms_px, 1.0);
  // With the lens that was not needed, and widths fitted to residuals that are none.
  EXPECT_EQ(result.summary.rounds.size(), 5U);
  for (const BundleRoundSummary& round : result.summary.rounds) {
    EXPECT_GT(round.solver_seconds, 0.0) << round.name;
    EXPECT_LT(round.solver_seconds, round.seconds) << round.name;
  }
  EXPECT_TRUE(result.weak_frames.empty());
  EXPECT_GT(result.summary.num_points, 380);  // all but the shallow ones
}

TEST(RefineBundle, AdjustsWhatIsFoundByTheWay) {
  const BaScene scene = MakeBaScene({.noise_px = 0.5});
  BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  const std::vector<Track> whole = problem.start.tracks;
  // What a tracker would have left of them.
  int num_given = 0;
  for (Track& track : problem.start.tracks) {
    if (track.observations.size() > 4) track.observations.resize(4);
    num_given += static_cast<int>(track.observations.size());
  }
  const BundleResult before = RefineBundle(problem, {});
  int num_calls = 0;
  int num_found = 0;
  const TrackCompletion complete = [&](const Reconstruction& map, const Camera& camera) {
    ++num_calls;
    EXPECT_EQ(camera.fx, scene.camera.fx);
    EXPECT_EQ(map.tracks.size(), map.point_in_world.size());
    std::vector<Track> tracks;
    for (const Track& track : map.tracks) {
      EXPECT_LE(track.observations.size(), 4U);
      for (const Track& other : whole) {
        if (other.id == track.id) tracks.push_back(other);
      }
      num_found += static_cast<int>(tracks.back().observations.size() - track.observations.size());
    }
    return tracks;
  };
  const BundleResult after = RefineBundle(problem, {}, complete);
  ASSERT_TRUE(before.Usable() && after.Usable()) << after.message;
  EXPECT_EQ(num_calls, 1);
  EXPECT_GT(num_found, num_given / 4);
  EXPECT_EQ(after.summary.num_completed, num_found);
  EXPECT_EQ(after.summary.num_observations + after.summary.num_dropped_observations,
            num_given + num_found);
  EXPECT_EQ(before.summary.num_completed, 0);
  EXPECT_LT(CenterError(after.reconstruction, scene.truth),
            0.8 * CenterError(before.reconstruction, scene.truth));
  // Of two models of a sequence both are asked the same.
  EXPECT_LE(after.summary.support.num_observations, num_given);
  EXPECT_GT(after.summary.support.num_observations, 0.9 * num_given);
}

TEST(RefineBundle, KeepsTheFirstPoseAndTheScaleOfTheStart) {
  const BaScene scene = MakeBaScene({.noise_px = 0.5});
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.3);
  const BundleResult result = RefineBundle(problem, ExactOptions());
  ASSERT_TRUE(result.Usable()) << result.message;
  const FrameId first{0};
  const FrameId last{19};
  EXPECT_TRUE(SameBits(result.reconstruction.cam_from_world.at(first),
                       problem.start.cam_from_world.at(first)));
  EXPECT_TRUE(SameBits(result.reconstruction.center_in_world.at(first),
                       problem.start.center_in_world.at(first)));
  // Along the line between them the distance stays; across it, it may turn.
  const double before =
      (problem.start.center_in_world.at(last) - problem.start.center_in_world.at(first)).norm();
  const double after = (result.reconstruction.center_in_world.at(last) -
                        result.reconstruction.center_in_world.at(first))
                           .norm();
  EXPECT_NEAR(after / before, 1.0, 2e-3);
}

// Orientations that are known well: the tighter they are held, the better the positions, and what
// the prior says of them comes out.
TEST(RefineBundle, HoldsOrientationsAsTightlyAsTheyAreKnown) {
  const BaScene scene = MakeBaScene({.num_frames = 12, .num_points = 120, .noise_px = 1.0});
  BundleProblem problem;
  problem.camera = scene.camera;
  problem.start = scene.truth;
  BundleOptions options;
  options.lens.refine_distortion = false;
  const auto solve = [&](double sigma_rad) {
    problem.rotation_sigma_rad.clear();
    for (const auto& [frame, rotation] : scene.truth.cam_from_world) {
      if (sigma_rad > 0.0) problem.rotation_sigma_rad[frame] = sigma_rad;
    }
    return RefineBundle(problem, options);
  };
  const auto largest_turn_deg = [&](const BundleResult& result) {
    double largest = 0.0;
    for (const auto& [frame, rotation] : result.reconstruction.cam_from_world) {
      largest =
          std::max(largest, (rotation * scene.truth.cam_from_world.at(frame).Inverse()).AngleDeg());
    }
    return largest;
  };
  const BundleResult free = solve(0.0);
  ASSERT_TRUE(free.Usable()) << free.message;
  const double free_deg = largest_turn_deg(free);
  EXPECT_GT(free_deg, 0.01);
  const double tight_deg = largest_turn_deg(solve(1e-6));
  EXPECT_LT(tight_deg, 1e-4);
  const double between_deg = largest_turn_deg(solve(1e-4));
  EXPECT_GT(between_deg, tight_deg);
  EXPECT_LT(between_deg, free_deg);
  // A loose prior holds the common orientation only.
  EXPECT_NEAR(
      solve(0.5).summary.final_cost, free.summary.final_cost, 1e-3 * free.summary.final_cost);
  // Held altogether is what a tight prior comes to.
  options.refine_rotations = false;
  const BundleResult held = solve(0.0);
  options.refine_rotations = true;
  const BundleResult tight = solve(1e-6);
  for (const auto& [frame, center] : held.reconstruction.center_in_world) {
    EXPECT_LT((center - tight.reconstruction.center_in_world.at(frame)).norm(), 2e-3);
  }
  problem.rotation_sigma_rad[FrameId{3}] = 0.0;
  EXPECT_THROW(RefineBundle(problem, options), std::invalid_argument);
}

TEST(RefineBundle, TakesTracksOfTwoWhereItIsTold) {
  const BaScene scene = MakeBaScene({.num_frames = 8, .num_points = 400, .noise_px = 0.3});
  BundleProblem problem;
  problem.camera = scene.camera;
  problem.start = scene.truth;
  problem.start.tracks = RestrictTracks(scene.truth.tracks, {FrameId{0}, FrameId{2}}, 2);
  std::erase_if(problem.start.cam_from_world, [](const auto& entry) {
    return entry.first.value % 2 != 0 || entry.first.value > 2;
  });
  EXPECT_FALSE(RefineBundle(problem, {}).Usable());
  BundleOptions options;
  options.min_track_observations = 2;
  const BundleResult result = RefineBundle(problem, options);
  ASSERT_TRUE(result.Usable()) << result.message;
  EXPECT_EQ(result.reconstruction.center_in_world.size(), 2u);
  EXPECT_GT(result.summary.num_points, 20);
}

TEST(RefineBundle, RemovesOutliersAndStaysNearTheRunWithoutThem) {
  const BaSceneOptions options = {.noise_px = 0.5};
  BaSceneOptions with_outliers = options;
  with_outliers.outlier_ratio = 0.05;
  const BaScene clean = MakeBaScene(options);
  const BaScene dirty = MakeBaScene(with_outliers);
  const BundleResult a = RefineBundle(PerturbedProblem(clean, 0.1, 0.5), {});
  const BundleResult b = RefineBundle(PerturbedProblem(dirty, 0.1, 0.5), {});
  ASSERT_TRUE(a.Usable() && b.Usable());
  int kept_outliers = 0;
  int kept_inliers = 0;
  int num_inliers = 0;
  for (const Track& track : b.reconstruction.tracks) {
    for (const Observation& observation : track.observations) {
      const bool outlier = dirty.outliers.contains({track.id, observation.frame});
      ++(outlier ? kept_outliers : kept_inliers);
    }
  }
  for (const Track& track : dirty.truth.tracks) {
    num_inliers += static_cast<int>(track.observations.size());
  }
  num_inliers -= static_cast<int>(dirty.outliers.size());
  EXPECT_LE(kept_outliers, 0.02 * static_cast<double>(dirty.outliers.size()));
  EXPECT_GT(kept_inliers, 0.95 * num_inliers);
  EXPECT_LT(CenterError(b.reconstruction, dirty.truth),
            1.5 * CenterError(a.reconstruction, clean.truth) + 1e-4);
}

TEST(RefineBundle, HoldsDriftingTracksForWhatTheyAreWhereTheOthersAreClose) {
  // Every fifth track slides off by up to 2 px; keypoints of the others are thirty times as good as
  // their sigma says.
  BaScene scene = MakeBaScene({.num_points = 1000, .noise_px = 0.03});
  for (Track& track : scene.truth.tracks) {
    if (track.id.value % 5 != 0) continue;
    const double angle = 1.7 * track.id.value;
    const Eigen::Vector2d step = 0.2 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    for (std::size_t k = 0; k < track.observations.size(); ++k) {
      Observation& observation = track.observations[k];
      observation.keypoint_px += static_cast<double>(k) * step;
      observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
    }
  }
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  BundleOptions options;
  const BundleResult fitted = RefineBundle(problem, options);
  options.loss_spreads = 0.0;
  options.limit_spreads = 0.0;
  const BundleResult wide = RefineBundle(problem, options);
  ASSERT_TRUE(fitted.Usable() && wide.Usable());
  EXPECT_LT(CenterError(fitted.reconstruction, scene.truth),
            0.5 * CenterError(wide.reconstruction, scene.truth));
  EXPECT_LT(MaxRotationErrorDeg(fitted.reconstruction, scene.truth),
            0.5 * MaxRotationErrorDeg(wide.reconstruction, scene.truth));
  int num_kept = 0;
  int num_good = 0;
  for (const Track& track : fitted.reconstruction.tracks) {
    if (track.id.value % 5 != 0) num_kept += static_cast<int>(track.observations.size());
  }
  for (const Track& track : wide.reconstruction.tracks) {
    if (track.id.value % 5 != 0) num_good += static_cast<int>(track.observations.size());
  }
  EXPECT_GT(num_kept, 0.98 * num_good);
}

TEST(RefineBundle, WeighsKeypointsLessAlongTheirBlur) {
  // Frames turn about one axis after the other: their keypoints err by 0.2 px across and 0.6 along.
  double error = 0.0;
  double isotropic_error = 0.0;
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    BaScene scene = MakeBaScene({.seed = seed});
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0.0, 0.2);
    for (Track& track : scene.truth.tracks) {
      for (Observation& observation : track.observations) {
        const double angle = 1.3 * observation.frame.value;
        const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
        const Eigen::Vector2d across(-along.y(), along.x());
        observation.keypoint_px += std::hypot(1.0, 3.0) * normal(random) * along;
        observation.keypoint_px += normal(random) * across;
        observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
        observation.blur = 3.0F * along.cast<float>();
      }
    }
    BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
    const BundleResult weighed = RefineBundle(problem, {});
    EXPECT_TRUE(weighed.summary.has_motion_blur);
    error += CenterError(weighed.reconstruction, scene.truth);
    for (Track& track : problem.start.tracks) {
      for (Observation& observation : track.observations) observation.blur.setZero();
    }
    isotropic_error += CenterError(RefineBundle(problem, {}).reconstruction, scene.truth);
  }
  EXPECT_LT(error, 0.8 * isotropic_error);
}

TEST(RefineBundle, LeavesBlursThatKeypointsDoNotShow) {
  BaScene scene = MakeBaScene({.noise_px = 0.3});
  BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  const BundleResult plain = RefineBundle(problem, {});
  for (Track& track : problem.start.tracks) {
    for (Observation& observation : track.observations) observation.blur = {1.2F, 0.5F};
  }
  const BundleResult blurred = RefineBundle(problem, {});
  EXPECT_FALSE(blurred.summary.has_motion_blur);
  EXPECT_EQ(blurred.summary.final_cost, plain.summary.final_cost);
}

TEST(RefineBundle, KeepsNoResidualAboveTheFineRoundsLimit) {
  const BundleProblem problem = PerturbedProblem(MakeBaScene({.noise_px = 0.5}), 0.1, 0.5);
  BundleOptions options;
  const BundleResult wide = RefineBundle(problem, options);
  options.fine.max_residual = 1.0;
  const BundleResult narrow = RefineBundle(problem, options);
  EXPECT_LT(narrow.summary.num_observations, 0.97 * wide.summary.num_observations);
}

TEST(RefineBundle, ForgetsTheNamesOfFramesAndTracks) {
  const BaScene scene = MakeBaScene({.noise_px = 0.5});
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.3);
  // Frame k becomes 100 - k, which also makes another frame the first, and track order turns round.
  const auto renamed = [](FrameId frame) { return FrameId{100 - frame.value}; };
  BundleProblem other;
  other.camera = problem.camera;
  for (const auto& [frame, value] : problem.start.cam_from_world) {
    other.start.cam_from_world[renamed(frame)] = value;
    other.start.center_in_world[renamed(frame)] = problem.start.center_in_world.at(frame);
  }
  for (Track track : problem.start.tracks) {
    track.id = TrackId{1000 - track.id.value};
    std::reverse(track.observations.begin(), track.observations.end());
    for (Observation& observation : track.observations) {
      observation.frame = renamed(observation.frame);
    }
    other.start.tracks.insert(other.start.tracks.begin(), track);
  }
  const Reconstruction a = RefineBundle(problem, ExactOptions()).reconstruction;
  const Reconstruction b = RefineBundle(other, ExactOptions()).reconstruction;
  // Pairs only: neither the world's pose nor its scale enters.
  const auto ratio = [&](const Reconstruction& r, FrameId i, FrameId j, FrameId k) {
    return (r.center_in_world.at(i) - r.center_in_world.at(j)).norm() /
           (r.center_in_world.at(i) - r.center_in_world.at(k)).norm();
  };
  for (int k = 1; k + 1 < 20; ++k) {
    const FrameId i{0};
    const FrameId j{k};
    const FrameId l{19};
    const Rotation pair_a = a.cam_from_world.at(j) * a.cam_from_world.at(i).Inverse();
    const Rotation pair_b =
        b.cam_from_world.at(renamed(j)) * b.cam_from_world.at(renamed(i)).Inverse();
    EXPECT_LT((pair_a * pair_b.Inverse()).AngleDeg(), 1e-5);
    EXPECT_NEAR(ratio(a, i, j, l), ratio(b, renamed(i), renamed(j), renamed(l)), 1e-6);
  }
}

TEST(RefineBundle, HoldsOnePositionThroughAPureRotation) {
  const BaScene scene = MakeBaScene(
      {.num_frames = 24, .num_points = 600, .noise_px = 0.0, .still_first = 10, .still_last = 16});
  BundleProblem problem = PerturbedProblem(scene, 0.1, 0.3);
  for (int k = 11; k <= 16; ++k) problem.shared_center[FrameId{k}] = FrameId{k - 1};  // a chain
  const BundleResult result = RefineBundle(problem, ExactOptions());
  ASSERT_TRUE(result.Usable()) << result.message;
  const Reconstruction& out = result.reconstruction;
  for (int k = 11; k <= 16; ++k) {
    EXPECT_TRUE(SameBits(out.center_in_world.at(FrameId{k}), out.center_in_world.at(FrameId{10})));
  }
  EXPECT_LT(CenterError(out, scene.truth), 1e-6);
  EXPECT_LT(MaxRotationErrorDeg(out, scene.truth), 1e-5);
}

TEST(RefineBundle, TracksSeenFromOnePlaceHoldRotationsTogether) {
  // Frames 10..16 turn in place; tracks that cross to the moving part are cut, so only directions
  // tie the rotations of the segment to one another.
  const BaScene scene =
      MakeBaScene({.num_frames = 24, .num_points = 1200, .still_first = 10, .still_last = 16});
  BundleProblem problem = PerturbedProblem(scene, 0.1, 0.0);
  for (int k = 11; k <= 16; ++k) problem.shared_center[FrameId{k}] = FrameId{10};
  for (Track& track : problem.start.tracks) {
    std::erase_if(track.observations, [&](const Observation& observation) {
      const bool inside = observation.frame.value > 10 && observation.frame.value <= 16;
      return track.id.value % 2 == 0 ? inside
                                     : observation.frame.value < 10 || observation.frame.value > 16;
    });
  }
  const BundleResult result = RefineBundle(problem, ExactOptions());
  ASSERT_TRUE(result.Usable()) << result.message;
  EXPECT_GT(result.summary.rounds.back().num_directions, 50);
  EXPECT_LT(MaxRotationErrorDeg(result.reconstruction, scene.truth), 1e-4);
}

TEST(RefineBundle, FixedFramesDoNotMoveAndCarryTheGauge) {
  const BaScene scene = MakeBaScene({.noise_px = 0.0});
  BundleProblem problem = PerturbedProblem(scene, 0.1, 0.3);
  for (int k = 0; k < 5; ++k) {
    const FrameId frame{k};
    problem.fixed_frames.insert(frame);
    problem.start.cam_from_world[frame] = scene.truth.cam_from_world.at(frame);
    problem.start.center_in_world[frame] = scene.truth.center_in_world.at(frame);
  }
  const BundleResult result = RefineBundle(problem, ExactOptions());
  ASSERT_TRUE(result.Usable()) << result.message;
  for (const FrameId frame : problem.fixed_frames) {
    EXPECT_TRUE(SameBits(result.reconstruction.cam_from_world.at(frame),
                         problem.start.cam_from_world.at(frame)));
    EXPECT_TRUE(SameBits(result.reconstruction.center_in_world.at(frame),
                         problem.start.center_in_world.at(frame)));
  }
  for (const auto& [frame, center] : result.reconstruction.center_in_world) {
    EXPECT_LT((center - scene.truth.center_in_world.at(frame)).norm(), 1e-5) << frame.value;
  }
}

TEST(RefineBundle, KnownRotationModeKeepsRotationsToTheLastBit) {
  const BaScene scene = MakeBaScene({.noise_px = 0.0});
  const BundleProblem problem = PerturbedProblem(scene, 0.0, 1.0);
  BundleOptions options = ExactOptions();
  options.refine_rotations = false;
  const BundleResult result = RefineBundle(problem, options);
  ASSERT_TRUE(result.Usable()) << result.message;
  for (const auto& [frame, cam_from_world] : problem.start.cam_from_world) {
    EXPECT_TRUE(SameBits(result.reconstruction.cam_from_world.at(frame), cam_from_world));
  }
  EXPECT_LT(CenterError(result.reconstruction, scene.truth), 1e-6);
}

TEST(RefineBundle, GivesTheSameBytesAtAnyNumberOfThreads) {
  const BaScene scene = MakeBaScene({.noise_px = 0.5, .outlier_ratio = 0.05});
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  BundleOptions options;
  const BundleResult one = RefineBundle(problem, options);
  std::vector<std::vector<double>> ballast;  // moves later allocations to other addresses
  for (const int threads : {1, 2, 4, 1, 2, 4}) {
    options.num_threads = threads;
    ballast.emplace_back(1000 * ballast.size() + 7);
    EXPECT_TRUE(SameBits(RefineBundle(problem, options).reconstruction, one.reconstruction))
        << threads;
  }
}

TEST(RefineBundle, DenseAndSparseSolversAgree) {
  const BaScene scene = MakeBaScene({.noise_px = 0.5});
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.3);
  BundleOptions options = ExactOptions();
  options.max_dense_frames = 1000;
  const BundleResult dense = RefineBundle(problem, options);
  options.max_dense_frames = 0;
  const BundleResult sparse = RefineBundle(problem, options);
  EXPECT_NEAR(dense.summary.final_cost, sparse.summary.final_cost, 1e-9 * dense.summary.final_cost);
  for (const auto& [frame, center] : dense.reconstruction.center_in_world) {
    EXPECT_LT((center - sparse.reconstruction.center_in_world.at(frame)).norm(), 1e-5);
  }
}

TEST(RefineBundle, FramesWithTooFewObservationsAreNamedAndLoseTheirPose) {
  const BaScene scene = MakeBaScene({});
  BundleProblem problem = PerturbedProblem(scene, 0.1, 0.3);
  const FrameId lonely{7};
  int left = 5;
  for (Track& track : problem.start.tracks) {
    std::erase_if(track.observations,
                  [&](const Observation& o) { return o.frame == lonely && left-- <= 0; });
  }
  const BundleResult result = RefineBundle(problem, ExactOptions());
  ASSERT_TRUE(result.Usable()) << result.message;
  EXPECT_EQ(result.weak_frames, std::vector<FrameId>{lonely});
  EXPECT_FALSE(result.reconstruction.cam_from_world.contains(lonely));
  EXPECT_FALSE(result.reconstruction.center_in_world.contains(lonely));
  EXPECT_LT(CenterError(result.reconstruction, scene.truth), 1e-6);
}

TEST(RefineBundle, RefinesTheDistortionThatACalibrationHasLeft) {
  // Seen through a lens that bends by 22 px at the image's side, calibrated as if it did not.
  Camera lens = BaCamera(CameraModel::kRadtan);
  lens.distortion = {0.05, -0.01, 0.0, 0.0, 0.0};
  BaScene scene =
      MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.2, .camera = lens});
  scene.camera = BaCamera();
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  BundleOptions options;
  options.lens.distortion_sigma = 0.05;
  const BundleResult refined = RefineBundle(problem, options);
  options.lens.refine_distortion = false;
  const BundleResult held = RefineBundle(problem, options);
  ASSERT_TRUE(refined.Usable() && held.Usable());
  EXPECT_TRUE(refined.summary.lens_refined);
  EXPECT_NEAR(refined.camera.distortion[0], 0.05, 5e-3);
  EXPECT_EQ(refined.camera.fx, scene.camera.fx);
  EXPECT_FALSE(held.summary.lens_refined);
  EXPECT_EQ(held.camera, scene.camera);
  EXPECT_LT(CenterError(refined.reconstruction, scene.truth),
            0.5 * CenterError(held.reconstruction, scene.truth));
  // Bearings follow the lens.
  const Observation& observation = refined.reconstruction.tracks.front().observations.front();
  EXPECT_LT((observation.bearing - *refined.camera.Unproject(observation.keypoint_px)).norm(),
            1e-12);
}

TEST(RefineBundle, RefinesTheFirstCoefficientOfEveryModel) {
  for (const auto& [model, change] : {std::pair(CameraModel::kEquidistant, 0.05),
                                      std::pair(CameraModel::kRational, 0.05),
                                      std::pair(CameraModel::kFov, 0.04)}) {
    Camera lens = BaCamera(model);
    lens.distortion[0] += change;
    BaScene scene =
        MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.2, .camera = lens});
    scene.camera = BaCamera(model);
    BundleOptions options;
    options.find_covariance = true;
    options.lens.distortion_sigma = 0.05;
    const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.1, 0.5), options);
    SCOPED_TRACE(Name(model));
    ASSERT_TRUE(result.Usable());
    ASSERT_TRUE(result.summary.lens_refined) << result.summary.lens_gain;
    EXPECT_EQ(result.camera.model, model);
    EXPECT_FALSE(result.camera.Problem());
    EXPECT_NEAR(result.camera.distortion[0], lens.distortion[0], 0.2 * change);
    ASSERT_TRUE(result.summary.lens_sigmas.has_value());
    EXPECT_GT(result.summary.lens_sigmas->distortion[0], 0.0);
    EXPECT_EQ(result.summary.lens_sigmas->distortion[1] > 0.0, model != CameraModel::kFov);
    for (std::size_t k = model == CameraModel::kFov ? 1 : 2; k < lens.distortion.size(); ++k) {
      EXPECT_EQ(result.camera.distortion[k], lens.distortion[k]) << k;
    }
  }
}

TEST(RefineBundle, RefinesAFocalLengthWhenAsked) {
  Camera lens = BaCamera();
  lens.fx *= 1.02;
  lens.fy *= 1.02;
  BaScene scene =
      MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.2, .camera = lens});
  scene.camera = BaCamera();
  BundleOptions options;
  options.lens.refine_focal = true;
  options.lens.refine_distortion = false;
  options.lens.focal_sigma = 0.05;
  options.lens.min_gain = 0.0;
  options.coarse.function_tolerance = 1e-8;
  const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.1, 0.5), options);
  ASSERT_TRUE(result.Usable());
  EXPECT_NEAR(result.camera.fx / lens.fx, 1.0, 2e-3);
  EXPECT_EQ(result.camera.model, CameraModel::kPinhole);
}

TEST(RefineBundle, RefinesAPrincipalPointWhenAsked) {
  Camera lens = BaCamera();
  lens.cx += 8.0;
  lens.cy -= 5.0;
  BaScene scene =
      MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.2, .camera = lens});
  scene.camera = BaCamera();
  BundleOptions options;
  options.find_covariance = true;
  options.lens.refine_principal_point = true;
  options.lens.refine_distortion = false;
  options.lens.principal_sigma = 0.05;
  options.lens.min_gain = 0.0;
  options.coarse.function_tolerance = 1e-8;
  const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.1, 0.5), options);
  ASSERT_TRUE(result.Usable());
  ASSERT_TRUE(result.summary.lens_sigmas.has_value());
  // Keypoints are five times as good as their sigma says.
  EXPECT_NEAR(result.camera.cx, lens.cx, 0.6 * result.summary.lens_sigmas->cx_px);
  EXPECT_NEAR(result.camera.cy, lens.cy, 0.6 * result.summary.lens_sigmas->cy_px);
  EXPECT_NEAR(result.camera.cx, lens.cx, 2.0);
  EXPECT_NEAR(result.camera.cy, lens.cy, 2.0);
  EXPECT_EQ(result.camera.fx, lens.fx);
  EXPECT_EQ(result.camera.model, CameraModel::kPinhole);
}

// Keypoints that are ten times as good as their sigma says, and a principal point that is six
// deviations of its prior from where most are.
TEST(RefineBundle, WeighsWhatIsExpectedOfALensByTheResiduals) {
  Camera lens = BaCamera();
  lens.cx += 0.06 * lens.fx;
  BaScene scene =
      MakeBaScene({.num_frames = 40, .num_points = 400, .noise_px = 0.1, .camera = lens});
  scene.camera = lens;
  BundleOptions options;
  options.find_lens_covariance = true;
  options.lens.refine_principal_point = true;
  options.lens.refine_distortion = false;
  options.lens.principal_sigma = 0.01;
  options.lens.min_gain = 0.0;
  options.lens.expected = BaCamera();
  options.coarse.function_tolerance = 1e-8;
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  const BundleResult plain = RefineBundle(problem, options);
  options.lens.weighs_by_residuals = true;
  const BundleResult weighed = RefineBundle(problem, options);
  ASSERT_TRUE(plain.Usable() && weighed.Usable());
  EXPECT_LT(std::abs(weighed.camera.cx - lens.cx), 0.5 * std::abs(plain.camera.cx - lens.cx));
  ASSERT_TRUE(plain.summary.lens_sigmas && weighed.summary.lens_sigmas);
  EXPECT_LT(weighed.summary.lens_sigmas->cx_px, 0.8 * plain.summary.lens_sigmas->cx_px);
  EXPECT_LT(std::abs(weighed.camera.cx - lens.cx), 2.5 * weighed.summary.lens_sigmas->cx_px);
  ASSERT_TRUE(weighed.summary.lens_covariance);
  EXPECT_NEAR(std::sqrt((*weighed.summary.lens_covariance)(kLensCenter, kLensCenter)) * lens.fx,
              weighed.summary.lens_sigmas->cx_px,
              1e-9);
}

// A lens that is off centre by its tangential coefficients has them refined; one that has none, or
// hardly any, is taken to be centred.
TEST(RefineBundle, RefinesTangentialCoefficientsWhereTheyGainMuch) {
  for (const double tangential : {0.0, 5e-5, 2e-3}) {
    Camera lens = BaCamera(CameraModel::kRadtan);
    lens.distortion = {0.05, -0.01, tangential, -0.5 * tangential, 0.0};
    BaScene scene =
        MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.2, .camera = lens});
    scene.camera = BaCamera();
    BundleOptions options;
    options.find_lens_covariance = true;
    options.lens.refine_principal_point = true;
    options.lens.refine_higher_terms = true;
    options.lens.distortion_sigma = 0.1;
    options.lens.tangential_share = 0.05;
    options.lens.min_tangential_gain = 0.002;
    const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.1, 0.5), options);
    SCOPED_TRACE(tangential);
    ASSERT_TRUE(result.Usable());
    ASSERT_TRUE(result.summary.lens_refined) << result.summary.lens_gain;
    ASSERT_TRUE(result.summary.lens_sigmas);
    EXPECT_NEAR(result.camera.distortion[0], 0.05, 5e-3);
    if (tangential > 1e-3) {
      EXPECT_NEAR(result.camera.distortion[2], tangential, 0.2 * tangential);
      EXPECT_GT(result.summary.lens_sigmas->distortion[2], 0.0);
    } else {
      EXPECT_EQ(result.camera.distortion[2], 0.0) << result.summary.tangential_gain;
      EXPECT_EQ(result.camera.distortion[3], 0.0);
      EXPECT_EQ(result.summary.lens_sigmas->distortion[2], 0.0);
    }
  }
}

TEST(RefineBundle, LeavesAGoodCalibrationToTheLastBit) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    const BaScene scene = MakeBaScene({.noise_px = 0.5, .seed = seed});
    const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.1, 0.5), {});
    ASSERT_TRUE(result.Usable());
    EXPECT_FALSE(result.summary.lens_refined) << result.summary.lens_gain;
    EXPECT_EQ(result.camera, scene.camera);
  }
}

TEST(RefineBundle, GivesTheLensNoCreditForWhatTheCoarseRoundLeft) {
  const BaScene scene = MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.5});
  BundleOptions options;
  options.fixed_rotation.enabled = false;
  for (const int iterations : {1, 2, 3}) {
    options.coarse.max_iterations = iterations;
    const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.1, 0.5), options);
    ASSERT_TRUE(result.Usable());
    EXPECT_FALSE(result.summary.lens_refined) << iterations << " " << result.summary.lens_gain;
  }
}

// What a rectified camera may have left: one pixel at the image's side.
TEST(RefineBundle, RefinesAWeakDistortion) {
  Camera lens = BaCamera(CameraModel::kRadtan);
  lens.distortion = {0.01, 0.0, 0.0, 0.0, 0.0};
  BaScene scene =
      MakeBaScene({.num_frames = 40, .num_points = 1500, .noise_px = 0.5, .camera = lens});
  scene.camera = BaCamera();
  const BundleProblem problem = PerturbedProblem(scene, 0.1, 0.5);
  BundleOptions options;
  const BundleResult refined = RefineBundle(problem, options);
  options.lens.refine_distortion = false;
  const BundleResult held = RefineBundle(problem, options);
  ASSERT_TRUE(refined.Usable() && held.Usable());
  ASSERT_TRUE(refined.summary.lens_refined) << refined.summary.lens_gain;
  EXPECT_LT(CenterError(refined.reconstruction, scene.truth),
            0.8 * CenterError(held.reconstruction, scene.truth));
}

// Squared errors in units of the stated covariance, per degree of freedom, over many noises.
double NormalisedErrors(const BaSceneOptions& street, const BundleOptions& options) {
  double sum = 0.0;
  int count = 0;
  BaSceneOptions noisy = street;
  for (noisy.seed = 1; noisy.seed <= 8; ++noisy.seed) {
    const BaScene scene = MakeBaScene(noisy);
    // From the truth: the gauge is the truth's.
    const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.0, 0.0), options);
    for (const auto& [frame, covariance] : result.pose_covariance) {
      if (covariance.topLeftCorner<3, 3>().isZero()) continue;
      Eigen::Matrix<double, 6, 1> error;
      error << (result.reconstruction.cam_from_world.at(frame) *
                scene.truth.cam_from_world.at(frame).Inverse())
                   .Log(),
          result.reconstruction.center_in_world.at(frame) - scene.truth.center_in_world.at(frame);
      // The farthest centre's distance is held.
      sum += error.dot((covariance + 1e-14 * PoseCovariance::Identity()).ldlt().solve(error));
      count += 6;
    }
  }
  return sum / count;
}

TEST(RefineBundle, StatesTheErrorsThatNoiseMakes) {
  BundleOptions options = ExactOptions();
  options.find_covariance = true;
  options.lens.refine_distortion = false;
  const BaSceneOptions street = {.num_frames = 12, .num_points = 200, .noise_px = 1.0};
  EXPECT_NEAR(NormalisedErrors(street, options), 1.0, 0.35);
  BaSceneOptions turning = street;
  turning.still_first = 4;
  turning.still_last = 7;
  EXPECT_NEAR(NormalisedErrors(turning, options), 1.0, 0.35);
}

TEST(RefineBundle, HoldsWhatItStatesNoErrorOf) {
  const BaScene scene = MakeBaScene({.noise_px = 0.5});
  BundleOptions options = ExactOptions();
  options.find_covariance = true;
  options.refine_rotations = false;
  const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.0, 0.3), options);
  ASSERT_EQ(result.pose_covariance.size(), scene.truth.center_in_world.size());
  EXPECT_TRUE(result.pose_covariance.at(FrameId{0}).isZero());
  const PoseCovariance& covariance = result.pose_covariance.at(FrameId{10});
  EXPECT_TRUE(covariance.topRows(3).isZero());
  EXPECT_FALSE(covariance.bottomRightCorner(3, 3).isZero());
  EXPECT_TRUE(
      RefineBundle(PerturbedProblem(scene, 0.0, 0.3), ExactOptions()).pose_covariance.empty());
}

TEST(RefineBundle, StatesHowWellTheLensIsKnown) {
  Camera lens = BaCamera();
  lens.fx *= 1.02;
  lens.fy *= 1.02;
  BundleOptions options;
  options.find_covariance = true;
  options.lens.refine_focal = true;
  options.lens.refine_distortion = false;
  options.lens.focal_sigma = 1.0;  // the images alone decide
  options.lens.min_gain = 0.0;
  options.fine.function_tolerance = options.coarse.function_tolerance = 1e-9;
  double sum = 0.0;
  constexpr int kSeeds = 6;
  for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
    BaScene scene = MakeBaScene({.noise_px = 1.0, .seed = seed, .camera = lens});
    scene.camera = BaCamera();
    const BundleResult result = RefineBundle(PerturbedProblem(scene, 0.0, 0.0), options);
    ASSERT_TRUE(result.summary.lens_sigmas.has_value());
    EXPECT_EQ(result.summary.lens_sigmas->distortion[0], 0.0);
    const double error = (result.camera.fx - lens.fx) / result.summary.lens_sigmas->focal_px;
    sum += error * error;
  }
  // The mean of six squared normal variables lies in this with a probability of 0.998.
  EXPECT_GT(sum / kSeeds, 0.06);
  EXPECT_LT(sum / kSeeds, 3.8);
}

TEST(RefineBundle, SaysSoWhenThereIsTooLittle) {
  const BaScene scene = MakeBaScene({});
  BundleProblem empty;
  empty.camera = scene.camera;
  EXPECT_EQ(RefineBundle(empty, {}).status, BundleStatus::kTooLittleData);
  BundleProblem no_tracks = PerturbedProblem(scene, 0.0, 0.0);
  no_tracks.start.tracks.clear();
  EXPECT_FALSE(RefineBundle(no_tracks, {}).Usable());
  // All cameras in one place: no depth anywhere.
  BundleProblem one_place = PerturbedProblem(scene, 0.0, 0.0);
  for (auto& [frame, center] : one_place.start.center_in_world) center.setZero();
  const BundleResult result = RefineBundle(one_place, {});
  EXPECT_EQ(result.status, BundleStatus::kTooLittleData);
  EXPECT_EQ(result.reconstruction.center_in_world.size(), scene.truth.center_in_world.size());
  BundleProblem all_fixed = PerturbedProblem(scene, 0.0, 0.0);
  for (const auto& [frame, center] : all_fixed.start.center_in_world) {
    all_fixed.fixed_frames.insert(frame);
  }
  EXPECT_EQ(RefineBundle(all_fixed, {}).status, BundleStatus::kTooLittleData);
}

TEST(RefineBundle, RefusesBrokenContracts) {
  const BaScene scene = MakeBaScene({.num_frames = 5, .num_points = 30});
  const BundleProblem good = PerturbedProblem(scene, 0.0, 0.0);
  const auto refuses = [&](const auto& damage) {
    BundleProblem problem = good;
    damage(problem);
    EXPECT_THROW(RefineBundle(problem, {}), std::invalid_argument);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refuses([&](BundleProblem& p) { p.start.center_in_world[FrameId{2}].x() = nan; });
  refuses([&](BundleProblem& p) { p.start.point_in_world[TrackId{2}] = {nan, 0.0, 0.0}; });
  refuses([&](BundleProblem& p) { p.start.tracks[0].observations[0].keypoint_px.x() = nan; });
  refuses([&](BundleProblem& p) { p.start.tracks[0].observations[0].sigma_px = 0.0; });
  refuses([&](BundleProblem& p) { p.start.tracks[1].id = p.start.tracks[0].id; });
  refuses([&](BundleProblem& p) {
    p.start.tracks[0].observations.push_back(p.start.tracks[0].observations[0]);
  });
  refuses([&](BundleProblem& p) { p.fixed_frames.insert(FrameId{99}); });
  refuses([&](BundleProblem& p) { p.shared_center[FrameId{1}] = FrameId{99}; });
  refuses([&](BundleProblem& p) {
    p.shared_center = {{FrameId{1}, FrameId{2}}, {FrameId{2}, FrameId{1}}};
  });
  refuses([&](BundleProblem& p) { p.camera.fx = 0.0; });
  BundleOptions options;
  options.fine.loss_scale = 0.0;
  EXPECT_EQ(options.Problem(), "fine.loss_scale is 0, must be positive");
  EXPECT_THROW(RefineBundle(good, options), std::invalid_argument);
}

TEST(WithoutShallowPoints, KeepsOnlyPointsWhoseRaysMeet) {
  const BaScene scene = MakeBaScene({});
  const Reconstruction deep = WithoutShallowPoints(scene.truth, 5.0);
  EXPECT_LT(deep.tracks.size(), scene.truth.tracks.size());
  EXPECT_GT(deep.tracks.size(), scene.truth.tracks.size() / 10);
  EXPECT_EQ(deep.tracks.size(), deep.point_in_world.size());
  EXPECT_EQ(deep.center_in_world.size(), scene.truth.center_in_world.size());
}

}  // namespace
}  // namespace rotslam
