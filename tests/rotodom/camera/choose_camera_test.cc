#include <filesystem>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/camera/read_camera.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Cameras whose focal length is 100, 101, 102 ...
CameraFile FileWith(const std::vector<std::string>& names) {
  CameraFile file;
  for (const std::string& name : names) {
    NamedCamera named;
    named.name = name;
    named.camera.fx = named.camera.fy = 100.0 + static_cast<double>(file.cameras.size());
    file.cameras.push_back(named);
  }
  return file;
}

std::string Chosen(const CameraFile& file, const std::string& name, const fs::path& images) {
  return ChooseCamera(file, {"calib.yaml", name}, images).name;
}

TEST(ChooseCamera, ByNameThenByTheImages) {
  const CameraFile chain = FileWith({"cam0", "cam1"});
  EXPECT_EQ(Chosen(chain, "cam1", "/x/cam0/data"), "cam1");
  EXPECT_EQ(Chosen(chain, "CAM1", ""), "cam1");
  EXPECT_EQ(Chosen(chain, "right", ""), "cam1");
  EXPECT_EQ(Chosen(chain, "", "/x/mav0/cam1/data"), "cam1");
  EXPECT_EQ(Chosen(chain, "", "/x/cam1"), "cam1");
  EXPECT_EQ(Chosen(chain, "", "/x/right/"), "cam1");
  EXPECT_EQ(Chosen(chain, "", "/cam1/of/some/other/thing/cam0"), "cam0");
  EXPECT_EQ(Chosen(FileWith({"Camera1", "Camera2"}), "", "/x/cam1/data"), "Camera2");
  EXPECT_EQ(Chosen(FileWith({"P0", "P1", "P2", "P3"}), "", "/00/image_2"), "P2");
  EXPECT_EQ(Chosen(FileWith({"P0", "P1", "P2", "P3"}), "", "/00/image_03/data"), "P3");
  EXPECT_EQ(Chosen(FileWith({"raw", "rectified"}), "", "/bag/image_rect_color"), "rectified");
}

TEST(ChooseCamera, TheOnlyOneIsMeantWhateverTheFolder) {
  EXPECT_EQ(Chosen(FileWith({"cam0"}), "", "/x/mav0/cam1/data"), "cam0");
  EXPECT_EQ(Chosen(FileWith({""}), "", "/x/right"), "");
}

TEST(ChooseCamera, AsksWhereSeveralDiffer) {
  CameraFile chain = FileWith({"cam0", "cam1"});
  const auto complaint = [&](const std::string& name) {
    return RuntimeErrorOf([&] { Chosen(chain, name, "/x/images"); });
  };
  EXPECT_EQ(complaint(""),
            "calib.yaml: has cameras that differ: cam0, cam1; say which with --camera "
            "calib.yaml:cam0");
  EXPECT_EQ(complaint("cam7"), "calib.yaml: has no camera 'cam7'; it has cam0, cam1");
  chain.first_is_default = true;
  EXPECT_EQ(Chosen(chain, "", ""), "cam0");
  chain.first_is_default = false;
  chain.cameras[1].camera = chain.cameras[0].camera;
  EXPECT_EQ(Chosen(chain, "", ""), "cam0");
}

TEST(ChooseCamera, TellsTheProblemOfTheChosenOne) {
  CameraFile chain = FileWith({"cam0", "cam1"});
  chain.cameras[1].problem = "calib.yaml:7: cam1.intrinsics is missing";
  EXPECT_EQ(Chosen(chain, "cam0", ""), "cam0");
  EXPECT_EQ(RuntimeErrorOf([&] { Chosen(chain, "cam1", ""); }), chain.cameras[1].problem);
}

TEST(ParseCameraReference, CutsAtTheLastColon) {
  const TemporaryFolder folder;
  const std::string file = folder.Write("calib.yaml", "").string();
  const std::string odd = folder.Write("a:b.yaml", "").string();
  EXPECT_EQ(ParseCameraReference(file).file, file);
  EXPECT_EQ(ParseCameraReference(file).name, "");
  EXPECT_EQ(ParseCameraReference(file + ":cam1").file, file);
  EXPECT_EQ(ParseCameraReference(file + ":cam1").name, "cam1");
  EXPECT_EQ(ParseCameraReference(file + ":images/a.png").name, "images/a.png");
  EXPECT_EQ(ParseCameraReference(odd).name, "");
  EXPECT_EQ(ParseCameraReference(odd + ":P2").name, "P2");
  EXPECT_EQ(ParseCameraReference("missing.yaml:cam1").name, "cam1");
  EXPECT_EQ(ParseCameraReference("C:\\data\\calib.yaml").name, "");
  EXPECT_EQ(ParseCameraReference("/a:b/missing.yaml").name, "");
}

TEST(ReadCameraFile, FindsTheFileOfAFolder) {
  const TemporaryFolder folder;
  const std::string kitti = "P0: 700 0 600 0 0 700 180 0 0 0 1 0\n";
  EXPECT_THAT(RuntimeErrorOf([&] { ReadCameraFile(folder.path()); }),
              HasSubstr("is a folder without a camera file"));
  folder.Write("calib.txt", kitti);
  EXPECT_EQ(ReadCameraFile(folder.path()).form, "KITTI calib.txt");
  folder.Write("transforms.json", "{\"fl_x\": 5, \"cx\": 1, \"cy\": 1, \"frames\": []}");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadCameraFile(folder.path()); }),
              HasSubstr("has the camera files calib.txt and transforms.json; give one of them"));
  folder.Write("camera.yaml", "model: pinhole\nfx: 5\nfy: 5\ncx: 1\ncy: 1\n");
  EXPECT_EQ(ReadCameraFile(folder.path()).form, "rotslam YAML");
}

TEST(ReadCamera, AnAngleOfViewTakesTheSizeOfTheImages) {
  const TemporaryFolder folder;
  const fs::path file = folder.Write("t.json", "{\"camera_angle_x\": 1.08, \"frames\": []}");
  const Camera camera = ReadCamera(CameraReference{file, ""}, "", {480, 360});
  EXPECT_NEAR(camera.fx, 240.0 / std::tan(0.54), 1e-9);
  EXPECT_EQ(camera.cx, 239.5);
  EXPECT_EQ(camera.cy, 179.5);
  EXPECT_THAT(RuntimeErrorOf([&] { ReadCamera(file); }), HasSubstr("gives an angle of view"));
}

}  // namespace
}  // namespace rotslam
