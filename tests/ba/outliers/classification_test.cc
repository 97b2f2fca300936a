#include "ba/outliers/classification.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

// The scene's state at the truth, classified.
class ClassifiedScene {
 public:
  explicit ClassifiedScene(const BaSceneOptions& scene_options) {
    BaScene scene = MakeBaScene(scene_options);
    problem_.camera = scene.camera;
    problem_.start = std::move(scene.truth);
    state = MakeBundleState(problem_, options);
    ClassifyAll(options.fine, Placement::kAnywhere, options, state);
  }

  int NumPoints() const {
    return static_cast<int>(
        std::count_if(state.tracks.begin(), state.tracks.end(), [](const TrackState& track) {
          return track.kind == TrackKind::kPoint;
        }));
  }

  const BundleOptions options;
  BundleState state;

 private:
  BundleProblem problem_;
};

TEST(ClassifyAll, LooksForPointsAgainThatAStepHasThrownBehindTheCameras) {
  ClassifiedScene scene({.noise_px = 0.5});
  const int num_points = scene.NumPoints();
  TrackState& track = *std::find_if(
      scene.state.tracks.begin(), scene.state.tracks.end(), [](const TrackState& any) {
        return any.kind == TrackKind::kPoint;
      });
  const Eigen::Vector3d position = track.position;
  const FrameState& frame = scene.state.frames[track.observations.front().frame];
  track.position = 2.0 * scene.state.centers[frame.center] - position;
  ClassifyAll(scene.options.fine, Placement::kStays, scene.options, scene.state);
  EXPECT_EQ(scene.NumPoints(), num_points - 1);
  track.kind = TrackKind::kPoint;
  ClassifyAll(scene.options.fine, Placement::kNearby, scene.options, scene.state);
  EXPECT_EQ(scene.NumPoints(), num_points);
  EXPECT_LT((track.position - position).norm(), 0.05 * position.norm());
}

TEST(ClassifyAll, AnywhereFindsTheSamePointsFromWhereverTheyWere) {
  ClassifiedScene scene({.noise_px = 0.5, .outlier_ratio = 0.05});
  const std::vector<TrackState> found = scene.state.tracks;
  for (TrackState& track : scene.state.tracks) track.position *= 1.001;
  ClassifyAll(scene.options.fine, Placement::kAnywhere, scene.options, scene.state);
  for (std::size_t t = 0; t < found.size(); ++t) {
    EXPECT_EQ(scene.state.tracks[t].kind, found[t].kind);
    EXPECT_EQ(scene.state.tracks[t].position, found[t].position);
  }
}

TEST(ResidualSpread, IsThatOfTheNoise) {
  // Of a length in two dimensions the median is 1.177 standard deviations. Points that are fitted
  // to the noise take a fifth off, which the spread undoes; those here are fitted roughly.
  for (const double noise_px : {0.1, 0.4}) {
    const ClassifiedScene scene({.noise_px = noise_px});
    EXPECT_NEAR(ResidualSpread(scene.state), 1.177 * noise_px, 0.18 * noise_px);
  }
}

TEST(SupportWithin, CountsWhatStatisticsCount) {
  const ClassifiedScene scene({.noise_px = 0.3, .outlier_ratio = 0.05});
  const BundleSupport support = SupportWithin(scene.options.fine, scene.options, scene.state);
  EXPECT_EQ(support.num_points, scene.NumPoints());
  EXPECT_EQ(support.num_observations, Statistics(scene.state).num_observations);
  EXPECT_EQ(support.num_frames, static_cast<int>(scene.state.frames.size()));
  EXPECT_GT(support.cost, 0.0);
}

}  // namespace
}  // namespace rotslam
