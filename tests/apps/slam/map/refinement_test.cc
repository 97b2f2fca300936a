// Known rotation and bundle adjustment in one chain, as `run` and `solve` have it.

#include "apps/slam/map/refinement.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/slam/map_correction/refine_relocalised.h"
#include "tests/scenes/alignment.h"
#include "tests/scenes/scene.h"

namespace rotslam {
namespace {

SceneOptions Street() {
  SceneOptions options;
  options.path = ScenePath::kStreet;
  options.num_views = 30;
  options.num_points = 2000;
  options.noise_px = 0.5;
  options.rotation_noise_deg = 0.03;
  return options;
}

// The same scene with a share of its observations at other pixels: the noise of the rest is the
// same, so that only the outliers make a difference.
Scene WithOutliers(Scene scene, double ratio) {
  SceneRandom random(99);
  for (Track& track : scene.tracks) {
    for (Observation& observation : track.observations) {
      if (random.Uniform(0.0, 1.0) >= ratio) continue;
      observation.keypoint_px = {random.Uniform(0.0, scene.camera.width),
                                 random.Uniform(0.0, scene.camera.height)};
      observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
      scene.outliers.insert({track.id, observation.frame});
    }
  }
  return scene;
}

// Every third track slides off, by a tenth to half a pixel from view to view; the others are better
// than their sigma says.
Scene WithDrift(Scene scene) {
  SceneRandom random(98);
  for (Track& track : scene.tracks) {
    for (Observation& observation : track.observations) observation.sigma_px = 1.0;
    if (track.id.value % 3 != 0) continue;
    const double angle = random.Uniform(0.0, 6.0);
    const double speed_px = random.Uniform(0.1, 0.5);
    const Eigen::Vector2d step = speed_px * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    for (std::size_t k = 0; k < track.observations.size(); ++k) {
      Observation& observation = track.observations[k];
      observation.keypoint_px += static_cast<double>(k) * step;
      observation.bearing = *scene.camera.Unproject(observation.keypoint_px);
    }
  }
  return scene;
}

BundleResult SolveChain(const Scene& scene, KrotStart start) {
  KrotOptions krot_options;
  krot_options.start = start;
  krot_options.use_bracket = start == KrotStart::kBisection;
  const KrotSolution krot =
      SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, krot_options);
  EXPECT_TRUE(krot.Usable()) << krot.message;
  RefinedComponents refined = RefineComponents(
      {scene.cam_from_world, krot.center_in_world, scene.tracks}, krot.component, scene.camera, {});
  EXPECT_EQ(refined.bundles.size(), 1U);
  EXPECT_TRUE(refined.bundles.front().Usable()) << refined.bundles.front().message;
  return std::move(refined.bundles.front());
}

double ErrorOf(const BundleResult& bundle, const Scene& scene) {
  const CenterMap& centers = bundle.reconstruction.center_in_world;
  return CompareCenters(
             centers, scene.true_center_in_world, AlignCenters(centers, scene.true_center_in_world))
      .rmse;
}

// That another of the known-rotation solver's answers leads where the least sum of misses leads, to
// within these shares of the observations and of the cost.
void ExpectOneMinimum(const Scene& scene,
                      KrotStart start,
                      double observation_share,
                      double cost_share) {
  const BundleResult l1 = SolveChain(scene, KrotStart::kL1);
  const BundleResult other = SolveChain(scene, start);
  EXPECT_NEAR(static_cast<double>(other.summary.num_observations) / l1.summary.num_observations,
              1.0,
              observation_share)
      << static_cast<int>(start);
  EXPECT_NEAR(other.summary.final_cost / l1.summary.final_cost, 1.0, cost_share)
      << static_cast<int>(start);
  EXPECT_NE(other.summary.rounds.front().initial_cost, l1.summary.rounds.front().initial_cost);
}

TEST(Chain, ThreeStartsEndInOneMinimum) {
  const Scene scene = WithOutliers(MakeScene(Street()), 0.05);
  ExpectOneMinimum(scene, KrotStart::kBisection, 1e-3, 1e-3);
  ExpectOneMinimum(scene, KrotStart::kPositioning, 1e-3, 1e-3);
}

// Every third track drifts: the loss and the limit are then as wide as the residuals turn out.
Scene DriftingScene(int num_points) {
  SceneOptions options = Street();
  options.num_views = 40;
  options.num_points = num_points;
  options.noise_px = 0.1;
  options.rotation_noise_deg = 0.1;
  return WithDrift(WithOutliers(MakeScene(options), 0.03));
}

TEST(Chain, LInfinityAndL1EndInOneMinimumWhereSomeTracksDrift) {
  ExpectOneMinimum(DriftingScene(6000), KrotStart::kBisection, 5e-5, 1e-4);
}

// It comes from further away, and one observation at the limit is 3.5e-4 of the smaller one's cost.
TEST(Chain, PositioningAndL1EndInOneMinimumWhereSomeTracksDrift) {
  ExpectOneMinimum(DriftingScene(24000), KrotStart::kPositioning, 5e-5, 1e-4);
}

// A street whose last views do not know the tracks of those before: two components.
class TwoComponents : public testing::Test {
 protected:
  static constexpr int kFirstLate = 20;
  static constexpr int kLateIds = 100000;

  TwoComponents() : scene_(MakeScene(Street())) {
    for (const Track& track : scene_.tracks) {
      Track early = track;
      Track late = track;
      late.id.value += kLateIds;
      const auto is_late = [](const Observation& seen) { return seen.frame.value >= kFirstLate; };
      std::erase_if(early.observations, is_late);
      std::erase_if(late.observations, [&](const Observation& seen) { return !is_late(seen); });
      for (const Observation& seen : late.observations) {
        if (early.observations.size() >= 2) common_.emplace_back(track.id, seen);
      }
      if (early.observations.size() >= 2) tracks_.push_back(early);
      if (late.observations.size() >= 2) tracks_.push_back(late);
    }
    const KrotSolution krot =
        SolveKnownRotation(scene_.cam_from_world, tracks_, scene_.camera, KrotOptions());
    refined_ = RefineComponents(
        {scene_.cam_from_world, krot.center_in_world, tracks_}, krot.component, scene_.camera, {});
  }

  // The late views as far away as that.
  RelocalisedMap WholeMap(const Eigen::Vector3d& away) const {
    RelocalisedMap map;
    map.parts = {0, 1};
    map.cam_from_world = scene_.cam_from_world;
    map.center_in_world = scene_.true_center_in_world;
    for (auto& [frame, center] : map.center_in_world) {
      if (frame.value < kFirstLate) continue;
      center += away;
      map.moved.insert(frame);
    }
    map.observations = common_;
    return map;
  }

  // That the components count the rounds of these, and of one adjustment more.
  void ExpectEffortBeside(const std::vector<BundleResult>& parts) const {
    const auto num_rounds = [](const std::vector<BundleResult>& bundles) {
      std::size_t count = 0;
      for (const BundleResult& bundle : bundles) {
        count += bundle.summary.rounds.size();
        int iterations = 0;
        double seconds = 0.0;
        for (const BundleRoundSummary& round : bundle.summary.rounds) {
          iterations += round.iterations;
          seconds += round.seconds;
        }
        EXPECT_EQ(bundle.summary.iterations, iterations);
        EXPECT_GE(bundle.summary.seconds, seconds);
      }
      return count;
    };
    EXPECT_GT(num_rounds(refined_.bundles), num_rounds(parts));
    for (const BundleResult& bundle : refined_.bundles) {
      EXPECT_EQ(bundle.summary.rounds.back().final_cost, bundle.summary.final_cost);
    }
  }

  Scene scene_;
  std::vector<Track> tracks_;
  std::vector<std::pair<TrackId, Observation>> common_;  // of early tracks, in late views
  RefinedComponents refined_;
};

TEST_F(TwoComponents, BecomeOneThatExplainsMore) {
  ASSERT_EQ(refined_.components.size(), 2U);
  const std::vector<BundleResult> parts = refined_.bundles;
  const int num_seen = NumObservations(tracks_);
  refined_.camera.fx *= 1.01;  // as a lens that made up for frames in a wrong place
  const std::set<FrameId> moved =
      RefineRelocalised({WholeMap({0.3, 0.0, 0.2})}, {scene_.camera}, tracks_, refined_);
  EXPECT_EQ(moved.size(), 10U);
  EXPECT_EQ(refined_.camera.fx, scene_.camera.fx);
  EXPECT_EQ(NumObservations(tracks_), num_seen + static_cast<int>(common_.size()));
  ASSERT_EQ(refined_.components.size(), 1U);
  ASSERT_EQ(refined_.bundles.size(), 1U);
  EXPECT_EQ(refined_.components[0].keyframes.size(), 30U);
  ExpectEffortBeside(parts);
  EXPECT_LT(ErrorOf(refined_.bundles[0], scene_),
            2.0 * ErrorOf(SolveChain(scene_, KrotStart::kL1), scene_));
}

TEST_F(TwoComponents, StayWhereTheOneExplainsLess) {
  RelocalisedMap wrong = WholeMap({0.0, 0.0, 0.0});
  for (auto& [frame, rotation] : wrong.cam_from_world) {
    if (frame.value >= kFirstLate) rotation = Rotation::Exp({0.0, 0.05 * frame.value, 0.0});
  }
  const std::vector<BundleResult> parts = refined_.bundles;
  const int num_seen = NumObservations(tracks_);
  EXPECT_TRUE(RefineRelocalised({wrong}, {scene_.camera}, tracks_, refined_).empty());
  EXPECT_EQ(NumObservations(tracks_), num_seen);
  EXPECT_EQ(refined_.components.size(), 2U);
  ASSERT_EQ(refined_.bundles.size(), 2U);
  ExpectEffortBeside(parts);
}

// A street of which one view is not known to the map, and what adding it brings.
struct LostView {
  static constexpr FrameId kLost{15};
  static constexpr int kNumSightings = 60;

  Scene scene = MakeScene(Street());
  std::vector<Track> tracks;
  RefinedComponents refined;
  RelocalisedMap map;

  LostView() {
    for (const Track& track : scene.tracks) {
      Track& known = tracks.emplace_back(track);
      std::erase_if(known.observations,
                    [](const Observation& seen) { return seen.frame == kLost; });
      const bool had = known.observations.size() < track.observations.size();
      if (known.observations.size() < 2) {
        tracks.pop_back();
      } else if (had && map.observations.size() < kNumSightings) {
        map.observations.emplace_back(
            track.id, *std::ranges::find_if(track.observations, [](const Observation& seen) {
              return seen.frame == kLost;
            }));
      }
    }
    const KrotSolution krot =
        SolveKnownRotation(scene.cam_from_world, tracks, scene.camera, KrotOptions());
    refined = RefineComponents(
        {scene.cam_from_world, krot.center_in_world, tracks}, krot.component, scene.camera, {});
    map.parts = {0, 1};
    map.cam_from_world = scene.cam_from_world;
    map.center_in_world = scene.true_center_in_world;
    map.moved = {kLost};
  }

  bool IsAdded() { return !RefineRelocalised({map}, {scene.camera}, tracks, refined).empty(); }
};

TEST(RefineRelocalised, AddsAViewThoughOthersLoseSomeObservations) {
  LostView lost;
  ASSERT_EQ(lost.refined.components.size(), 1U);
  ASSERT_FALSE(lost.refined.components[0].keyframes.contains(LostView::kLost));
  // As if the map without it had been adjusted a little more luckily.
  lost.refined.bundles[0].summary.num_observations += 3 * LostView::kNumSightings;
  EXPECT_TRUE(lost.IsAdded());
  EXPECT_TRUE(lost.refined.components[0].keyframes.contains(LostView::kLost));
}

TEST(RefineRelocalised, AddsNoViewAtAHighPrice) {
  LostView lost;
  BundleSummary& summary = lost.refined.bundles[0].summary;
  summary.num_observations += summary.num_observations / 10;
  EXPECT_FALSE(lost.IsAdded());
}

TEST(RefineRelocalised, AddsNoViewThatFewObservationsBearOut) {
  LostView lost;
  lost.map.observations.resize(20);
  lost.refined.bundles[0].summary.num_observations += 3 * LostView::kNumSightings;
  EXPECT_FALSE(lost.IsAdded());
}

struct Kept {
  double outliers = 0.0;  // shares
  double inliers = 0.0;
};

Kept KeptOf(const BundleResult& bundle, const Scene& scene) {
  double outliers = 0.0;
  double inliers = 0.0;
  for (const Track& track : bundle.reconstruction.tracks) {
    for (const Observation& observation : track.observations) {
      const bool is_outlier = scene.outliers.contains({track.id, observation.frame});
      ++(is_outlier ? outliers : inliers);
    }
  }
  double num_inliers = -static_cast<double>(scene.outliers.size());
  for (const Track& track : scene.tracks) {
    num_inliers += static_cast<double>(track.observations.size());
  }
  return {outliers / static_cast<double>(scene.outliers.size()), inliers / num_inliers};
}

class ChainWithOutliers : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Ratios, ChainWithOutliers, ::testing::Values(0.01, 0.05, 0.1));

TEST_P(ChainWithOutliers, RemovesThemAndKeepsTheRest) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SceneOptions options = Street();
    options.seed = seed;
    const Scene clean = MakeScene(options);
    const Scene dirty = WithOutliers(clean, GetParam());
    const BundleResult with = SolveChain(dirty, KrotStart::kL1);
    const Kept kept = KeptOf(with, dirty);
    EXPECT_LE(kept.outliers, 0.05) << seed;
    EXPECT_GE(kept.inliers, 0.98) << seed;
    EXPECT_LE(ErrorOf(with, dirty), 1.5 * ErrorOf(SolveChain(clean, KrotStart::kL1), clean))
        << seed;
  }
}

TEST(MeanError, CountsEveryObservationOnce) {
  BundleSummary large;
  large.num_observations = 300;
  large.after.mean_px = 0.5;
  BundleSummary small;
  small.num_observations = 100;
  small.after.mean_px = 0.1;
  EXPECT_NEAR(MeanErrorPx({small, large}), 0.4, 1e-12);
  EXPECT_EQ(MeanErrorPx({}), 0.0);
}

}  // namespace
}  // namespace rotslam
