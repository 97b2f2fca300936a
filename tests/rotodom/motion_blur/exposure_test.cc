#include "rotodom/motion_blur/exposure.h"

#include <string>

#include <gtest/gtest.h>

#include "tests/rotodom/tracking/turning_views.h"

namespace rotslam {
namespace {

const Eigen::Vector3d kAcceleration(2.0, 10.0, 1.0);

RotatingView RotatingAt(const FilmedStart& film, int frame) {
  return {{&film.views[frame], film.cam_from_world[frame]},
          film.views[frame].timestamp_s * kAcceleration};
}

void AddPairs(const FilmedStart& film, int num_threads, ExposureMeter& meter) {
  for (int j = 3; j < static_cast<int>(film.views.size()); ++j) {
    meter.Add(SmallCamera(), RotatingAt(film, j / 2), RotatingAt(film, j), num_threads);
  }
}

double SecondsOf(double exposure_s, int num_threads = 1) {
  ExposureMeter meter;
  AddPairs(FilmStart(Start(kAcceleration), 8, exposure_s), num_threads, meter);
  testing::Test::RecordProperty("of_" + std::to_string(exposure_s),
                                std::to_string(meter.Seconds()));
  return meter.Seconds();
}

TEST(ExposureMeter, TellsHowLongImagesWereExposed) {
  for (const double exposure_s : {0.008, 0.014, 0.02, 0.03}) {
    EXPECT_NEAR(SecondsOf(exposure_s), exposure_s, 0.05 * exposure_s) << exposure_s;
  }
}

TEST(ExposureMeter, KnowsSharpImages) {
  EXPECT_EQ(SecondsOf(0.0), 0.0);
  EXPECT_EQ(ExposureMeter().Seconds(), 0.0);
}

TEST(ExposureMeter, DoesNotDependOnThreads) { EXPECT_EQ(SecondsOf(0.02, 3), SecondsOf(0.02, 1)); }

TEST(ExposureMeter, FollowsACameraThatAdapts) {
  ExposureMeter meter;
  AddPairs(FilmStart(Start(kAcceleration), 8, 0.024), 1, meter);
  EXPECT_NEAR(meter.Seconds(), 0.024, 0.002);
  const FilmedStart brighter = FilmStart(Start(kAcceleration), 8, 0.012);
  for (int k = 0; k < 8; ++k) AddPairs(brighter, 1, meter);
  EXPECT_NEAR(meter.Seconds(), 0.012, 0.002);
}

TEST(ExposureMeter, AsksPairsThatTurnDifferently) {
  const Eigen::Vector3d slow(0.0, 0.2, 0.0);
  const Eigen::Vector3d fast(0.5, 1.0, 0.0);
  EXPECT_TRUE(ExposureMeter::IsInformative(slow, fast, 250.0));
  EXPECT_TRUE(ExposureMeter::IsInformative(fast, slow, 250.0));
  EXPECT_FALSE(ExposureMeter::IsInformative(fast, 0.7 * fast, 250.0));
  EXPECT_FALSE(ExposureMeter::IsInformative(0.1 * slow, slow, 250.0));  // 45 px/s are no blur
}

TEST(ExposureMeter, NeedsPoints) {
  const FilmedStart film = FilmStart(Start(kAcceleration), 5, 0.02);
  View bare = film.views[4];
  bare.is_lost.assign(bare.features.size(), true);
  ExposureMeter meter;
  meter.Add(SmallCamera(),
            RotatingAt(film, 1),
            {{&bare, film.cam_from_world[4]}, bare.timestamp_s * kAcceleration},
            1);
  EXPECT_EQ(meter.Seconds(), 0.0);
}

}  // namespace
}  // namespace rotslam
