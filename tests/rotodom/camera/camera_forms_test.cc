#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/camera/camera_form.h"
#include "tests/rotodom/camera/calibration_text.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using enum CameraModel;

// Good files of all forms: the seeds of the fuzz target, and the shared cases where they are.
std::vector<fs::path> Samples() {
  std::vector<fs::path> samples;
  const fs::path seeds = fs::path(ROTSLAM_SOURCE_DIR) / "tests" / "fuzz" / "corpus" / "camera";
  for (const auto& entry : fs::directory_iterator(seeds)) {
    if (entry.path().filename().string().starts_with("good")) samples.push_back(entry.path());
  }
  const fs::path cases = fs::path(ROTSLAM_SHARED_DIR) / "cases" / "inputs" / "calib";
  if (!fs::exists(cases)) return samples;
  for (const auto& entry : fs::directory_iterator(cases)) samples.push_back(entry.path());
  return samples;
}

TEST(CameraForms, ExactlyOneRecognisesEachFile) {
  std::set<std::string> seen;
  for (const fs::path& sample : Samples()) {
    const CameraDocument document(sample);
    std::vector<std::string> names;
    for (const CameraForm& form : CameraForms()) {
      if (form.recognises(document)) names.push_back(form.name);
    }
    EXPECT_EQ(names.size(), 1U) << sample << ": " << testing::PrintToString(names);
    seen.insert(names.begin(), names.end());
  }
  EXPECT_EQ(seen.size(), CameraForms().size()) << "a form has no sample";
}

TEST(CameraForms, HaveNamesAndDescriptionsOfOneLine) {
  std::set<std::string> names;
  for (const CameraForm& form : CameraForms()) {
    EXPECT_TRUE(names.insert(form.name).second) << form.name;
    EXPECT_FALSE(form.description.empty()) << form.name;
    EXPECT_EQ(form.description.find('\n'), std::string::npos) << form.name;
    EXPECT_THAT(CameraFormNames(), HasSubstr(form.name));
  }
}

TEST(CameraForms, KeysOfTwoFormsAreRefused) {
  EXPECT_THAT(CalibrationComplaint("Camera.fx: 500\nmodel_type: PINHOLE\n"),
              HasSubstr("has the keys of two forms, ORB-SLAM YAML and VINS YAML"));
}

// What OpenCV's reader takes, and what files become on other systems.
TEST(CameraForms, OrbSlamTakesWhatOpenCvTakes) {
  const Camera tum1 = CameraOfNumbers(kRadtan,
                                      {0, 0},
                                      {517.306408, 516.469215, 318.64304, 255.313989},
                                      {0.262383, -0.953104, -0.005358, 0.002628, 1.163314});
  const std::string dense =
      "%YAML:1.0\n\n#---\nCamera.fx:517.306408\nCamera.fy :516.469215\nCamera.cx:\t318.643040\n"
      "Camera.cy: 255.313989 \n\nCamera.k1:0.262383\nCamera.k2:-0.953104\nCamera.p1:-0.005358\n"
      "Camera.p2:0.002628\nCamera.k3:1.163314\n\nCamera.fps:30.0\nCamera.bf:40.0\nCamera.RGB:1\n"
      "Tcl:!!opencv-matrix\n   rows:2\n   cols:2\n   dt:f\n   data:[1.0,0.0,\n         0.0,1.0]\n";
  EXPECT_EQ(ReadChosen(dense), tum1);
  std::string windows = "\xef\xbb\xbf";
  for (const char c : dense) windows += c == '\n' ? "\r\n" : std::string(1, c);
  EXPECT_EQ(ReadChosen(windows), tum1);
  EXPECT_EQ(ReadChosen("%YAML:1.0\n---\n" + dense.substr(dense.find('#'))), tum1);
}

TEST(CameraForms, OrbSlam2StereoHasTheCamerasBeforeRectificationToo) {
  const std::string text =
      "%YAML:1.0\nCamera.fx: 435.2\nCamera.fy: 435.2\nCamera.cx: 367.4\nCamera.cy: 252.2\n"
      "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.width: 752\n"
      "Camera.height: 480\nLEFT.height: 480\nLEFT.width: 752\n"
      "LEFT.D: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n"
      "   data:[-0.28, 0.07, 0.0002, 1.8e-05, 0.0]\n"
      "LEFT.K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
      "   data: [458.6, 0.0, 367.2, 0.0, 457.3, 248.4, 0.0, 0.0, 1.0]\n";
  EXPECT_EQ(ReadChosen(text), CameraOfNumbers(kPinhole, {752, 480}, {435.2, 435.2, 367.4, 252.2}));
  EXPECT_EQ(
      ReadChosen(text, "LEFT"),
      CameraOfNumbers(
          kRadtan, {752, 480}, {458.6, 457.3, 367.2, 248.4}, {-0.28, 0.07, 0.0002, 1.8e-05, 0}));
  EXPECT_EQ(ReadChosen(text, "", "/euroc/mav0/cam0/data").fx, 458.6);
  EXPECT_THAT(ReadCalibration(text).notes, testing::Contains(HasSubstr("LEFT or RIGHT")));
}

TEST(CameraForms, OrbSlamNeverDropsACoefficient) {
  const std::string fisheye =
      "Camera.type: \"KannalaBrandt8\"\nCamera.fx: 200\nCamera.fy: 200\nCamera.cx: 3\n"
      "Camera.cy: 2\nCamera.k1: 0.1\nCamera.k2: 0.1\nCamera.k3: 0.1\nCamera.k4: 0.1\n";
  EXPECT_EQ(ReadChosen(fisheye + "Camera.k5: 0\nCamera.p1: 0.0\n").model, kEquidistant);
  EXPECT_THAT(CalibrationComplaint(fisheye + "Camera.k5: 0.2\n"),
              HasSubstr("calib.txt:10: Camera.k5 is '0.2', but a camera of this model"));
  const std::string numbers = "Camera.fx: 200\nCamera.fy: 200\nCamera.cx: 3\nCamera.cy: 2\n";
  EXPECT_EQ(ReadChosen(numbers + "Camera.k5: 0.2\n"),
            CameraOfNumbers(kRational, {0, 0}, {200, 200, 3, 2}, {0, 0, 0, 0, 0, 0, 0.2, 0}));
  EXPECT_THAT(CalibrationComplaint("Camera.type: Rectified\n" + numbers + "Camera.k1: 0.2\n"),
              HasSubstr("calib.txt:6: Camera.k1 is '0.2'"));
  EXPECT_THAT(CalibrationComplaint(numbers + "Camera.bFishEye: 1\n"), HasSubstr("bFishEye"));
  EXPECT_THAT(CalibrationComplaint(numbers + "Camera.fx: 201\n"),
              HasSubstr("calib.txt:5: Camera.fx is given twice, before in line 1"));
}

TEST(CameraForms, DecimalCommasAreNamed) {
  EXPECT_THAT(CalibrationComplaint("Camera.fx: 380,5\nCamera.fy: 1\n"),
              HasSubstr("calib.txt:1: Camera.fx is '380,5', a number with a decimal comma; write "
                        "380.5"));
  EXPECT_THAT(CalibrationComplaint("380,5 382,0 250,0 172,0\n"),
              HasSubstr("calib.txt:1: fx is '380,5', a number with a decimal comma"));
  EXPECT_THAT(CalibrationComplaint("P0: 7,1e2 0 6 0 0 7 1 0 0 0 1 0\n"),
              HasSubstr("calib.txt:1: P0[0] is '7,1e2', a number with a decimal comma"));
  EXPECT_THAT(
      CalibrationComplaint("camera_model: pinhole\nintrinsics: [380,5, 382,0, 250,0, 1,0]\n"),
      HasSubstr("calib.txt:2: intrinsics has 8 values, must have 4: fx fy cx cy; if these are "
                "decimal commas, write points"));
  EXPECT_EQ(ReadChosen("380.5,382,250,172\n").fy, 382.0);
  EXPECT_EQ(ReadChosen("380.5, 382, 250, 172\n").fy, 382.0);
}

TEST(CameraForms, StellaVslam) {
  EXPECT_THAT(CalibrationComplaint("Camera:\n  model: fisheye\n  fx: 200\n  fy: 200\n  cx: 1\n"
                                   "  cy: 2\n  p1: 0.1\n"),
              HasSubstr("calib.txt:7: Camera.p1 is '0.1'"));
  EXPECT_THAT(CalibrationComplaint("Camera:\n  model: cubic\n  fx: 2\n  fy: 2\n  cx: 1\n  cy: 2\n"),
              HasSubstr("calib.txt:2: Camera.model is 'cubic', must be perspective or fisheye"));
  EXPECT_THAT(CalibrationComplaint("Camera:\n  fx: 200\n"), HasSubstr("Camera.model is missing"));
}

TEST(CameraForms, KalibrReducesToAPinholeWhereItIsOne) {
  const std::string rest =
      "  distortion_coeffs: [-0.28, 0.09, 0.001, -0.0008]\n  distortion_model: radtan\n"
      "  resolution: [480, 360]\n";
  const Camera radtan =
      CameraOfNumbers(kRadtan, {480, 360}, {380, 382, 250, 172}, {-0.28, 0.09, 0.001, -0.0008});
  EXPECT_EQ(
      ReadChosen("cam0:\n  camera_model: omni\n  intrinsics: [0, 380, 382, 250, 172]\n" + rest),
      radtan);
  EXPECT_EQ(
      ReadChosen("cam0:\n  camera_model: ds\n  intrinsics: [0, 0, 380, 382, 250, 172]\n" + rest),
      radtan);
  EXPECT_EQ(ReadChosen("%YAML:1.0 # first line\n\ncam0:\n  camera_model: eucm\n"
                       "  intrinsics: [0, 1.05, 380, 382, 250, 172] #fu, fv\n" +
                       rest),
            radtan);
  EXPECT_THAT(CalibrationComplaint("cam0:\n  camera_model: pinhole\n"
                                   "  intrinsics: [380, 382, 250, 172]\n  line_delay: 2e-5\n"),
              HasSubstr("calib.txt:4: cam0.line_delay is given, but no resolution"));
  EXPECT_THAT(CalibrationComplaint("cam0:\n  camera_model: pinhole\n"
                                   "  intrinsics: [380, 382, 250, 172]\n  line_delay: 29\n"
                                   "  resolution: [480, 360]\n"),
              HasSubstr("calib.txt:4: cam0.line_delay is '29', must be the seconds"));
  EXPECT_THAT(CalibrationComplaint("relative_config_imucam: kalibr_imucam_chain.yaml\n"),
              HasSubstr("is 'kalibr_imucam_chain.yaml', the file with the cameras; give that one"));
}

TEST(CameraForms, KittiRawDrives) {
  const std::string size = "1.242000e+03 3.750000e+02\n";
  const std::string K_rect = "7.2e+02 0 6.1e+02 0 0 7.2e+02 1.7e+02 0 0 0 1 0\n";
  const std::string text =
      "calib_time: 09-Jan-2012 13:57:47\nS_00: 1.392e+03 5.12e+02\n"
      "K_00: 9.8e+02 0 6.9e+02 0 9.81e+02 2.3e+02 0 0 1\nD_00: -0.37 0.2 0.002 0.001 -0.07\n"
      "S_rect_00: " +
      size + "P_rect_00: " + K_rect + "S_rect_02: " + size + "P_rect_02: " + K_rect;
  const Camera rectified = CameraOfNumbers(kPinhole, {1242, 375}, {720, 720, 610, 170});
  EXPECT_EQ(ReadChosen(text), rectified);
  EXPECT_EQ(ReadChosen(text, "image_02"), rectified);
  EXPECT_EQ(ReadChosen(text, "", "/2011_09_26_drive_0001_sync/image_02/data"), rectified);
  const Camera raw = CameraOfNumbers(
      kRadtan, {1392, 512}, {980, 981, 690, 230}, {-0.37, 0.2, 0.002, 0.001, -0.07});
  EXPECT_EQ(ReadChosen(text, "K_00"), raw);
  EXPECT_EQ(ReadChosen(text, "", "/2011_09_26_drive_0001_extract/image_00/data"), raw);
  EXPECT_THAT(CalibrationComplaint(text + "P_rect_03: 1 2\n"), HasSubstr("cameras that differ"));
}

TEST(CameraForms, ColmapRefusesTermsThatItLacks) {
  EXPECT_THAT(CalibrationComplaint("1 THIN_PRISM_FISHEYE 4 3 2 2 2 2 1 0 0 0 0 0 0.5 0\n"),
              HasSubstr("calib.txt:1: camera 1: sx1 is 0.5, but THIN_PRISM_FISHEYE is supported"));
  EXPECT_THAT(
      CalibrationComplaint("1 RAD_TAN_THIN_PRISM_FISHEYE 4 3 2 2 2 2 1 0 0 0 0 1 0 0 0 0 0 0\n"),
      HasSubstr("k5, the sixth radial term, is 1"));
  // One camera that cannot be read leaves the others.
  const std::string two = "1 OPENCV 640 480 500 501 320 240 0 0 0 0\n2 EQUIRECTANGULAR 640 320\n";
  EXPECT_EQ(ReadChosen(two, "1").fx, 500.0);
  EXPECT_THAT(CalibrationComplaint(two), HasSubstr("cameras that differ: 1, 2"));
}

TEST(CameraForms, OpenCvStorage) {
  const std::string matrix = "[[380, 0, 250], [0, 382, 172], [0, 0, 1]]\n";
  for (const std::string key :
       {"camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "M1", "mtx", "intrinsic_matrix"}) {
    const std::string other = key == "M1" ? "D1" : "dist_coeffs";
    EXPECT_EQ(ReadChosen(key + ": " + matrix + other + ": [-0.28, 0.09, 0.001, -0.0008, -0.01]\n"),
              CameraOfNumbers(
                  kRadtan, {0, 0}, {380, 382, 250, 172}, {-0.28, 0.09, 0.001, -0.0008, -0.01}))
        << key;
  }
  const std::string four = "K: " + matrix + "D: [-0.02, 0.012, -0.006, 0.001]\n";
  EXPECT_EQ(ReadChosen(four).model, kRadtan);
  EXPECT_THAT(ReadCalibration(four).notes, testing::ElementsAre(HasSubstr("`fisheye: 1`")));
  for (const std::string flag : {"fisheye: 1\n", "model: equidistant\n", "fisheye_model: true\n"}) {
    EXPECT_EQ(
        ReadChosen(four + flag),
        CameraOfNumbers(kEquidistant, {0, 0}, {380, 382, 250, 172}, {-0.02, 0.012, -0.006, 0.001}))
        << flag;
  }
  EXPECT_EQ(
      ReadChosen("K: " + matrix + "D: [3.1, 1.4, 0, 0, 0.06, 3.4, 2.2, 0.32, 0, 0, 0, 0]\n").model,
      kRational);
  EXPECT_THAT(CalibrationComplaint("K: " + matrix +
                                   "D: [3, 1, 0, 0, 0.06, 3.4, 2.2, 0.3, 0, 0.01, 0, 0]\n"),
              HasSubstr("calib.txt:2: D has s2 = 0.01, a thin prism or tilted sensor"));
  EXPECT_THAT(CalibrationComplaint("K: " + matrix + "D: [1, 2, 3]\n"),
              HasSubstr("calib.txt:2: D has 3 values, must have 4, 5 or 8"));
  EXPECT_THAT(CalibrationComplaint("K: [[380, 0.5, 250], [0, 382, 172], [0, 0, 1]]\n"),
              HasSubstr("calib.txt:1: K has a skew of 0.5"));
  EXPECT_THAT(CalibrationComplaint("image_width: 640\ncamera_matrix: !!opencv-matrix\n   rows: 3\n"
                                   "   cols: 3\n   dt: d\n   data: [ 380., 0., 250.]\n"),
              HasSubstr("calib.txt:6: camera_matrix.data has 3 values, must have 3 x 3"));
  EXPECT_THAT(ReadCalibration("K: " + matrix).notes,
              testing::ElementsAre(HasSubstr("no distortion coefficients")));
}

TEST(CameraForms, OpenCvStereoPair) {
  const std::string text =
      "M1: [380, 0, 250, 0, 382, 172, 0, 0, 1]\nD1: [-0.28, 0.09, 0.001, -0.0008, -0.01]\n"
      "M2: [390, 0, 250, 0, 392, 172, 0, 0, 1]\nD2: [-0.3, 0.09, 0.001, -0.0008, -0.01]\n";
  EXPECT_EQ(ReadChosen(text, "M2").distortion[0], -0.3);
  EXPECT_EQ(ReadChosen(text, "", "/data/right").fx, 390.0);
  EXPECT_EQ(ReadChosen(text, "", "/data/left/").fx, 380.0);
  EXPECT_THAT(CalibrationComplaint(text), HasSubstr("cameras that differ: M1, M2"));
  EXPECT_EQ(ReadChosen(text + "P1: !!opencv-matrix\n   rows: 1\n   cols: 1\n   data: [ 1. ]\n"
                              "P2:\n   rows: 1\n   cols: 1\n   data: [ 1. ]\n",
                       "M2")
                .fx,
            390.0);
}

TEST(CameraForms, OpenCvXmlKnowsItsLines) {
  const auto xml = [](const std::string& data) {
    return "<?xml version=\"1.0\"?>\n<opencv_storage>\n<imageSize>640 480</imageSize>\n"
           "<Camera_Matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n"
           "  <dt>d</dt>\n  <data>\n    " +
           data + "</data></Camera_Matrix>\n</opencv_storage>\n";
  };
  EXPECT_EQ(ReadChosen(xml("380. 0. 250. 0. 382. 172.\n 0. 0. 1.")),
            CameraOfNumbers(kPinhole, {640, 480}, {380, 382, 250, 172}));
  EXPECT_THAT(CalibrationComplaint(xml("380. 0. x 0. 382. 172. 0. 0. 1.")),
              HasSubstr("calib.txt:8: Camera_Matrix.data[2] is 'x'"));
  EXPECT_THAT(CalibrationComplaint("<?xml version=\"1.0\"?>\n<a>\n<b>\n</a>\n"),
              HasSubstr("is not XML"));
}

TEST(CameraForms, VinsAndCamodocal) {
  const std::string head = "%YAML:1.0\n---\nimage_width: 480\nimage_height: 360\n";
  const std::string projection =
      "projection_parameters:\n   fx: 380\n   fy: 382\n   cx: 250\n   cy: 172\n";
  EXPECT_EQ(ReadChosen(head +
                       "model_type: PINHOLE_FULL\ndistortion_parameters:\n   k1: 3.1\n"
                       "   k2: 1.4\n   k3: 0.06\n   k4: 3.4\n   k5: 2.2\n   k6: 0.32\n"
                       "   p1: 0.0005\n   p2: -0.0007\n" +
                       projection),
            CameraOfNumbers(kRational,
                            {480, 360},
                            {380, 382, 250, 172},
                            {3.1, 1.4, 0.0005, -0.0007, 0.06, 3.4, 2.2, 0.32}));
  const Camera rolling = ReadChosen(
      head + "model_type: PINHOLE\nrolling_shutter: 1\nrolling_shutter_tr: 0.036\n" + projection);
  EXPECT_NEAR(rolling.readout_s, 0.036 * 359 / 360, 1e-12);
  EXPECT_TRUE(rolling.knows_readout);
  EXPECT_THAT(CalibrationComplaint(head + "model_type: SCARAMUZZA\n"),
              HasSubstr("calib.txt:5: model_type is 'SCARAMUZZA', which is not supported"));
  EXPECT_THAT(CalibrationComplaint("%YAML:1.0\n\nnum_of_cam: 2\ncam0_calib: \"cam0_mei.yaml\"\n"),
              HasSubstr("calib.txt:4: cam0_calib is 'cam0_mei.yaml', the file with the camera"));
}

TEST(CameraForms, DsoRelativeAndWithoutAModel) {
  ExpectNear(ReadChosen("0.535719308 0.669566858 0.493248545 0.500408664 0.897966326\n1280 1024\n"
                        "crop\n640 480\n"),
             CameraOfNumbers(kFov,
                             {1280, 1024},
                             {0.535719308 * 1280,
                              0.669566858 * 1024,
                              0.493248545 * 1280 - 0.5,
                              0.500408664 * 1024 - 0.5},
                             {0.897966326}),
             1e-9);
  EXPECT_EQ(ReadChosen("EquiDistant 190 191 254 256 0.003 0.0007 -0.002 0.0002\n512 512\ncrop\n"
                       "512 512\n")
                .model,
            kEquidistant);
  EXPECT_EQ(ReadChosen("525 525 319.5 239.5 0\n640 480\nfull\n640 480\n").model, kPinhole);
  EXPECT_THAT(CalibrationComplaint("Pinhole 525 525 319.5 239.5 0.9\n640 480\n"),
              HasSubstr("calib.txt:1: Pinhole has a fifth value that is not 0"));
  EXPECT_THAT(CalibrationComplaint("RadTan 525 525 319.5 239.5 0.9\n640 480\n"),
              HasSubstr("calib.txt:1: RadTan has 5 values, must have 8"));
  EXPECT_THAT(CalibrationComplaint("0.5 0.6 0.5 0.5\n"), HasSubstr("look relative"));
  EXPECT_THAT(CalibrationComplaint("525 525 319 239 0.9\n"), HasSubstr("has 5 numbers, must have"));
}

TEST(CameraForms, MatrixAlone) {
  const Camera camera = CameraOfNumbers(kPinhole, {0, 0}, {577.5, 578.7, 319.5, 239.5});
  EXPECT_EQ(ReadChosen("577.5 0 319.5 0\n0 578.7 239.5 0\n0 0 1 0\n0 0 0 1\n"), camera);
  EXPECT_EQ(ReadChosen("577.5 0 319.5\n0 578.7 239.5\n0 0 1\n"), camera);
  EXPECT_EQ(ReadChosen("577.5 0 319.5 0 578.7 239.5 0 0 1\n"), camera);
  EXPECT_THAT(CalibrationComplaint("577.5 1 319.5\n0 578.7 239.5\n0 0 1\n"), HasSubstr("skew"));
  // A number too small for a double is none.
  EXPECT_THAT(CalibrationComplaint("380.5, 1e-400, 320, 240, 0, 0, 0, 0, 0\n"),
              HasSubstr("calib.txt"));
}

TEST(CameraForms, Nerfstudio) {
  const auto text = [](const std::string& numbers) {
    return "{\n\"w\": 480, \"h\": 360, \"fl_x\": 380, \"cx\": 250.5, \"cy\": 172.5,\n" + numbers +
           "\n\"frames\": []}\n";
  };
  EXPECT_EQ(
      ReadChosen(text("\"k1\": -0.02, \"k2\": 0.012, \"k3\": -0.006, \"k4\": 0.001, \"p1\": 0,"
                      "\"camera_model\": \"OPENCV_FISHEYE\",")),
      CameraOfNumbers(
          kEquidistant, {480, 360}, {380, 380, 250, 172}, {-0.02, 0.012, -0.006, 0.001}));
  EXPECT_EQ(ReadChosen(text("\"k1\": -0.02, \"is_fisheye\": true,")).model, kEquidistant);
  EXPECT_EQ(ReadChosen(text("\"k1\": -0.02, \"is_fisheye\": false,")).model, kRadtan);
  EXPECT_THAT(CalibrationComplaint(text("\"k4\": 0.1,")),
              HasSubstr("calib.txt:3: k4 is '0.1', a term of the eighth order"));
  EXPECT_THAT(CalibrationComplaint(text("\"camera_model\": \"EQUIRECTANGULAR\",")),
              HasSubstr("calib.txt:3: camera_model is 'EQUIRECTANGULAR', which is not supported"));
  EXPECT_THAT(CalibrationComplaint("{\"camera_angle_x\": 4, \"frames\": []}"),
              HasSubstr("camera_angle_x is '4', must be an angle of view"));
  ExpectNear(
      ReadChosen("{\"camera_angle_x\": 0.69, \"w\": 800, \"h\": 600}"),
      CameraOfNumbers(
          kPinhole, {800, 600}, {400 / std::tan(0.345), 400 / std::tan(0.345), 399.5, 299.5}),
      1e-9);
}

TEST(CameraForms, NerfstudioWithNumbersOfEachFrame) {
  const auto frame = [](const std::string& name, const std::string& focal) {
    return "{\"file_path\": \"" + name + "\", \"fl_x\": " + focal + ", \"cx\": 320, \"cy\": 240}";
  };
  EXPECT_EQ(ReadChosen("{\"w\": 640, \"h\": 480, \"frames\": [" + frame("a.png", "500") + ", " +
                       frame("b.png", "500") + "]}"),
            CameraOfNumbers(kPinhole, {640, 480}, {500, 500, 319.5, 239.5}));
  EXPECT_THAT(CalibrationComplaint("{\"w\": 640, \"h\": 480, \"frames\": [" +
                                   frame("a.png", "500") + ", " + frame("b.png", "510") + "]}"),
              HasSubstr("cameras that differ: a.png, b.png"));
}

TEST(CameraForms, OpenMvg) {
  const auto text = [](const std::string& type, const std::string& numbers) {
    return "{\"sfm_data_version\": \"0.3\",\n\"intrinsics\": [{\"key\": 0, \"value\": {\n"
           "\"polymorphic_id\": 2147483649, \"polymorphic_name\": \"" +
           type +
           "\",\n\"ptr_wrapper\": {\"data\": {\"width\": 480, \"height\": 360,\n"
           "\"focal_length\": 381, \"principal_point\": [250, 172]" +
           numbers + "}}}}]}\n";
  };
  EXPECT_EQ(ReadChosen(text("pinhole_brown_t2", ", \"disto_t2\": [1, 2, 3, 4, 5]")),
            CameraOfNumbers(kRadtan, {480, 360}, {381, 381, 250, 172}, {1, 2, 4, 5, 3}));
  EXPECT_EQ(ReadChosen(text("fisheye", ", \"fisheye\": [1, 2, 3, 4]")).model, kEquidistant);
  EXPECT_EQ(ReadChosen(text("pinhole", "")).model, kPinhole);
  EXPECT_THAT(CalibrationComplaint(text("spherical", "")),
              HasSubstr("calib.txt:3: polymorphic_name is 'spherical', which is not supported"));
  EXPECT_THAT(CalibrationComplaint(text("fisheye", ", \"fisheye\": [1, 2]")),
              HasSubstr("intrinsics[0].value.ptr_wrapper.data.fisheye has 2 values"));
}

TEST(CameraForms, BasaltRefusesOtherModelsByName) {
  EXPECT_THAT(
      CalibrationComplaint("{\"value0\": {\"intrinsics\": [\n{\"camera_type\": \"ds\",\n"
                           "\"intrinsics\": {\"fx\": 1, \"fy\": 1, \"cx\": 0, \"cy\": 0, \"xi\": "
                           "-0.2, \"alpha\": 0.5}}]}}"),
      HasSubstr("calib.txt:2: value0.intrinsics[0].camera_type is 'ds', which is not supported"));
}

}  // namespace
}  // namespace rotslam
