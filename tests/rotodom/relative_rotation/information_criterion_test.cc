#include "rotodom/relative_rotation/information_criterion.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

constexpr double kNoise = 1e-3;

TEST(InformationCriterion, ChargesATranslationForWhatItCosts) {
  for (const int count : {10, 300}) {
    const std::vector<double> exact(count, 0.0);
    EXPECT_NEAR(EpipolarCriterion(exact, kNoise) - RotationCriterion(exact, kNoise),
                count * std::log(4.0) + 2.0 * std::log(4.0 * count),
                1e-9);
  }
}

TEST(InformationCriterion, CountsResidualsInVariancesUpToALimit) {
  const auto epipolar = [](double distance) {
    return EpipolarCriterion({distance * distance}, kNoise) - EpipolarCriterion({0.0}, kNoise);
  };
  const auto rotation = [](double flow) {
    return RotationCriterion({flow * flow}, kNoise) - RotationCriterion({0.0}, kNoise);
  };
  EXPECT_NEAR(epipolar(kNoise), 1.0, 1e-9);
  EXPECT_NEAR(rotation(kNoise), 0.5, 1e-9);  // a flow has the noise of both views
  EXPECT_NEAR(epipolar(1.0), 2.0, 1e-9);
  EXPECT_NEAR(rotation(1.0), 4.0, 1e-9);
}

}  // namespace
}  // namespace rotslam
