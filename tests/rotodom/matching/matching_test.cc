#include "rotodom/matching/matching.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

Features MakeFeatures(int frame, const Rotation& cam_from_world, int max_features = 600) {
  static const TexturedWorld world;
  FeatureOptions options;
  options.max_features = max_features;
  return ExtractFeatures(
      world.View(SmallCamera(), cam_from_world), FrameId{frame}, SmallCamera(), options, 1);
}

Rotation Turn(double x_deg, double y_deg, double z_deg) {
  return Rotation::Exp(kRadFromDeg * Eigen::Vector3d(x_deg, y_deg, z_deg));
}

// Distance of each match from where the true rotation puts keypoint i, ascending, px.
std::vector<double> ErrorsPx(const Matches& matches,
                             const Features& features_i,
                             const Features& features_j,
                             const Rotation& j_from_i) {
  std::vector<double> errors;
  for (const Match& match : matches.matches) {
    const auto truth = SmallCamera().Project(j_from_i * features_i.bearings[match.i.value]);
    errors.push_back(truth ? (*truth - features_j.keypoints_px[match.j.value]).norm() : 1e3);
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double Quantile(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

void ExpectOneToOne(const Matches& matches) {
  std::set<KeypointIndex> seen_j;
  for (std::size_t k = 0; k < matches.matches.size(); ++k) {
    if (k > 0) {
      EXPECT_GT(matches.matches[k].i, matches.matches[k - 1].i);
    }
    EXPECT_TRUE(seen_j.insert(matches.matches[k].j).second) << matches.matches[k].j.value;
  }
}

TEST(MatchFeatures, FollowsTheTrueRotation) {
  const Rotation j_from_i = Turn(3.0, -5.0, 2.0);
  const Features features_i = MakeFeatures(0, Rotation());
  const Features features_j = MakeFeatures(4, j_from_i);
  const Matches matches = MatchFeatures(features_i, features_j, j_from_i, SmallCamera(), {});
  EXPECT_EQ(matches.frame_i, FrameId{0});
  EXPECT_EQ(matches.frame_j, FrameId{4});
  EXPECT_EQ(matches.range, SearchRange::kGuided);
  EXPECT_GT(matches.matches.size(), 200u);
  ExpectOneToOne(matches);
  // Corners lie on the pixel grid of their level, so half a pixel times 1.2^7 at most where right.
  EXPECT_LT(Quantile(ErrorsPx(matches, features_i, features_j, j_from_i), 0.9), 2.5);
}

TEST(MatchFeatures, WidensTheSearchAsFarAsNeeded) {
  struct Case {
    Rotation j_from_i;
    SearchRange range;
  };
  const Features features_i = MakeFeatures(0, Rotation());
  MatchingOptions options;
  options.radius_px = 20.0;
  options.wide_radius_px = 60.0;
  // Flow: 13 px, 44 px, and up to the image's diagonal.
  for (const auto& [j_from_i, range] : {Case{Turn(0, 3, 0), SearchRange::kGuided},
                                        Case{Turn(0, 10, 0), SearchRange::kWide},
                                        Case{Turn(0, 0, 160), SearchRange::kWholeImage}}) {
    const Features features_j = MakeFeatures(1, j_from_i);
    const Matches matches =
        MatchFeatures(features_i, features_j, Rotation(), SmallCamera(), options);
    EXPECT_EQ(matches.range, range);
    ExpectOneToOne(matches);
    ASSERT_GT(matches.matches.size(), 80u) << j_from_i.AngleDeg();
    EXPECT_LT(Quantile(ErrorsPx(matches, features_i, features_j, j_from_i), 0.8), 3.0)
        << j_from_i.AngleDeg() << " deg";
  }
}

// Widening is to help, not to lose matches to rivals elsewhere in the image.
TEST(MatchFeatures, FewFeaturesAreStillMatched) {
  const Rotation j_from_i = Turn(1.0, 1.0, 0.0);
  const Features features_i = MakeFeatures(0, Rotation(), 100);
  const Features features_j = MakeFeatures(1, j_from_i, 100);
  MatchingOptions guided;
  guided.min_matches = 0;
  const Matches near = MatchFeatures(features_i, features_j, j_from_i, SmallCamera(), guided);
  const Matches far = MatchFeatures(features_i, features_j, j_from_i, SmallCamera(), {});
  const auto right = [&](const Matches& matches) {
    const std::vector<double> errors = ErrorsPx(matches, features_i, features_j, j_from_i);
    return std::count_if(errors.begin(), errors.end(), [](double e) { return e < 3.0; });
  };
  RecordProperty("near", static_cast<int>(right(near)));
  RecordProperty("far", static_cast<int>(right(far)));
  EXPECT_GE(right(far), right(near) * 9 / 10);
}

TEST(MatchFeatures, ReadBackwardsFindsThePairsAgain) {
  const Rotation j_from_i = Turn(-2.0, 4.0, 1.0);
  const Features features_i = MakeFeatures(0, Rotation());
  const Features features_j = MakeFeatures(1, j_from_i);
  const Matches forward = MatchFeatures(features_i, features_j, j_from_i, SmallCamera(), {});
  const Matches backward =
      MatchFeatures(features_j, features_i, j_from_i.Inverse(), SmallCamera(), {});
  std::set<std::pair<int, int>> pairs;
  for (const Match& match : forward.matches) pairs.insert({match.i.value, match.j.value});
  int again = 0;
  for (const Match& match : backward.matches)
    again += pairs.contains({match.j.value, match.i.value});
  EXPECT_GT(again, 0.85 * static_cast<double>(forward.matches.size()));
}

TEST(MatchFeatures, AViewMatchesItself) {
  const Features features = MakeFeatures(0, Rotation());
  const Matches matches = MatchFeatures(features, features, Rotation(), SmallCamera(), {});
  EXPECT_GT(matches.matches.size(), 0.8 * features.size());
  for (const Match& match : matches.matches) {
    EXPECT_LT((features.keypoints_px[match.i.value] - features.keypoints_px[match.j.value]).norm(),
              4.0);
  }
}

TEST(MatchFeatures, NothingMatchesNothing) {
  const Features features = MakeFeatures(0, Rotation());
  Features empty;
  empty.frame = FrameId{1};
  EXPECT_TRUE(MatchFeatures(features, empty, {}, SmallCamera(), {}).matches.empty());
  EXPECT_TRUE(MatchFeatures(empty, features, {}, SmallCamera(), {}).matches.empty());
  EXPECT_TRUE(MatchFeatures(empty, empty, {}, SmallCamera(), {}).matches.empty());
}

TEST(MatchingOptions, NamesTheFirstFieldOutOfRange) {
  EXPECT_FALSE(MatchingOptions{}.Problem());
  const auto problem = [](auto change) {
    MatchingOptions options;
    change(options);
    return options.Problem().value_or("none");
  };
  using Options = MatchingOptions&;
  EXPECT_TRUE(problem([](Options o) { o.radius_px = 0.0; }).starts_with("radius_px is 0"));
  EXPECT_TRUE(
      problem([](Options o) { o.wide_radius_px = 9.0; }).starts_with("wide_radius_px is 9"));
  EXPECT_TRUE(problem([](Options o) { o.min_matches = -1; }).starts_with("min_matches is -1"));
  EXPECT_TRUE(problem([](Options o) { o.max_distance = 257; }).starts_with("max_distance is 257"));
  EXPECT_TRUE(problem([](Options o) { o.ratio = 1.1; }).starts_with("ratio is 1.1"));
  MatchingOptions bad;
  bad.ratio = 0.0;
  EXPECT_THROW(MatchFeatures({}, {}, {}, SmallCamera(), bad), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
