#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/read_camera.h"
#include "tests/rotodom/camera/calibration_text.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using enum CameraModel;

// What one file of ../shared/cases/inputs/calib must give.
struct CalibrationCase {
  std::optional<Camera> camera;
  std::string complaint = {};     // part of the one line where there is no camera
  std::string image_folder = {};  // of images that the camera is for
  std::string note = {};          // part of a note
};

Camera Fisheye(std::array<int, 2> size = {480, 360}) {
  return CameraOfNumbers(kEquidistant, size, {200, 201, 236, 182}, {-0.02, 0.012, -0.006, 0.001});
}

Camera Radtan(double k3 = -0.01, std::array<int, 2> size = {480, 360}) {
  return CameraOfNumbers(kRadtan, size, {380, 382, 250, 172}, {-0.28, 0.09, 0.001, -0.0008, k3});
}

Camera Rational() {
  return CameraOfNumbers(kRational,
                         {480, 360},
                         {380, 382, 250, 172},
                         {3.1, 1.4, 0.0005, -0.0007, 0.06, 3.4, 2.2, 0.32});
}

Camera FisheyeWithReadout() {
  Camera camera = Fisheye();
  camera.readout_s = 5.5555e-05 * 359;
  camera.knows_readout = true;
  return camera;
}

const std::map<std::string, CalibrationCase>& Cases() {
  static const std::map<std::string, CalibrationCase> kCases = {
      {"basalt.json", {Fisheye()}},
      {"cameras.bin", {Radtan(0)}},
      {"colmap_equi.txt", {{}, ":1: camera 1: model is 'EQUIRECTANGULAR', which is not supported"}},
      {"colmap_fov.txt", {CameraOfNumbers(kFov, {480, 360}, {230, 231, 236, 182}, {0.9})}},
      {"colmap_full0.txt", {Radtan()}},
      {"colmap_full8.txt", {Rational()}},
      {"colmap_kb.txt", {Fisheye()}},
      {"colmap_rttpf.txt", {Fisheye()}},
      {"colmap_simple_radial.txt",
       {CameraOfNumbers(kRadtan, {480, 360}, {390, 390, 239.5, 179.5}, {-0.15})}},
      {"colmap_tpf.txt", {Fisheye()}},
      {"colmap_two.txt", {{}, ": has cameras that differ: 1, 2; say which with --camera"}},
      {"droid.txt", {Radtan(0, {0, 0}), "", "", "taken as k1 k2 p1 p2"}},
      {"droid4.txt", {CameraOfNumbers(kPinhole, {0, 0}, {380, 382, 250, 172})}},
      {"droid_int.txt", {CameraOfNumbers(kPinhole, {0, 0}, {525, 525, 320, 240})}},
      {"dso_kb.txt", {Fisheye(), "", "", "lines 3 and 4"}},
      {"dso_pinhole.txt",
       {CameraOfNumbers(kPinhole,
                        {480, 360},
                        {0.7916 * 480, 1.0611 * 360, 0.5218 * 480 - 0.5, 0.4791 * 360 - 0.5})}},
      {"dso_radtan.txt", {Radtan(0)}},
      {"kalibr_ds_none.yaml", {{}, ":2: cam0.camera_model is 'ds', which is not supported"}},
      {"kalibr_eucm_none.yaml", {{}, ":2: cam0.camera_model is 'eucm', which is not supported"}},
      {"kalibr_linedelay.yaml", {FisheyeWithReadout()}},
      {"kalibr_omni_radtan.yaml", {{}, ":2: cam0.camera_model is 'omni', which is not supported"}},
      {"kalibr_pinhole_fov.yaml", {CameraOfNumbers(kFov, {480, 360}, {200, 201, 236, 182}, {0.9})}},
      {"kalibr_two.yaml", {Fisheye(), "", "/data/mav0/cam1/data"}},
      {"kitti_diffP2.txt",
       {CameraOfNumbers(kPinhole, {0, 0}, {400, 400, 239.5, 179.5}), "", "/kitti/00/image_2"}},
      {"kitti_multiline.txt", {CameraOfNumbers(kPinhole, {0, 0}, {707, 707, 601, 183})}},
      {"kitti_nocolon.txt", {CameraOfNumbers(kPinhole, {0, 0}, {400, 400, 239.5, 179.5})}},
      {"kitti_p2only.txt", {CameraOfNumbers(kPinhole, {0, 0}, {400, 400, 239.5, 179.5})}},
      {"ocv.xml", {Radtan()}},
      {"ocv.yaml", {Radtan()}},
      {"orb2_k456.yaml", {Rational()}},
      {"orb3_kb8_old.yaml", {Fisheye()}},
      {"orb3_kb8_v1.yaml", {Fisheye()}},
      {"orb3_pinhole_newsize.yaml", {Radtan(), "", "", "Camera.newWidth"}},
      {"ros_msg.yaml", {Radtan(), "", "", "rectified"}},
      {"ros_ost.yaml", {Radtan(), "", "", "rectified"}},
      {"sfm_data.json",
       {CameraOfNumbers(kRadtan, {480, 360}, {381, 381, 250, 172}, {-0.28, 0.09, 0, 0, -0.01})}},
      {"stella_flat_equirect.yaml", {{}, ":3: Camera.model is 'equirectangular', which is not"}},
      {"stella_flat_fisheye.yaml", {Fisheye()}},
      {"stella_flat_radialdivision.yaml", {{}, ":3: Camera.model is 'radial_division', which is"}},
      {"stella_nested_equirect.yaml", {{}, ":4: Camera.model is 'equirectangular', which is not"}},
      {"stella_nested_fisheye.yaml", {Fisheye()}},
      {"stella_nested_perspective.yaml", {Radtan()}},
      {"transforms_.json", {Radtan(0)}},
      {"transforms_OPENCV.json", {Radtan(0)}},
      {"transforms_OPENCV_FISHEYE.json", {{}, ":4: p1 is '0.001', but a fisheye lens has"}},
      {"transforms_PINHOLE.json", {{}, ":4: k1 is '-0.28', but camera_model says PINHOLE"}},
      {"transforms_blender.json",
       {CameraOfNumbers(
            kPinhole, {480, 360}, {240 / std::tan(0.54), 240 / std::tan(0.54), 239.5, 179.5}),
        "",
        "",
        "camera_angle_x"}},
      {"vins_kb.yaml", {Fisheye()}},
      {"vins_mei.yaml", {{}, ":3: model_type is 'MEI', which is not supported"}},
      {"vins_pinhole.yaml", {Radtan(0)}},
  };
  return kCases;
}

fs::path CaseFolder() { return fs::path(ROTSLAM_SHARED_DIR) / "cases" / "inputs" / "calib"; }

TEST(CameraCases, EveryFileGivesItsNumbersOrOneRightLine) {
  if (!fs::exists(CaseFolder())) GTEST_SKIP() << CaseFolder() << " is absent";
  for (const auto& entry : fs::directory_iterator(CaseFolder())) {
    const std::string name = entry.path().filename().string();
    SCOPED_TRACE(name);
    const auto found = Cases().find(name);
    if (found == Cases().end()) {
      ADD_FAILURE() << "nothing is said here of what it must give";
      continue;
    }
    const CalibrationCase& expected = found->second;
    try {
      const CameraReference reference{entry.path(), ""};
      const CameraFile file = ReadCameraFile(entry.path());
      const NamedCamera chosen = ChooseCamera(file, reference, expected.image_folder);
      const Camera camera = AtSize(chosen, 480, 360);
      ASSERT_TRUE(expected.camera) << Describe(camera);
      ExpectNear(camera, *expected.camera, 1e-9);
      std::string notes;
      for (const std::string& note : file.notes) notes += note + "\n";
      EXPECT_THAT(notes, testing::HasSubstr(expected.note));
    } catch (const std::runtime_error& error) {
      const std::string text = error.what();
      ASSERT_FALSE(expected.camera) << text;
      EXPECT_THAT(text, testing::HasSubstr(name + expected.complaint));
      EXPECT_THAT(text, testing::Not(testing::HasSubstr("\n")));
    }
  }
}

// The second camera, asked for by its name; and no camera where nothing says which.
TEST(CameraCases, SeveralCamerasAreAskedFor) {
  if (!fs::exists(CaseFolder())) GTEST_SKIP() << CaseFolder() << " is absent";
  const auto read = [](const std::string& file, const std::string& images = "") {
    return ReadCamera(ParseCameraReference((CaseFolder() / file).string()), images);
  };
  ExpectNear(read("kalibr_two.yaml:cam1"), Fisheye(), 1e-9);
  EXPECT_EQ(read("kalibr_two.yaml:cam0").fx, 458.0);
  EXPECT_EQ(read("kalibr_two.yaml", "/x/mav0/cam0/data").fx, 458.0);
  EXPECT_THROW(read("kalibr_two.yaml"), std::runtime_error);
  EXPECT_EQ(read("kitti_diffP2.txt:P2").fx, 400.0);
  EXPECT_EQ(read("kitti_diffP2.txt", "/kitti/00/image_0").fx, 300.0);
  EXPECT_THROW(read("kitti_diffP2.txt"), std::runtime_error);
  EXPECT_EQ(read("orb3_kb8_v1.yaml:Camera2").fx, 210.0);
  EXPECT_EQ(read("orb3_kb8_v1.yaml", "/tumvi/mav0/cam1/data").fx, 210.0);
  EXPECT_EQ(read("ros_ost.yaml:rectified").fx, 340.0);
  EXPECT_EQ(read("ros_ost.yaml", "/bag/image_rect").fx, 340.0);
  EXPECT_EQ(read("colmap_two.txt:2").fx, 381.0);
}

}  // namespace
}  // namespace rotslam
