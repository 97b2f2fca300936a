#include "krot/known_rotation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "krot/rotation_convention.h"
#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

SceneOptions Street(int num_views, int num_points) {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = num_views;
  options.num_points = num_points;
  return options;
}

KrotSolution Solve(const Scene& scene, const KrotOptions& options = {}) {
  return SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, options);
}

CenterError ErrorOf(const KrotSolution& solution, const Scene& scene) {
  return CompareCenters(
      solution.center_in_world,
      scene.true_center_in_world,
      AlignCentersKnownRotation(solution.center_in_world, scene.true_center_in_world));
}

TEST(SolveKnownRotation, FindsTheTruthOnCleanScenes) {
  for (const ScenePath path : {ScenePath::kRing, ScenePath::kRandom, ScenePath::kStreet}) {
    for (const KrotStart start : {KrotStart::kL1, KrotStart::kBisection, KrotStart::kPositioning}) {
      SceneOptions scene_options = Street(10, 200);
      scene_options.path = path;
      const Scene scene = MakeScene(scene_options);
      KrotOptions options;
      options.start = start;
      const KrotSolution solution = Solve(scene, options);
      ASSERT_TRUE(solution.Usable()) << solution.message;
      EXPECT_EQ(solution.center_in_world.size(), 10u);
      EXPECT_EQ(solution.center_in_world.begin()->second.norm(), 0.0);
      const Similarity align =
          AlignCentersKnownRotation(solution.center_in_world, scene.true_center_in_world);
      EXPECT_LT(ErrorOf(solution, scene).max, 1e-5)
          << static_cast<int>(path) << static_cast<int>(start);
      EXPECT_LT(MaxPointError(solution.point_in_world, scene.true_point_in_world, align), 1e-4);
      EXPECT_TRUE(solution.removed.empty());
    }
  }
}

TEST(SolveKnownRotation, ClimbsTheLadderOfNoise) {
  // Street of 30 m; rung: pixel noise, rotation noise, error allowed (twice what seeds 1..5 gave).
  struct Rung {
    double noise_px;
    double rotation_noise_deg;
    double max_error;
  };
  for (const Rung& rung :
       {Rung{0.1, 0.0, 0.1}, Rung{0.7, 0.03, 0.4}, Rung{0.7, 0.1, 0.6}, Rung{1.0, 0.3, 1.5}}) {
    SceneOptions scene_options = Street(30, 1500);
    scene_options.noise_px = rung.noise_px;
    scene_options.rotation_noise_deg = rung.rotation_noise_deg;
    const Scene scene = MakeScene(scene_options);
    const KrotSolution solution = Solve(scene);
    ASSERT_TRUE(solution.Usable()) << solution.message;
    EXPECT_EQ(solution.status, KrotStatus::kConverged) << solution.message;
    EXPECT_GE(solution.gamma_low, 0.99 * solution.gamma_high - 1e-12);
    EXPECT_EQ(solution.center_in_world.size(), 30u);
    EXPECT_LT(ErrorOf(solution, scene).max, rung.max_error) << rung.rotation_noise_deg;
    EXPECT_GT(solution.point_in_world.size(), 0.95 * static_cast<double>(scene.tracks.size()));
  }
}

TEST(SolveKnownRotation, ThresholdsFollowTheOrientationsUncertainty) {
  SceneOptions scene_options = Street(20, 800);
  scene_options.noise_px = 0.5;
  Scene scene = MakeScene(scene_options);
  // An odometry's drift: steps of 0.25 deg per axis.
  SceneRandom random(5);
  Rotation drift;
  std::map<FrameId, double> sigma_rad;
  double variance = 0.0;
  for (auto& [frame, rotation] : scene.cam_from_world) {
    rotation = drift * rotation;
    sigma_rad[frame] = std::sqrt(variance);
    const double step = 0.25 * kRadFromDeg;
    drift = Rotation::Exp({random.Normal(step), random.Normal(step), random.Normal(step)}) * drift;
    variance += step * step;
  }
  KrotOptions options;
  options.use_bracket = false;
  const KrotSolution fixed =
      SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, options);
  const KrotSolution grown =
      SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, options, sigma_rad);
  ASSERT_TRUE(fixed.Usable() && grown.Usable());
  EXPECT_LT(grown.removed.size(), 0.5 * static_cast<double>(fixed.removed.size()));
  // Uncertainty that all views share is none between them.
  for (auto& [frame, sigma] : sigma_rad) sigma = 0.1;
  const KrotSolution shared =
      SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, options, sigma_rad);
  EXPECT_EQ(shared.removed.size(), fixed.removed.size());
}

TEST(SolveKnownRotation, TenPercentOutliersAreRemovedAndChangeLittle) {
  SceneOptions scene_options = Street(30, 1500);
  scene_options.noise_px = 0.7;
  scene_options.rotation_noise_deg = 0.03;
  scene_options.outlier_ratio = 0.1;
  const Scene scene = MakeScene(scene_options);
  int num_observations = 0;
  for (const Track& track : scene.tracks) {
    num_observations += static_cast<int>(track.observations.size());
  }
  for (const KrotStart start : {KrotStart::kL1, KrotStart::kPositioning}) {
    KrotOptions options;
    options.start = start;
    const KrotSolution solution = Solve(scene, options);
    ASSERT_TRUE(solution.Usable()) << solution.message;
    int caught = 0;
    for (const RemovedObservation& removed : solution.removed) {
      caught += scene.outliers.contains({removed.track, removed.frame});
    }
    EXPECT_GT(caught, 0.95 * static_cast<double>(scene.outliers.size())) << static_cast<int>(start);
    EXPECT_LT(static_cast<double>(solution.removed.size()) - caught, 0.02 * num_observations);
    EXPECT_LT(ErrorOf(solution, scene).max, 1.0) << static_cast<int>(start);
  }
}

TEST(SolveKnownRotation, BracketCoversWhatItKeepsAndNamesWhatHoldsIt) {
  SceneOptions scene_options = Street(20, 1000);
  scene_options.noise_px = 0.7;
  const Scene scene = MakeScene(scene_options);
  const KrotSolution solution = Solve(scene);
  ASSERT_EQ(solution.status, KrotStatus::kConverged) << solution.message;
  EXPECT_LE(solution.Gap(), 0.01);
  int num_observations = 0;
  for (const Track& track : scene.tracks) {
    if (!solution.point_in_world.contains(track.id)) continue;
    num_observations += static_cast<int>(track.observations.size());
  }
  EXPECT_EQ(solution.num_bracket_observations,
            num_observations - static_cast<int>(solution.removed.size()));
  // A minimum of so many unknowns hangs on several observations at once.
  EXPECT_GE(solution.active.size(), 4u);
  for (const ActiveObservation& active : solution.active) {
    EXPECT_TRUE(solution.point_in_world.contains(active.track));
    EXPECT_TRUE(solution.center_in_world.contains(active.frame));
  }
}

TEST(SolveKnownRotation, LargeComponentsGoWithoutABracketButForPositionsThatNeedIt) {
  SceneOptions scene_options = Street(20, 1000);
  scene_options.noise_px = 0.7;
  const Scene scene = MakeScene(scene_options);
  const KrotSolution whole = Solve(scene);
  KrotOptions options;
  options.max_bracket_views = 20;
  EXPECT_EQ(Solve(scene, options).gamma_low, whole.gamma_low);
  options.max_bracket_views = 19;
  const KrotSolution large = Solve(scene, options);
  ASSERT_TRUE(large.Usable()) << large.message;
  EXPECT_EQ(large.status, KrotStatus::kIterationLimit);
  EXPECT_EQ(large.gamma_low, 0.0);
  EXPECT_GE(large.gamma_high, whole.gamma_low);
  EXPECT_EQ(large.num_bracket_observations, whole.num_bracket_observations);
  EXPECT_EQ(large.center_in_world, whole.center_in_world);
  options.start = KrotStart::kBisection;
  EXPECT_EQ(Solve(scene, options).status, KrotStatus::kConverged);
  options.max_bracket_views = 0;
  EXPECT_THROW(Solve(scene, options), std::invalid_argument);
}

TEST(SolveKnownRotation, CancelledItKeepsPositionsAndAValidBracket) {
  SceneOptions scene_options = Street(20, 1000);
  scene_options.noise_px = 0.7;
  const Scene scene = MakeScene(scene_options);
  const KrotSolution whole = Solve(scene);
  KrotOptions options;
  int calls = 0;
  options.bisection.on_progress = [&](const BisectionProgress&) { return ++calls < 2; };
  const KrotSolution cancelled = Solve(scene, options);
  EXPECT_EQ(cancelled.status, KrotStatus::kCancelled);
  EXPECT_EQ(calls, 2);
  EXPECT_TRUE(cancelled.Usable());
  EXPECT_EQ(cancelled.center_in_world.size(), 20u);
  EXPECT_GT(cancelled.Gap(), whole.Gap());
  EXPECT_LE(cancelled.gamma_low, whole.gamma_high);
  EXPECT_GE(cancelled.gamma_high, whole.gamma_low);
}

TEST(SolveKnownRotation, SolvesInBlocksWhatIsLongerThanOneProgram) {
  SceneOptions scene_options = Street(40, 3000);
  scene_options.noise_px = 0.5;
  const Scene scene = MakeScene(scene_options);
  const double whole = ErrorOf(Solve(scene), scene).max;
  KrotOptions options;
  options.max_lp_views = 15;
  const KrotSolution solution = Solve(scene, options);
  ASSERT_TRUE(solution.Usable()) << solution.message;
  EXPECT_EQ(solution.center_in_world.size(), 40u);
  EXPECT_EQ(solution.num_grown_views, 0);
  EXPECT_LT(ErrorOf(solution, scene).max, 3.0 * whole);
  // Without programs there are no blocks.
  options.start = KrotStart::kPositioning;
  options.use_bracket = false;
  const KrotSolution positioned = Solve(scene, options);
  EXPECT_EQ(positioned.center_in_world.size(), 40u);
  EXPECT_EQ(positioned.num_programs, 0);
  options.max_lp_views = 100;
  EXPECT_EQ(Solve(scene, options).center_in_world, positioned.center_in_world);
}

TEST(SolveKnownRotation, RelabellingViewsChangesNothing) {
  SceneOptions scene_options;
  scene_options.num_views = 8;
  scene_options.num_points = 80;
  const Scene scene = MakeScene(scene_options);
  const auto relabelled = [](FrameId frame) { return FrameId{1000 - 7 * frame.value}; };
  Scene other = scene;
  other.cam_from_world.clear();
  for (const auto& [frame, rotation] : scene.cam_from_world) {
    other.cam_from_world[relabelled(frame)] = rotation;
  }
  for (Track& track : other.tracks) {
    std::reverse(track.observations.begin(), track.observations.end());
    for (Observation& observation : track.observations) {
      observation.frame = relabelled(observation.frame);
    }
  }
  CenterMap back;
  const KrotSolution b = Solve(other);
  for (const auto& [frame, center] : b.center_in_world) {
    back[FrameId{(1000 - frame.value) / 7}] = center;
  }
  const KrotSolution a = Solve(scene);
  ASSERT_EQ(a.center_in_world.size(), back.size());
  const Similarity align = AlignCentersKnownRotation(back, a.center_in_world);
  EXPECT_LT(CompareCenters(back, a.center_in_world, align).max, 1e-6);
  // Gauge by median depth: the scale agrees without alignment.
  EXPECT_NEAR(align.scale, 1.0, 1e-6);
}

TEST(SolveKnownRotation, RepeatsItsBytesWithAnyNumberOfThreads) {
  SceneOptions scene_options = Street(20, 800);
  scene_options.noise_px = 0.7;
  scene_options.outlier_ratio = 0.05;
  const Scene scene = MakeScene(scene_options);
  KrotOptions options;
  const KrotSolution a = Solve(scene, options);
  options.num_threads = 3;
  const KrotSolution b = Solve(scene, options);
  EXPECT_EQ(a.center_in_world, b.center_in_world);
  EXPECT_EQ(a.point_in_world, b.point_in_world);
  EXPECT_EQ(a.gamma_low, b.gamma_low);
  EXPECT_EQ(a.gamma_high, b.gamma_high);
}

// `second` behind `first`, its frames and tracks renumbered.
void Append(const Scene& second, int first_frame, int first_track, Scene& first) {
  for (const auto& [frame, rotation] : second.cam_from_world) {
    first.cam_from_world[FrameId{frame.value + first_frame}] = rotation;
  }
  for (Track track : second.tracks) {
    track.id.value += first_track;
    for (Observation& observation : track.observations) observation.frame.value += first_frame;
    first.tracks.push_back(std::move(track));
  }
}

TEST(SolveKnownRotation, SeparateScenesComeBackAsComponents) {
  SceneOptions scene_options;
  scene_options.num_views = 6;
  scene_options.num_points = 100;
  Scene scene = MakeScene(scene_options);
  scene_options.num_views = 8;
  scene_options.seed = 5;
  const Scene second = MakeScene(scene_options);
  Append(second, /*first_frame=*/50, /*first_track=*/5000, scene);
  const KrotSolution solution = Solve(scene);
  ASSERT_TRUE(solution.Usable()) << solution.message;
  EXPECT_EQ(solution.center_in_world.size(), 14u);
  EXPECT_EQ(solution.component.at(FrameId{50}), 0);
  EXPECT_EQ(solution.component.at(FrameId{0}), 1);
  CenterMap small;
  for (const auto& [frame, center] : solution.center_in_world) {
    if (frame < FrameId{50}) small[frame] = center;
  }
  const Similarity align = AlignCentersKnownRotation(small, scene.true_center_in_world);
  EXPECT_LT(CompareCenters(small, scene.true_center_in_world, align).max, 1e-5);
}

// Pixels from a track's first observation to its last.
double Flow(const Track& track) {
  return (track.observations.back().keypoint_px - track.observations.front().keypoint_px).norm();
}

// Fifteen matches between two streets that have nothing to do with each other.
TEST(SolveKnownRotation, WhatLiesBehindAChanceBridgeGetsItsOwnComponent) {
  SceneOptions scene_options = Street(20, 1000);
  scene_options.noise_px = 0.5;
  Scene scene = MakeScene(scene_options);
  // Fewer points, for the component to grow from the first street.
  scene_options = Street(20, 600);
  scene_options.noise_px = 0.5;
  scene_options.seed = 5;
  Append(MakeScene(scene_options), /*first_frame=*/20, /*first_track=*/5000, scene);
  int num_bridges = 0;
  for (std::size_t a = 0; a < scene.tracks.size() && num_bridges < 15; ++a) {
    std::vector<Observation>& before = scene.tracks[a].observations;
    // Distant points would go with anything.
    constexpr double kNear_px = 60.0;
    if (before.back().frame != FrameId{19} || before.size() < 3) continue;
    if (Flow(scene.tracks[a]) < kNear_px) continue;
    const auto beyond = std::find_if(
        scene.tracks.begin() + 1000 + num_bridges, scene.tracks.end(), [](const Track& track) {
          return track.id.value >= 5000 && track.observations.front().frame == FrameId{20} &&
                 track.observations.size() >= 4 && Flow(track) >= kNear_px;
        });
    ASSERT_NE(beyond, scene.tracks.end());
    before.insert(before.end(), beyond->observations.begin(), beyond->observations.end());
    scene.tracks.erase(beyond);
    ++num_bridges;
  }
  ASSERT_EQ(num_bridges, 15);
  KrotOptions options;
  options.max_lp_views = 15;
  options.use_epipolar_filter = false;
  const KrotSolution solution = Solve(scene, options);
  ASSERT_TRUE(solution.Usable()) << solution.message;
  EXPECT_GE(solution.center_in_world.size(), 39u) << solution.message;
  EXPECT_NE(solution.component.at(FrameId{5}), solution.component.at(FrameId{35}));
}

TEST(SolveKnownRotation, PureRotationIsInfeasible) {
  SceneOptions scene_options;
  scene_options.path = ScenePath::kPivot;
  for (const double noise_px : {0.0, 0.7}) {
    scene_options.noise_px = noise_px;
    const KrotSolution solution = Solve(MakeScene(scene_options));
    EXPECT_EQ(solution.status, KrotStatus::kInfeasible);
    EXPECT_FALSE(solution.Usable());
    EXPECT_NE(solution.message.find("no parallax"), std::string::npos) << solution.message;
  }
}

TEST(SolveKnownRotation, DegenerateInputsGetAStatus) {
  const Scene scene = MakeScene({});
  EXPECT_EQ(SolveKnownRotation({}, {}, scene.camera, {}).status, KrotStatus::kInfeasible);
  EXPECT_EQ(SolveKnownRotation(scene.cam_from_world, {}, scene.camera, {}).status,
            KrotStatus::kInfeasible);
  Scene single = scene;
  for (Track& track : single.tracks) track.observations.resize(1);
  EXPECT_EQ(Solve(single).status, KrotStatus::kInfeasible);
  Scene empty_tracks = scene;
  for (Track& track : empty_tracks.tracks) track.observations.clear();
  EXPECT_EQ(Solve(empty_tracks).status, KrotStatus::kInfeasible);
  Scene one_view = scene;
  for (Track& track : one_view.tracks) {
    std::erase_if(track.observations,
                  [](const Observation& observation) { return observation.frame.value != 0; });
  }
  EXPECT_EQ(Solve(one_view).status, KrotStatus::kInfeasible);
}

TEST(SolveKnownRotation, BadObservationsAreRemovedWithTheirReason) {
  SceneOptions scene_options;
  scene_options.num_views = 6;
  scene_options.num_points = 60;
  Scene scene = MakeScene(scene_options);
  scene.tracks[3].observations[1].bearing.x() = std::numeric_limits<double>::quiet_NaN();
  scene.tracks[4].observations.push_back(scene.tracks[4].observations.front());
  // Behind the image plane: stays out of the linear programs and disagrees with its point.
  scene.tracks[5].observations[2].bearing = -scene.tracks[5].observations[2].bearing;
  const KrotSolution solution = Solve(scene);
  ASSERT_TRUE(solution.Usable()) << solution.message;
  EXPECT_LT(ErrorOf(solution, scene).max, 1e-5);
  ASSERT_EQ(solution.removed.size(), 3u);
  EXPECT_EQ(solution.removed[0].reason, RemovalReason::kNotFinite);
  EXPECT_EQ(solution.removed[1].reason, RemovalReason::kDuplicate);
  EXPECT_EQ(solution.removed[2].track, scene.tracks[5].id);
}

// Centres and points of the bisection are those that have the upper bound.
TEST(SolveKnownRotation, AttainsTheBracketThatItReports) {
  for (const double rotation_noise_deg : {0.0, 0.1}) {
    SceneOptions scene_options = Street(15, 300);
    scene_options.noise_px = 0.7;
    scene_options.rotation_noise_deg = rotation_noise_deg;
    scene_options.outlier_ratio = 0.02;
    const Scene scene = MakeScene(scene_options);
    KrotOptions options;
    options.start = KrotStart::kBisection;
    const KrotSolution solution = Solve(scene, options);
    ASSERT_EQ(solution.status, KrotStatus::kConverged) << solution.message;
    std::set<std::pair<TrackId, FrameId>> removed;
    for (const RemovedObservation& one : solution.removed) removed.insert({one.track, one.frame});
    double largest = 0.0;
    int count = 0;
    for (const Track& track : scene.tracks) {
      const auto point = solution.point_in_world.find(track.id);
      if (point == solution.point_in_world.end()) continue;
      for (const Observation& observation : track.observations) {
        if (removed.contains({track.id, observation.frame})) continue;
        const Eigen::Vector3d seen =
            scene.cam_from_world.at(observation.frame) *
            (point->second - solution.center_in_world.at(observation.frame));
        ASSERT_GT(seen.z(), 0.0);
        const Eigen::Vector2d miss = seen.hnormalized() - observation.bearing.hnormalized();
        largest = std::max(largest, miss.cwiseAbs().maxCoeff());
        ++count;
      }
    }
    EXPECT_EQ(count, solution.num_bracket_observations);
    EXPECT_NEAR(largest, solution.gamma_high, 1e-9);
    EXPECT_GE(solution.gamma_low, 0.99 * solution.gamma_high);
  }
}

TEST(SolveKnownRotation, SaysWhenRotationsContradictTheTracks) {
  SceneOptions scene_options = Street(15, 600);
  scene_options.path = ScenePath::kRing;
  scene_options.noise_px = 0.5;
  Scene scene = MakeScene(scene_options);
  EXPECT_EQ(Solve(scene).status, KrotStatus::kConverged);
  for (auto& [view, rotation] : scene.cam_from_world) rotation = rotation.Inverse();
  const KrotSolution solution = Solve(scene);
  EXPECT_NE(solution.status, KrotStatus::kConverged) << solution.message;
  EXPECT_NE(solution.status, KrotStatus::kIterationLimit) << solution.message;
}

// Rotations in other conventions are told from right ones, and read back.
TEST(CheckConvention, FindsTheConventionThatFits) {
  SceneOptions scene_options;
  scene_options.num_views = 20;
  scene_options.num_points = 300;
  scene_options.noise_px = 0.5;
  const Scene scene = MakeScene(scene_options);
  const ConventionCheck right = CheckConvention(scene.cam_from_world, scene.tracks);
  EXPECT_GT(right.num_pairs, 3);
  EXPECT_LT(right.given_deg, 0.1);
  EXPECT_EQ(right.other, "");
  const auto read_back = [&](auto change) {
    RotationMap changed;
    for (const auto& [view, rotation] : scene.cam_from_world) changed[view] = change(rotation);
    ConventionCheck check = CheckConvention(changed, scene.tracks);
    EXPECT_GT(check.given_deg, 4.0 * check.other_deg);
    // Up to a common rotation of the world.
    EXPECT_EQ(check.cam_from_world.size(), scene.cam_from_world.size());
    for (const auto& [view, rotation] : check.cam_from_world) {
      const Rotation relative = rotation * check.cam_from_world.begin()->second.Inverse();
      const Rotation expected =
          scene.cam_from_world.at(view) * scene.cam_from_world.begin()->second.Inverse();
      EXPECT_LT((relative.Inverse() * expected).AngleDeg(), 1e-6) << check.other;
    }
    return check.other;
  };
  EXPECT_EQ(read_back([](const Rotation& r) { return r.Inverse(); }), "taken for world->camera");
  // Numbers w x y z that were read as x y z w.
  EXPECT_EQ(read_back([](const Rotation& r) {
              const Eigen::Quaterniond q = r.Inverse().Quaternion();
              return Rotation(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y())).Inverse();
            }),
            "taken for camera->world with qw in front");
  // A body with x forward, y left, z up.
  Eigen::Matrix3d body_from_cam;
  body_from_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Rotation turn = Rotation::FromMatrix(body_from_cam);
  EXPECT_EQ(read_back([&](const Rotation& r) { return turn * r; }),
            "taken for camera->world of a body whose axes -y, -z, x are the camera's x, y, z");
}

TEST(SolveKnownRotation, BrokenContractsThrow) {
  Scene scene = MakeScene({});
  KrotOptions options;
  options.threshold_px = 0.0;
  EXPECT_THROW(Solve(scene, options), std::invalid_argument);
  options = {};
  options.start = KrotStart::kBisection;
  options.use_bracket = false;
  EXPECT_THROW(Solve(scene, options), std::invalid_argument);
  scene.camera.fx = scene.camera.fy = 0.0;
  EXPECT_THROW(Solve(scene), std::invalid_argument);
  scene = MakeScene({});
  scene.cam_from_world.erase(FrameId{2});
  EXPECT_THROW(Solve(scene), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
