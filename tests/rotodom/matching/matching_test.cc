#include "rotodom/matching/matching.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

struct TurnedView {
  cv::Mat image;
  Features features;
  std::vector<cv::Mat> pyramid;
};

TurnedView MakeView(int frame, const Rotation& cam_from_world, int max_features = 600) {
  static const TexturedWorld world;
  FeatureOptions options;
  options.max_features = max_features;
  TurnedView view;
  view.image = world.View(SmallCamera(), cam_from_world);
  view.features = ExtractFeatures(view.image, FrameId{frame}, SmallCamera(), options, 1);
  view.pyramid = BuildPatchPyramid(view.image, {});
  return view;
}

Rotation Turn(double x_deg, double y_deg, double z_deg) {
  return Rotation::Exp(kRadFromDeg * Eigen::Vector3d(x_deg, y_deg, z_deg));
}

// Distance of each match from where the true rotation puts keypoint i, ascending, px.
std::vector<double> ErrorsPx(const Matches& matches,
                             const Features& features_i,
                             const Rotation& j_from_i) {
  std::vector<double> errors;
  for (const Match& match : matches.matches) {
    const auto truth = SmallCamera().Project(j_from_i * features_i.bearings[match.i.value]);
    errors.push_back(truth ? (*truth - match.keypoint_j_px).norm() : 1e3);
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

Matches Refined(const Matches& matches, const TurnedView& view_i, const TurnedView& view_j) {
  return RefineMatches(matches,
                       view_i.features,
                       view_j.features,
                       view_i.pyramid,
                       view_j.pyramid,
                       {},
                       FeatureOptions{}.scale_factor);
}

TEST(MatchFeatures, FollowsTheTrueRotation) {
  const Rotation j_from_i = Turn(3.0, -5.0, 2.0);
  const TurnedView view_i = MakeView(0, Rotation());
  const TurnedView view_j = MakeView(4, j_from_i);
  const Matches matches =
      MatchFeatures(view_i.features, view_j.features, j_from_i, SmallCamera(), {});
  EXPECT_EQ(matches.frame_i, FrameId{0});
  EXPECT_EQ(matches.frame_j, FrameId{4});
  EXPECT_EQ(matches.range, SearchRange::kGuided);
  EXPECT_GT(matches.matches.size(), 200u);
  ExpectOneToOne(matches);
  // Corners lie on the pixel grid of their level, so half a pixel times 1.2^7 at most where right.
  EXPECT_LT(Quantile(ErrorsPx(matches, view_i.features, j_from_i), 0.9), 2.5);
}

TEST(MatchFeatures, WidensTheSearchAsFarAsNeeded) {
  struct Case {
    Rotation j_from_i;
    SearchRange range;
  };
  const TurnedView view_i = MakeView(0, Rotation());
  MatchingOptions options;
  options.radius_px = 20.0;
  options.wide_radius_px = 60.0;
  // Flow: 13 px, 44 px, and up to the image's diagonal.
  for (const auto& [j_from_i, range] : {Case{Turn(0, 3, 0), SearchRange::kGuided},
                                        Case{Turn(0, 10, 0), SearchRange::kWide},
                                        Case{Turn(0, 0, 160), SearchRange::kWholeImage}}) {
    const TurnedView view_j = MakeView(1, j_from_i);
    const Matches matches =
        MatchFeatures(view_i.features, view_j.features, Rotation(), SmallCamera(), options);
    EXPECT_EQ(matches.range, range);
    ExpectOneToOne(matches);
    ASSERT_GT(matches.matches.size(), 80u) << j_from_i.AngleDeg();
    EXPECT_LT(Quantile(ErrorsPx(matches, view_i.features, j_from_i), 0.8), 3.0)
        << j_from_i.AngleDeg() << " deg";
  }
}

// Widening is to help, not to lose matches to rivals elsewhere in the image.
TEST(MatchFeatures, FewFeaturesAreStillMatched) {
  const Rotation j_from_i = Turn(1.0, 1.0, 0.0);
  const TurnedView view_i = MakeView(0, Rotation(), 100);
  const TurnedView view_j = MakeView(1, j_from_i, 100);
  MatchingOptions guided;
  guided.min_matches = 0;
  const Matches near =
      MatchFeatures(view_i.features, view_j.features, j_from_i, SmallCamera(), guided);
  const Matches far = MatchFeatures(view_i.features, view_j.features, j_from_i, SmallCamera(), {});
  const auto right = [&](const Matches& matches) {
    const std::vector<double> errors = ErrorsPx(matches, view_i.features, j_from_i);
    return std::count_if(errors.begin(), errors.end(), [](double e) { return e < 3.0; });
  };
  RecordProperty("near", static_cast<int>(right(near)));
  RecordProperty("far", static_cast<int>(right(far)));
  EXPECT_GE(right(far), right(near) * 9 / 10);
}

TEST(MatchFeatures, ReadBackwardsFindsThePairsAgain) {
  const Rotation j_from_i = Turn(-2.0, 4.0, 1.0);
  const TurnedView view_i = MakeView(0, Rotation());
  const TurnedView view_j = MakeView(1, j_from_i);
  const Matches forward =
      MatchFeatures(view_i.features, view_j.features, j_from_i, SmallCamera(), {});
  const Matches backward =
      MatchFeatures(view_j.features, view_i.features, j_from_i.Inverse(), SmallCamera(), {});
  std::set<std::pair<int, int>> pairs;
  for (const Match& match : forward.matches) pairs.insert({match.i.value, match.j.value});
  int again = 0;
  for (const Match& match : backward.matches)
    again += pairs.contains({match.j.value, match.i.value});
  EXPECT_GT(again, 0.85 * static_cast<double>(forward.matches.size()));
}

TEST(MatchFeatures, AViewMatchesItself) {
  const TurnedView view = MakeView(0, Rotation());
  const Matches matches =
      MatchFeatures(view.features, view.features, Rotation(), SmallCamera(), {});
  EXPECT_GT(matches.matches.size(), 0.8 * view.features.size());
  for (const Match& match : matches.matches) {
    EXPECT_LT((view.features.keypoints_px[match.i.value] - match.keypoint_j_px).norm(), 4.0);
  }
}

TEST(MatchFeatures, NothingMatchesNothing) {
  const TurnedView view = MakeView(0, Rotation());
  Features empty;
  empty.frame = FrameId{1};
  EXPECT_TRUE(MatchFeatures(view.features, empty, {}, SmallCamera(), {}).matches.empty());
  EXPECT_TRUE(MatchFeatures(empty, view.features, {}, SmallCamera(), {}).matches.empty());
  EXPECT_TRUE(MatchFeatures(empty, empty, {}, SmallCamera(), {}).matches.empty());
  EXPECT_TRUE(Refined(Matches{}, view, view).matches.empty());
}

// Patches are shifted and not turned, so a roll of the camera costs accuracy.
TEST(RefineMatches, AgreesWithTheTrueWarp) {
  struct Case {
    double roll_deg;
    double max_median_px;
  };
  for (const auto& [roll_deg, max_median_px] : {Case{0.0, 0.1}, Case{2.0, 0.19}}) {
    const Rotation j_from_i = Turn(3.0, -5.0, roll_deg);
    const TurnedView view_i = MakeView(0, Rotation());
    const TurnedView view_j = MakeView(1, j_from_i);
    const Matches rough =
        MatchFeatures(view_i.features, view_j.features, j_from_i, SmallCamera(), {});
    const Matches fine = Refined(rough, view_i, view_j);
    const auto rough_px = ErrorsPx(rough, view_i.features, j_from_i);
    const auto fine_px = ErrorsPx(fine, view_i.features, j_from_i);
    EXPECT_GT(fine.matches.size(), 0.8 * static_cast<double>(rough.matches.size()));
    EXPECT_LT(Quantile(fine_px, 0.5), max_median_px) << "roll " << roll_deg << " deg";
    EXPECT_GT(Quantile(rough_px, 0.5), 0.3);  // the detector's grid: there was something to gain
    RecordProperty("median_px_" + std::to_string(roll_deg), std::to_string(Quantile(fine_px, 0.5)));
    ExpectOneToOne(fine);
  }
}

TEST(RefineMatches, LeavesPerfectMatchesInPlace) {
  const TurnedView view = MakeView(0, Rotation());
  Matches matches;
  for (int k = 0; k < view.features.size(); ++k) {
    matches.matches.push_back({KeypointIndex{k}, KeypointIndex{k}, view.features.keypoints_px[k]});
  }
  const Matches fine = Refined(matches, view, view);
  EXPECT_GT(fine.matches.size(), 0.95 * static_cast<double>(matches.matches.size()));
  for (const Match& match : fine.matches) {
    EXPECT_LT((match.keypoint_j_px - view.features.keypoints_px[match.i.value]).norm(), 0.02);
  }
}

TEST(RefineMatches, DropsWhatCannotBeAligned) {
  const TurnedView view = MakeView(0, Rotation());
  const Matches matches =
      MatchFeatures(view.features, view.features, Rotation(), SmallCamera(), {});
  TurnedView blank = view;
  blank.pyramid = BuildPatchPyramid(cv::Mat(240, 320, CV_8U, cv::Scalar(90)), {});
  EXPECT_TRUE(Refined(matches, blank, view).matches.empty());
  // A wrong pair, a hundred pixels away: if Lucas-Kanade gets anywhere, it is not by a correction.
  MatchingOptions tight;
  tight.max_correction_px = 0.01;
  const Rotation j_from_i = Turn(0.2, 0.1, 0.0);
  const TurnedView view_j = MakeView(1, j_from_i);
  const Matches rough = MatchFeatures(view.features, view_j.features, j_from_i, SmallCamera(), {});
  const Matches kept = RefineMatches(
      rough, view.features, view_j.features, view.pyramid, view_j.pyramid, tight, 1.2);
  EXPECT_LT(kept.matches.size(), rough.matches.size() / 10);
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
  EXPECT_TRUE(
      problem([](Options o) { o.max_level_step = -1; }).starts_with("max_level_step is -1"));
  EXPECT_TRUE(problem([](Options o) { o.patch_px = 8; }).starts_with("patch_px is 8"));
  EXPECT_TRUE(problem([](Options o) { o.patch_levels = 0; }).starts_with("patch_levels is 0"));
  EXPECT_TRUE(
      problem([](Options o) { o.max_correction_px = 0; }).starts_with("max_correction_px is 0"));
  MatchingOptions bad;
  bad.ratio = 0.0;
  EXPECT_THROW(MatchFeatures({}, {}, {}, SmallCamera(), bad), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
