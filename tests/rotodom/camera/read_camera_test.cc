#include "rotodom/camera/read_camera.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/rotodom/camera/calibration_text.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ReadCameraTest : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  Camera Read(const std::string& text) const { return ReadCamera(Write("some.txt", text)); }

  // What reading `text` complains about; one line that names the file.
  std::string Complaint(const std::string& text) const {
    try {
      const Camera camera = Read(text);
      return "read without complaint: " + Describe(camera);
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("some.txt:"), Not(HasSubstr("\n"))));
      return error.what();
    }
  }

  const fs::path folder_ =
      fs::path(testing::TempDir()) / ("rotslam_read_camera_" + std::to_string(getpid()));
};

TEST_F(ReadCameraTest, OursHasMaskedPolygons) {
  const std::string global =
      "model: pinhole\nwidth: 640\nheight: 480\nfx: 500\nfy: 500\ncx: 320\ncy: 240\n";
  const auto masked = [&](const std::string& value) {
    const CameraFile file = ReadCameraFile(Write("some.txt", global + "masked_px: " + value));
    return file.cameras.front().masked_px;
  };
  const auto two =
      masked("[[[0, 400], [640, 400.5], [640, 480]], [[1, 2], [3, 4], [5, 6], [7, 8]]]");
  ASSERT_EQ(two.size(), 2U);
  EXPECT_EQ(two[0].size(), 3U);
  EXPECT_EQ(two[0][1], Eigen::Vector2d(640.0, 400.5));
  EXPECT_EQ(two[1].size(), 4U);
  const auto one = masked("[[0, 400], [640, 400], [640, 480]]");
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0][2], Eigen::Vector2d(640.0, 480.0));
  for (const char* wrong :
       {"3", "[]", "[[1, 2], [3, 4]]", "[[[1, 2], [3, 4], [5]]]", "[1, 2, 3]"}) {
    EXPECT_THAT(Complaint(global + "masked_px: " + wrong + "\n"),
                HasSubstr("some.txt:8: masked_px must be polygons"))
        << wrong;
  }
}

TEST_F(ReadCameraTest, OursGivesBackWhatWasWritten) {
  const double third = 1.0 / 3.0;
  for (const Camera& camera :
       {CameraOfNumbers(CameraModel::kPinhole, {0, 0}, {500.0 + third, 501.0, 320.1, -2.5}),
        CameraOfNumbers(
            CameraModel::kRadtan, {640, 480}, {5e2, 1e-3, 0, 1}, {third, -0.1, 1e-17, 0, 2}),
        CameraOfNumbers(CameraModel::kRadtan, {640, 480}, {5e2, 5e2, 0, 1}),
        CameraOfNumbers(
            CameraModel::kEquidistant, {64, 48}, {190, 191, 32, 24}, {0.1, third, -1e-9, 4}),
        CameraOfNumbers(
            CameraModel::kRational, {64, 48}, {190, 191, 32, 24}, {3, 1, 0, third, 5, 6, 7, 8}),
        CameraOfNumbers(CameraModel::kFov, {64, 48}, {190, 191, 32, 24}, {0.9})}) {
    WriteCameraYaml(folder_ / "camera.yaml", camera);
    EXPECT_EQ(ReadCamera(folder_ / "camera.yaml"), camera) << CameraYaml(camera);
    EXPECT_EQ(ReadCamera(folder_), camera);  // the folder stands for it
    EXPECT_FALSE(fs::exists(folder_ / "camera.yaml.tmp"));
  }
}

TEST_F(ReadCameraTest, OursSaysHowWellTheLensIsKnown) {
  LensSigmas sigmas = {0.5, 1.0 / 3.0, 1e-7, {0.01, 0.0, 1e-5, 2e-5, 0.1}};
  const Camera radtan =
      CameraOfNumbers(CameraModel::kRadtan, {640, 480}, {5e2, 5e2, 0, 1}, {0.1, 0.2});
  const Camera pinhole = CameraOfNumbers(CameraModel::kPinhole, {640, 480}, {5e2, 5e2, 0, 1});
  const auto read = [&] { return ReadCameraFile(folder_ / "camera.yaml").cameras.at(0); };
  for (const Camera& camera : {radtan, pinhole}) {
    WriteCameraYaml(folder_ / "camera.yaml", camera, sigmas);
    EXPECT_EQ(read().camera, camera);
    EXPECT_EQ(read().sigmas, sigmas) << CameraYaml(camera, sigmas);
  }
  const Camera fisheye =
      CameraOfNumbers(CameraModel::kEquidistant, {64, 48}, {190, 191, 32, 24}, {0.1});
  WriteCameraYaml(folder_ / "camera.yaml", fisheye, sigmas);
  sigmas.distortion[4] = 0.0;
  EXPECT_EQ(read().sigmas, sigmas);
  WriteCameraYaml(folder_ / "camera.yaml", radtan);
  EXPECT_FALSE(read().sigmas);

  const std::string known =
      "model: fov\nfx: 5\nfy: 5\ncx: 3\ncy: 2\ndistortion: [0.9]\nsigma_focal_px: 1\n";
  EXPECT_THAT(Complaint(known), HasSubstr("sigma_cx_px is missing"));
  const std::string negative = known + "sigma_cx_px: 1\nsigma_cy_px: -1\nsigma_distortion: [0]\n";
  EXPECT_THAT(Complaint(negative), HasSubstr("sigma_cy_px is '-1', must not be negative"));
  const std::string two = known + "sigma_cx_px: 1\nsigma_cy_px: 1\nsigma_distortion: [0, 1]\n";
  EXPECT_THAT(Complaint(two), HasSubstr("sigma_distortion has 2 values, fov takes 1"));
}

TEST_F(ReadCameraTest, OursKnowsTheReadoutOfARollingShutter) {
  const std::string global =
      "model: pinhole\nwidth: 640\nheight: 480\nfx: 500\nfy: 500\ncx: 320\ncy: 240\n";
  EXPECT_EQ(Read(global).readout_s, 0.0);
  EXPECT_FALSE(Read(global).knows_readout);
  EXPECT_EQ(Read(global + "readout_s: 0\n").readout_s, 0.0);
  EXPECT_TRUE(Read(global + "readout_s: 0\n").knows_readout);
  EXPECT_EQ(Read(global + "readout_s: 0.0213\n").readout_s, 0.0213);
  EXPECT_THAT(Complaint(global + "readout_s: -0.01\n"),
              HasSubstr("some.txt:8: readout_s is '-0.01'"));
  EXPECT_THAT(Complaint(global + "readout_s: 1\n"), HasSubstr("readout_s is '1'"));
  EXPECT_THAT(Complaint(global + "readout_s: 21.3\n"), HasSubstr("readout_s is '21.3'"));
  EXPECT_THAT(Complaint(global + "readout_s: fast\n"), HasSubstr("readout_s"));
  EXPECT_THAT(Complaint(global + "readout_s: .nan\n"), HasSubstr("readout_s"));
  EXPECT_THAT(Complaint(global + "readout: 0.01\n"), HasSubstr("readout is no key"));
  EXPECT_EQ(Read(global + "readout_s: 0.02\n").readout_from, ReadoutStart::kTop);
  EXPECT_EQ(Read(global + "readout_from: right\n").readout_from, ReadoutStart::kRight);
  EXPECT_THAT(Complaint(global + "readout_from: up\n"),
              HasSubstr("readout_from is 'up', must be top, bottom, left or right"));

  Camera camera = Read(global);
  EXPECT_THAT(CameraYaml(camera), Not(HasSubstr("readout_s")));
  camera.knows_readout = true;
  for (const double readout_s : {0.0, 1.0 / 30.0, 1e-9, 0.999}) {
    camera.readout_s = readout_s;
    camera.readout_from = readout_s > 0.0 ? ReadoutStart::kLeft : ReadoutStart::kTop;
    WriteCameraYaml(folder_ / "camera.yaml", camera);
    EXPECT_EQ(ReadCamera(folder_ / "camera.yaml"), camera) << CameraYaml(camera);
  }
  camera.readout_s = 1.5;
  EXPECT_THROW(WriteCameraYaml(folder_ / "camera.yaml", camera), std::invalid_argument);
}

// The other kinds of file have no word for it, and one that is there by chance is not ours.
TEST_F(ReadCameraTest, OthersSayNothingAboutTheShutter) {
  for (const std::string text :
       {"cam0: {camera_model: pinhole, distortion_model: none, distortion_coeffs: [],\n"
        "  intrinsics: [458.6, 457.2, 367.2, 248.3], resolution: [752, 480], readout_s: 0.02}\n",
        "%YAML:1.0\nCamera.fx: 700\nCamera.fy: 700\nCamera.cx: 600\nCamera.cy: 180\n"
        "readout_s: 0.02\n",
        "P0: 718 0 607 0 0 718 185 0 0 0 1 0\n"}) {
    EXPECT_EQ(Read(text).readout_s, 0.0) << text;
  }
}

TEST_F(ReadCameraTest, OrbSlam) {
  EXPECT_EQ(Read("%YAML:1.0\n\n# comment\nCamera.fx: 517.306408\nCamera.fy: 516.469215\n"
                 "Camera.cx: 318.643040\nCamera.cy: 255.313989\n\nCamera.k1: 0.262383\n"
                 "Camera.k2: -0.953104\nCamera.p1: -0.005358\nCamera.p2: 0.002628\n"
                 "Camera.k3: 1.163314\n\nCamera.fps: 30.0\nCamera.RGB: 1\n"
                 "LEFT.D: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: d\n"
                 "   data: [-0.28, 0.07]\n"),
            CameraOfNumbers(CameraModel::kRadtan,
                            {0, 0},
                            {517.306408, 516.469215, 318.64304, 255.313989},
                            {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}));
  EXPECT_EQ(
      Read("%YAML:1.0\n---\nCamera.fx: 718.856\nCamera.fy: 718.856\nCamera.cx: 607.1928\n"
           "Camera.cy: 185.2157\nCamera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\n"
           "Camera.p2: 0.0\nCamera.width: 1241\nCamera.height: 376\n"),
      CameraOfNumbers(CameraModel::kPinhole, {1241, 376}, {718.856, 718.856, 607.1928, 185.2157}));
  EXPECT_EQ(Read("%YAML:1.0\nFile.version: \"1.0\"\nCamera.type: \"KannalaBrandt8\"\n"
                 "Camera1.fx: 190.97\nCamera1.fy: 190.98\nCamera1.cx: 254.93\n"
                 "Camera1.cy: 256.89\nCamera1.k1: 0.0034\nCamera1.k2: 0.0007\n"
                 "Camera1.k3: -0.002\nCamera1.k4: 0.0002\nCamera.width: 512\n"
                 "Camera.height: 512\n"),
            CameraOfNumbers(CameraModel::kEquidistant,
                            {512, 512},
                            {190.97, 190.98, 254.93, 256.89},
                            {0.0034, 0.0007, -0.002, 0.0002}));
  EXPECT_THAT(Complaint("%YAML:1.0\nCamera.fy: 500\nCamera.cx: 3\nCamera.cy: 2\n"),
              HasSubstr("Camera.fx is missing"));
  EXPECT_THAT(Complaint("Camera.type: \"MLPnP\"\nCamera.fx: 500\n"), HasSubstr("Camera.type"));
  EXPECT_THAT(Complaint("Camera.type: KannalaBrandt8\nCamera.fx: 500\nCamera.fy: 500\n"
                        "Camera.cx: 500\nCamera.cy: 500\nCamera.k1: 0.1\n"),
              HasSubstr("Camera.k2 is missing"));
}

TEST_F(ReadCameraTest, Kalibr) {
  EXPECT_EQ(Read("cam0:\n  cam_overlaps: [1]\n  camera_model: pinhole\n"
                 "  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]\n"
                 "  distortion_model: radtan\n  intrinsics: [458.6, 457.2, 367.2, 248.3]\n"
                 "  resolution: [752, 480]\n  rostopic: /cam0/image_raw\n"),
            CameraOfNumbers(CameraModel::kRadtan,
                            {752, 480},
                            {458.6, 457.2, 367.2, 248.3},
                            {-0.28, 0.07, 0.0002, 1.7e-05}));
  EXPECT_EQ(Read("cam0: {camera_model: pinhole, distortion_model: equidistant,\n"
                 "  distortion_coeffs: [0.1, 0.2, 0.3, 0.4], intrinsics: [190, 191, 254, 256],\n"
                 "  resolution: [512, 512]}\n"),
            CameraOfNumbers(
                CameraModel::kEquidistant, {512, 512}, {190, 191, 254, 256}, {0.1, 0.2, 0.3, 0.4}));
  EXPECT_EQ(Read("cam0: {camera_model: pinhole, distortion_model: none, distortion_coeffs: [],\n"
                 "  intrinsics: [190, 191, 254, 256], resolution: [512, 512]}\n"),
            CameraOfNumbers(CameraModel::kPinhole, {512, 512}, {190, 191, 254, 256}));
  EXPECT_THAT(Complaint("cam0: {camera_model: omni, intrinsics: [1, 190, 191, 254, 256]}\n"),
              HasSubstr("cam0.camera_model is 'omni'"));
  EXPECT_THAT(Complaint("cam0: {camera_model: pinhole, distortion_model: radtan}\n"),
              HasSubstr("some.txt:1: cam0.intrinsics is missing"));
  EXPECT_THAT(Complaint("cam0: {camera_model: pinhole, distortion_model: fov,\n"
                        "  intrinsics: [190, 191, 254, 256]}\n"),
              HasSubstr("some.txt:1: cam0.distortion_coeffs has 0 values, must have 1: w"));
  EXPECT_THAT(Complaint("cam0: {camera_model: pinhole, distortion_model: radtan,\n"
                        "  distortion_coeffs: [0.1, 0.2], intrinsics: [190, 191, 254, 256]}\n"),
              HasSubstr("cam0.distortion_coeffs has 2 values"));
}

TEST_F(ReadCameraTest, Kitti) {
  const std::string p0 =
      "P0: 7.18856e+02 0.0e+00 6.071928e+02 0.0 0.0 7.18857e+02 1.852157e+02 0.0 0.0 0.0 1.0 0.0\n";
  EXPECT_EQ(Read(p0 + "Tr: 1 2\n"),
            CameraOfNumbers(CameraModel::kPinhole, {0, 0}, {718.856, 718.857, 607.1928, 185.2157}));
  EXPECT_THAT(Complaint("P0: 718.856 0 607 0 0 718\n"), HasSubstr("P0 has 6 values"));
  EXPECT_THAT(Complaint("P0: 0 0 607 0 0 718 185 0 0 0 1 0\n"), HasSubstr("focal length"));
  EXPECT_THAT(Complaint("P0: 718 1 607 0 0 718 185 0 0 0 1 0\n"),
              HasSubstr("some.txt:1: P0 has a skew of 1"));
  EXPECT_THAT(Complaint("P0: nan 0 607 0 0 718 185 0 0 0 1 0\n"), HasSubstr("P0[0] is 'nan'"));
}

TEST_F(ReadCameraTest, Euroc) {
  const std::string sensor =
      "sensor_type: camera\ncomment: VI-Sensor cam0 (MT9M034)\n"
      "T_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0]\nrate_hz: 20\n"
      "resolution: [752, 480]\ncamera_model: pinhole\n"
      "intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv\n";
  const std::array<double, 4> intrinsics = {458.654, 457.296, 367.215, 248.375};
  EXPECT_EQ(Read(sensor + "distortion_model: radial-tangential\n"
                          "distortion_coefficients: [-0.283, 0.074, 0.000194, 1.76e-05]\n"),
            CameraOfNumbers(
                CameraModel::kRadtan, {752, 480}, intrinsics, {-0.283, 0.074, 0.000194, 1.76e-05}));
  EXPECT_EQ(
      Read(sensor + "distortion_model: equidistant\n"
                    "distortion_coefficients: [0.1, 0.2, 0.3, 0.4]\n"),
      CameraOfNumbers(CameraModel::kEquidistant, {752, 480}, intrinsics, {0.1, 0.2, 0.3, 0.4}));
}

TEST_F(ReadCameraTest, Colmap) {
  const std::string header = "# Camera list with one line of data per camera:\n\n";
  EXPECT_EQ(Read(header + "1 SIMPLE_PINHOLE 640 480 500 320 240\n"),
            CameraOfNumbers(CameraModel::kPinhole, {640, 480}, {500, 500, 319.5, 239.5}));
  EXPECT_EQ(Read(header + "7 PINHOLE 640 480 500 501 320 240\n"),
            CameraOfNumbers(CameraModel::kPinhole, {640, 480}, {500, 501, 319.5, 239.5}));
  EXPECT_EQ(Read(header + "1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n"),
            CameraOfNumbers(CameraModel::kRadtan, {640, 480}, {500, 500, 319.5, 239.5}, {0.1}));
  EXPECT_EQ(
      Read(header + "1 RADIAL 640 480 500 320 240 0.1 -0.2\n"),
      CameraOfNumbers(CameraModel::kRadtan, {640, 480}, {500, 500, 319.5, 239.5}, {0.1, -0.2}));
  EXPECT_EQ(Read(header + "1 OPENCV 640 480 500 501 320 240 0.1 0.2 0.3 0.4\n"),
            CameraOfNumbers(
                CameraModel::kRadtan, {640, 480}, {500, 501, 319.5, 239.5}, {0.1, 0.2, 0.3, 0.4}));
  EXPECT_EQ(
      Read(header + "1 OPENCV_FISHEYE 640 480 500 501 320 240 0.1 0.2 0.3 0.4\n"),
      CameraOfNumbers(
          CameraModel::kEquidistant, {640, 480}, {500, 501, 319.5, 239.5}, {0.1, 0.2, 0.3, 0.4}));
  EXPECT_EQ(
      Read(header + "1 FULL_OPENCV 640 480 500 501 320 240 0.1 0.2 0.3 0.4 0.5 0 0 0\n"),
      CameraOfNumbers(
          CameraModel::kRadtan, {640, 480}, {500, 501, 319.5, 239.5}, {0.1, 0.2, 0.3, 0.4, 0.5}));
  EXPECT_EQ(Read(header + "1 FULL_OPENCV 640 480 500 501 320 240 0.1 0.2 0.3 0.4 0.5 0 0.6 0\n"),
            CameraOfNumbers(CameraModel::kRational,
                            {640, 480},
                            {500, 501, 319.5, 239.5},
                            {0.1, 0.2, 0.3, 0.4, 0.5, 0, 0.6, 0}));
  EXPECT_EQ(Read("1 FOV 640 480 500 501 320 240 0.9\n"),
            CameraOfNumbers(CameraModel::kFov, {640, 480}, {500, 501, 319.5, 239.5}, {0.9}));
  EXPECT_THAT(Complaint("1 PINHOLE 640 480 500 320 240\n"), HasSubstr("3 parameters"));
  EXPECT_THAT(Complaint("1 PINHOLE 640 480 500 0 320 240\n"), HasSubstr("camera 1: fy is '0'"));
  EXPECT_EQ(Read("1 SIMPLE_PINHOLE 640 480 500 320 240\n2 PINHOLE 640 480 500 500 320 240\n").fx,
            500.0);
  EXPECT_THAT(
      Complaint("1 SIMPLE_PINHOLE 640 480 500 320 240\n2 SIMPLE_PINHOLE 640 480 9 320 240\n"),
      HasSubstr("cameras that differ: 1, 2; say which with --camera some.txt:1"));
}

TEST_F(ReadCameraTest, ComplaintsNameFileAndKey) {
  const std::string end = "fy: 500\ncx: 320\ncy: 240\n";
  EXPECT_THAT(Complaint("model: pinhole\n" + end), HasSubstr("fx is missing"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: 0\n" + end), HasSubstr("some.txt:2: fx is '0'"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: -5\n" + end), HasSubstr("fx is '-5'"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: .nan\n" + end), HasSubstr("fx is '.nan'"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: [5]\n" + end), HasSubstr("fx must be a single"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: 5 px\n" + end), HasSubstr("fx is '5 px'"));
  EXPECT_THAT(Complaint("fx: 5\n" + end), HasSubstr("model is missing"));
  EXPECT_THAT(Complaint("model: mei\nfx: 5\n" + end), HasSubstr("some.txt:1: model is 'mei'"));
  EXPECT_THAT(Complaint("model: radtan\nfx: 5\n" + end), HasSubstr("distortion is missing"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: 5\ndistortion: [1, 2, 3, 4]\n" + end),
              HasSubstr("distortion has 4 values, pinhole takes none"));
  EXPECT_THAT(Complaint("model: equidistant\nfx: 5\ndistortion: [1, x, 3, 4]\n" + end),
              HasSubstr("distortion[1] is 'x'"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: 5\nfocal: 5\n" + end),
              HasSubstr("some.txt:3: focal is no key"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: 5\nwidth: 640\n" + end),
              HasSubstr("some.txt:3: height is missing or 0"));
  EXPECT_THAT(Complaint("model: pinhole\nfx: 5\nwidth: 640.5\n" + end),
              HasSubstr("some.txt:3: width is '640.5'"));
  EXPECT_THAT(Complaint("model: pinhole\n  fx: : 5\n"), HasSubstr("some.txt:2: is not YAML"));
  EXPECT_THAT(Complaint(""), HasSubstr("is empty"));
  EXPECT_THAT(Complaint("# nothing\n"), HasSubstr("is empty"));
  EXPECT_THAT(Complaint("hello world\n"), HasSubstr("no camera found"));
  EXPECT_THAT(Complaint("hello world\n"), HasSubstr("ORB-SLAM YAML, "));
  EXPECT_THAT(Complaint("P2: 1 2 3\n"), HasSubstr("some.txt:1: P2 has 3 values, must have 12"));
  EXPECT_THAT(Complaint(std::string("\x89PNG\r\n\0\0", 8)), HasSubstr("not a text file"));
  EXPECT_THROW(ReadCamera(folder_ / "missing.yaml"), std::runtime_error);
  fs::remove(folder_ / "some.txt");
  EXPECT_THROW(ReadCamera(folder_), std::runtime_error);
}

TEST_F(ReadCameraTest, TakesNumbersAsOpenCvAndWindowsWriteThem) {
  EXPECT_EQ(Read("%YAML:1.0\r\nCamera.fx: 525.\r\nCamera.fy: +5.25e+02\r\nCamera.cx: 320.\r\n"
                 "Camera.cy: 240.\r\n"),
            CameraOfNumbers(CameraModel::kPinhole, {0, 0}, {525, 525, 320, 240}));
}

TEST_F(ReadCameraTest, WritingComplainsToo) {
  const Camera camera = CameraOfNumbers(CameraModel::kPinhole, {0, 0}, {500, 500, 320, 240});
  EXPECT_THROW(WriteCameraYaml(folder_ / "no" / "camera.yaml", camera), std::runtime_error);
  EXPECT_THROW(WriteCameraYaml(folder_ / "camera.yaml", Camera()), std::invalid_argument);
}

TEST(CameraFiles, InConfigCanBeRead) {
  const fs::path folder = fs::path(ROTSLAM_SOURCE_DIR) / "config" / "cameras";
  int count = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    EXPECT_NO_THROW(ReadCamera(entry.path()));
    ++count;
  }
  EXPECT_GE(count, 3);
}

}  // namespace
}  // namespace rotslam
