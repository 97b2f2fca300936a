#include "rotodom/self_calibration/find_lens.h"

#include <gtest/gtest.h>

#include "tests/rotodom/self_calibration/filmed_room.h"

namespace rotslam {
namespace {

std::optional<FoundLens> Find(const Camera& truth,
                              std::optional<double> focal_px = std::nullopt,
                              double step_m = 0.06) {
  const FilmedRoom room = FilmRoom(truth, step_m, 0.2, 0.05);
  const auto pairs = ChooseLensPairs(room.features, room.cam_from_world);
  return FindLens(pairs, {truth.width, truth.height}, focal_px, {});
}

TEST(FindLens, FindsPinholeLensesOfAllFieldsOfView) {
  for (const double focal_px : {224.0, 320.0, 554.0, 1100.0}) {
    Camera truth = LensOfModel(CameraModel::kRadtan, focal_px);
    truth.distortion = {-0.1, 0.012};
    const auto found = Find(truth);
    ASSERT_TRUE(found.has_value()) << focal_px;
    EXPECT_EQ(found->fit.camera.model, CameraModel::kRadtan) << focal_px;
    EXPECT_NEAR(found->fit.camera.fx / focal_px, 1.0, 0.1) << focal_px;
  }
}

TEST(FindLens, TellsAFisheyeFromAPinhole) {
  Camera truth = LensOfModel(CameraModel::kEquidistant, 215.0);
  truth.distortion = {-0.01, 0.002};
  const auto found = Find(truth);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->fit.camera.model, CameraModel::kEquidistant);
  EXPECT_NEAR(found->fit.camera.fx / truth.fx, 1.0, 0.02);
  EXPECT_LT(1.5 * found->cost_of_fisheye, found->cost_of_pinhole);
}

TEST(FindLens, StartsFromAKnownFocalLength) {
  const Camera truth = LensOfModel(CameraModel::kPinhole, 600.0);
  const auto found = Find(truth, 560.0);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->fit.camera.model, CameraModel::kRadtan);
  EXPECT_NEAR(found->fit.camera.fx / truth.fx, 1.0, 0.03);
}

TEST(FindLens, NoticesATurnInPlace) {
  Camera truth = LensOfModel(CameraModel::kRadtan, 420.0);
  truth.distortion = {-0.1, 0.012};
  const auto found = Find(truth, std::nullopt, 0.0);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(found->fit.camera.fx / truth.fx, 1.0, 0.005);
  EXPECT_NEAR(found->fit.camera.cx, truth.cx, 2.0);
  EXPECT_NEAR(found->fit.camera.cy, truth.cy, 2.0);
}

TEST(FindLens, NeedsPairs) { EXPECT_FALSE(FindLens({}, {640, 480}, std::nullopt, {})); }

TEST(ChooseLensPairs, TakesFarFramesThatShareEnoughPoints) {
  const FilmedRoom room = FilmRoom(LensOfModel(CameraModel::kPinhole, 500.0), 0.06, 0.0, 0.0);
  const auto pairs = ChooseLensPairs(room.features, room.cam_from_world);
  ASSERT_GE(pairs.size(), 10U);
  for (const LensPair& pair : pairs) {
    EXPECT_LT(pair.i, pair.j);
    EXPECT_GE(pair.points.size(), 60U);
    const Rotation expected =
        room.cam_from_world.at(pair.j) * room.cam_from_world.at(pair.i).Inverse();
    EXPECT_LT((pair.j_from_i * expected.Inverse()).AngleDeg(), 1e-9);
  }
  EXPECT_GT(pairs.front().j.value - pairs.front().i.value, 4);
}

}  // namespace
}  // namespace rotslam
