#include "rotodom/self_calibration/lens_from_pairs.h"

#include <gtest/gtest.h>

#include "rotodom/self_calibration/find_lens.h"
#include "tests/rotodom/self_calibration/filmed_room.h"

namespace rotslam {
namespace {

Camera Barrel() {
  Camera camera = LensOfModel(CameraModel::kRadtan, 420.0);
  camera.cx += 12.0;
  camera.cy -= 9.0;
  camera.distortion = {-0.18, 0.05};
  return camera;
}

std::optional<FittedLens> FitFrom(double share_of_focal,
                                  double step_m,
                                  double share_wrong,
                                  const LensPairsOptions& options = {}) {
  const Camera truth = Barrel();
  const FilmedRoom room = FilmRoom(truth, step_m, 0.2, share_wrong);
  const auto pairs = ChooseLensPairs(room.features, room.cam_from_world);
  const LensPrior prior =
      UnknownLens(CameraModel::kRadtan, {640, 480}, share_of_focal * truth.fx, 0.5);
  return FitLensToPairs(pairs, prior, prior.camera, options);
}

void ExpectBarrel(const FittedLens& fit, double tolerance) {
  const Camera truth = Barrel();
  EXPECT_NEAR(fit.camera.fx / truth.fx, 1.0, tolerance);
  EXPECT_NEAR(fit.camera.cx, truth.cx, tolerance * 640.0);
  EXPECT_NEAR(fit.camera.cy, truth.cy, tolerance * 640.0);
  EXPECT_NEAR(fit.camera.distortion[0], truth.distortion[0], 3.0 * tolerance);
}

TEST(FitLensToPairs, FindsALensFromAFocalLengthThatIsThirtyPercentOff) {
  for (const double share : {0.7, 1.3}) {
    const auto fit = FitFrom(share, 0.06, 0.0);
    ASSERT_TRUE(fit.has_value());
    ExpectBarrel(*fit, 0.006);
    EXPECT_GE(fit->num_explained, 0.99 * fit->num_points);
    EXPECT_GT(fit->sigmas[kLensFocal], 0.0);
    EXPECT_LT(fit->sigmas[kLensFocal], 0.02);
    EXPECT_EQ(fit->sigmas[kLensAspect], 0.0) << "it is held";
  }
}

TEST(FitLensToPairs, IsNotLedAstrayByWrongMatches) {
  const auto fit = FitFrom(1.2, 0.06, 0.2);
  ASSERT_TRUE(fit.has_value());
  ExpectBarrel(*fit, 0.01);
}

TEST(FitLensToPairs, FindsALensFromATurnInPlace) {
  LensPairsOptions options;
  options.rotates_only = true;
  const auto fit = FitFrom(1.2, 0.0, 0.0, options);
  ASSERT_TRUE(fit.has_value());
  ExpectBarrel(*fit, 0.003);
}

TEST(FitLensToPairs, CostTellsTheRightLens) {
  const Camera truth = Barrel();
  const FilmedRoom room = FilmRoom(truth, 0.06, 0.2, 0.0);
  const auto pairs = ChooseLensPairs(room.features, room.cam_from_world);
  Camera longer = truth;
  longer.fx *= 1.15;
  longer.fy *= 1.15;
  EXPECT_LT(1.5 * CostOfLens(pairs, truth, {}), CostOfLens(pairs, longer, {}));
}

TEST(FitLensToPairs, NeedsThreePairs) {
  const FilmedRoom room = FilmRoom(Barrel(), 0.06, 0.2, 0.0);
  auto pairs = ChooseLensPairs(room.features, room.cam_from_world);
  ASSERT_GT(pairs.size(), 3U);
  pairs.resize(2);
  const LensPrior prior = UnknownLens(CameraModel::kRadtan, {640, 480}, 400.0, 0.5);
  EXPECT_FALSE(FitLensToPairs(pairs, prior, prior.camera, {}));
  EXPECT_FALSE(FitLensToPairs({}, prior, prior.camera, {}));
}

}  // namespace
}  // namespace rotslam
