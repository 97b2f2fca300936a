#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

struct RealSequence {
  std::string folder;
  std::string form;
  int num_frames;
  cv::Size size;
  double first_s;
  double second_s;
  double last_s;
  bool brings_camera;
  bool brings_ground_truth;
};

class SharedData : public testing::TestWithParam<RealSequence> {};

TEST_P(SharedData, IsRecognised) {
  const RealSequence& expected = GetParam();
  const std::filesystem::path path =
      std::filesystem::path(ROTSLAM_SHARED_DIR) / "data" / expected.folder;
  if (!std::filesystem::exists(path)) {
    GTEST_SKIP() << path << " is absent; set the CMake cache variable ROTSLAM_SHARED_DIR";
  }
  SequenceOptions options;
  const auto sequence = OpenSequence(path, options);
  EXPECT_EQ(sequence->form(), expected.form);
  EXPECT_EQ(sequence->NumFrames(), expected.num_frames);
  EXPECT_EQ(sequence->image_size(), expected.size);
  EXPECT_NEAR(sequence->timestamps_s()[0], expected.first_s, 1e-6);
  EXPECT_NEAR(sequence->timestamps_s()[1], expected.second_s, 1e-6);
  EXPECT_NEAR(sequence->timestamps_s().back(), expected.last_s, 1e-6);
  EXPECT_EQ(sequence->GroundTruthFile().has_value(), expected.brings_ground_truth);
  ASSERT_EQ(sequence->camera_reference().has_value(), expected.brings_camera);
  if (expected.brings_camera) {
    const Camera camera = ReadCamera(*sequence->camera_reference());
    EXPECT_EQ(MatchToImages(camera, sequence->image_size()).width, expected.size.width);
  }
  const auto frame = sequence->Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->problem, "");
}

INSTANTIATE_TEST_SUITE_P(
    Sequence,
    SharedData,
    testing::Values(
        RealSequence{
            "kitti00", "KITTI odometry", 200, {1241, 376}, 0.0, 0.1037359, 20.63096, true, true},
        RealSequence{"tum_fr1_rpy",
                     "TUM RGB-D",
                     480,
                     {640, 480},
                     1305031229.528748,
                     1305031229.564425,
                     1305031245.497697,
                     false,
                     true},
        RealSequence{"euroc_v101_keyframes",
                     "EuRoC ASL",
                     100,
                     {752, 480},
                     1403715273.262142976,
                     1403715280.562142976,
                     1403715408.762142976,
                     true,
                     true},
        RealSequence{"7scenes_kitchen",
                     "image folder",
                     400,
                     {640, 480},
                     0.0,
                     1.0 / 30.0,
                     399 / 30.0,
                     false,
                     true},
        RealSequence{
            "pan720", "image folder", 361, {640, 480}, 1000.0, 1000.033333, 1012.0, false, true},
        RealSequence{
            "cmu0", "image folder", 38, {1300, 867}, 0.0, 1.0 / 30.0, 37 / 30.0, false, false}),
    [](const auto& test) { return "Of_" + test.param.folder; });

}  // namespace
}  // namespace rotslam
