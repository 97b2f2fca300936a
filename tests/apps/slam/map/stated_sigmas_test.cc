#include "apps/slam/map/stated_sigmas.h"

#include <gtest/gtest.h>

#include "apps/slam/lens_estimation.h"

namespace rotslam {
namespace {

const Camera kCamera = UncalibratedCamera({640, 480}, 500.0);

TEST(StatedSigmas, AreThePriorsOfWhatWasHeld) {
  const LensOptions priors;
  const LensSigmas held = StatedSigmas(std::nullopt, priors, kCamera);
  EXPECT_GE(held.focal_px, 500.0 * priors.focal_sigma);
  EXPECT_GE(held.cy_px, 500.0 * priors.principal_sigma);
  for (const double sigma : held.distortion) EXPECT_GT(sigma, 0.0);

  LensSigmas refined;
  refined.distortion = {1e-4, 2e-4};
  const LensSigmas stated = StatedSigmas(refined, priors, kCamera);
  EXPECT_EQ(stated.focal_px, held.focal_px);
  EXPECT_EQ(stated.distortion[4], held.distortion[4]);
  EXPECT_GE(stated.distortion[0], 1e-4);
  EXPECT_LT(stated.distortion[1], held.distortion[1]);
}

TEST(StatedSigmas, OfALensThatNobodyKnowsAreWide) {
  LensOptions priors;
  FreeLens(kCamera, priors);
  const LensSigmas stated = StatedSigmas(std::nullopt, priors, kCamera);
  EXPECT_DOUBLE_EQ(stated.focal_px, 250.0) << "half of a focal length, not more than all of it";
}

TEST(StatedSigmas, AreAdjustmentsOwnWhereResidualsCountedIn) {
  const LensSigmas refined = {0.5, 0.25, 0.125, {1e-4, 2e-4, 1e-5, 2e-5, 4e-4}};
  LensOptions priors;
  LensCovariance covariance = LensCovariance::Identity();
  EXPECT_GT(StatedSigmas(refined, priors, kCamera).focal_px, 2.0 * refined.focal_px);
  EXPECT_GT(StatedCovariance(covariance, priors)(0, 0), 4.0);
  FreeLens(kCamera, priors);
  EXPECT_DOUBLE_EQ(StatedSigmas(refined, priors, kCamera).focal_px, refined.focal_px);
  EXPECT_EQ(StatedCovariance(covariance, priors), covariance);
}

TEST(TakeStatedSigmas, BelievesThem) {
  const LensSigmas stated = {0.5, 0.25, 0.125, {1e-4, 2e-4, 1e-5, 2e-5, 4e-4}};
  LensOptions lens;
  TakeStatedSigmas(stated, kCamera, lens);
  EXPECT_FALSE(lens.Problem());
  EXPECT_TRUE(lens.weighs_by_residuals);
  EXPECT_TRUE(lens.Sigmas(kCamera.model).isApprox(RelativeSigmas(stated, kCamera)));
  EXPECT_EQ(lens.NumBlocks(), 2);
  // Known as well as before where no adjustment has asked the images.
  EXPECT_NEAR(StatedSigmas(std::nullopt, lens, kCamera).focal_px, stated.focal_px, 1e-12);
}

TEST(TakeStatedSigmas, HoldsWhatIsExact) {
  LensOptions lens;
  TakeStatedSigmas({}, kCamera, lens);
  EXPECT_FALSE(lens.RefinesAny());
  LensSigmas focal;
  focal.focal_px = 1.0;
  TakeStatedSigmas(focal, kCamera, lens);
  EXPECT_EQ(lens.NumBlocks(), 1);
  EXPECT_EQ(lens.Sigmas(kCamera.model).tail<11>(), (Eigen::Matrix<double, 11, 1>::Zero()));
}

}  // namespace
}  // namespace rotslam
