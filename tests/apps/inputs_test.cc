// What people bring: small inputs of known truth that lie beside the checkout. Each gives the right
// numbers or one right line; docs/inputs.md shows what comes out, in a table that is made here.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The frames turn by 21 deg in all; with the right camera RPE_1 is below 0.004 deg.
constexpr double kMaxErrorDeg = 0.01;
// est.txt against gt.txt.
constexpr double kTrajectoryErrorDeg = 0.063;

fs::path Place() { return fs::path(ROTSLAM_SHARED_DIR) / "cases" / "inputs"; }

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

// The error's line without the program's name and the folders of the machine.
std::string ShownError(const CommandResult& result) {
  std::string text = FirstLine(result.error);
  const std::string folder = Place().string() + "/";
  for (std::size_t at = 0; (at = text.find(folder)) != std::string::npos;) {
    text.erase(at, folder.size());
  }
  const std::string program = "rotslam: ";
  return text.starts_with(program) ? text.substr(program.size()) : text;
}

// One line of the table in the docs.
std::string Row(const std::string& input, std::string outcome) {
  std::replace(outcome.begin(), outcome.end(), '|', '/');
  return "| `" + input + "` | " + outcome + " |\n";
}

std::string Fixed(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3f", value);
  return text;
}

// RPE_1 in degrees, as `rotslam eval` says; -1 where it says nothing.
double ErrorDeg(const CommandResult& result) {
  if (result.exit_code != 0) return -1.0;
  return nlohmann::json::parse(result.output)["rpe1"];
}

// ---- camera files

struct CameraCase {
  const char* file;
  const char* camera;  // behind the colon; empty: none
  const char* frames;  // that the camera belongs to; empty: none, `says` alone is asked
  const char* says;    // a part of what `inspect` says of it, or of the line that refuses it
};

constexpr CameraCase kCameraCases[] = {
    {"basalt.json", "", "kb", "equidistant"},
    {"cameras.bin", "", "", "radtan, fx 380, fy 382, cx 250, cy 172"},
    {"colmap_equi.txt", "", "", "EQUIRECTANGULAR"},
    {"colmap_fov.txt", "", "", "fov, fx 230, fy 231, cx 236, cy 182, w 0.9"},
    {"colmap_full0.txt", "", "rad", "radtan"},
    {"colmap_full8.txt", "", "rat", "rational"},
    {"colmap_kb.txt", "", "kb", "equidistant"},
    {"colmap_rttpf.txt", "", "kb", "equidistant"},
    {"colmap_simple_radial.txt", "", "", "radtan, fx 390, fy 390, cx 239.5, cy 179.5, k1 -0.15"},
    {"colmap_tpf.txt", "", "kb", "equidistant"},
    {"colmap_two.txt", "", "", "--camera"},
    {"colmap_two.txt", "2", "", "radtan, fx 381, fy 383"},
    {"droid.txt", "", "", "radtan, fx 380, fy 382, cx 250, cy 172, k1 -0.28, k2 0.09"},
    {"droid4.txt", "", "", "pinhole, fx 380, fy 382, cx 250, cy 172"},
    {"droid_int.txt", "", "", "pinhole, fx 525, fy 525, cx 320, cy 240"},
    {"dso_kb.txt", "", "kb", "equidistant"},
    {"dso_pinhole.txt", "", "", "pinhole, fx 379.968, fy 381.996"},
    {"dso_radtan.txt", "", "", "radtan, fx 380, fy 382, cx 250, cy 172, k1 -0.28, k2 0.09"},
    {"kalibr_ds_none.yaml", "", "", "ds"},
    {"kalibr_eucm_none.yaml", "", "", "eucm"},
    {"kalibr_linedelay.yaml", "", "kb", "rolling shutter"},
    {"kalibr_omni_radtan.yaml", "", "", "omni"},
    {"kalibr_pinhole_fov.yaml", "", "", "fov, fx 200, fy 201, cx 236, cy 182, w 0.9"},
    {"kalibr_two.yaml", "", "", "--camera"},
    {"kalibr_two.yaml", "cam1", "kb", "equidistant"},
    {"kitti_diffP2.txt", "", "", "--camera"},
    {"kitti_diffP2.txt", "P2", "", "pinhole, fx 400, fy 400, cx 239.5, cy 179.5"},
    {"kitti_multiline.txt", "", "", "pinhole, fx 707, fy 707, cx 601, cy 183"},
    {"kitti_nocolon.txt", "", "pin", "pinhole"},
    {"kitti_p2only.txt", "", "pin", "pinhole"},
    {"ocv.xml", "", "rad", "radtan"},
    {"ocv.yaml", "", "rad", "radtan"},
    {"orb2_k456.yaml", "", "rat", "rational"},
    {"orb3_kb8_old.yaml", "", "kb", "equidistant"},
    {"orb3_kb8_v1.yaml", "", "kb", "equidistant"},
    {"orb3_kb8_v1.yaml", "Camera2", "", "equidistant, fx 210, fy 211"},
    {"orb3_pinhole_newsize.yaml", "", "rad", "radtan"},
    {"ros_msg.yaml", "", "rad", "radtan"},
    {"ros_msg.yaml", "rectified", "", "pinhole, fx 340, fy 350, cx 251, cy 171"},
    {"ros_ost.yaml", "", "rad", "radtan"},
    {"sfm_data.json", "", "", "radtan, fx 381, fy 381"},
    {"stella_flat_equirect.yaml", "", "", "equirectangular"},
    {"stella_flat_fisheye.yaml", "", "kb", "equidistant"},
    {"stella_flat_radialdivision.yaml", "", "", "radial_division"},
    {"stella_nested_equirect.yaml", "", "", "equirectangular"},
    {"stella_nested_fisheye.yaml", "", "kb", "equidistant"},
    {"stella_nested_perspective.yaml", "", "rad", "radtan"},
    {"transforms_.json", "", "", "radtan, fx 380, fy 382, cx 250, cy 172, k1 -0.28, k2 0.09"},
    {"transforms_OPENCV.json", "", "", "radtan, fx 380, fy 382, cx 250, cy 172, k1 -0.28, k2 0.09"},
    {"transforms_OPENCV_FISHEYE.json", "", "", "p1"},
    {"transforms_PINHOLE.json", "", "", "PINHOLE"},
    {"transforms_blender.json", "", "", "camera_angle_x"},
    {"vins_kb.yaml", "", "kb", "equidistant"},
    {"vins_mei.yaml", "", "", "MEI"},
    {"vins_pinhole.yaml", "", "", "radtan, fx 380, fy 382, cx 250, cy 172, k1 -0.28, k2 0.09"},
};

// ---- trajectories

struct TrajectoryCase {
  const char* truth;
  const char* estimate;
  std::vector<std::string> more;
  bool is_read;      // to RPE_1 = 0.063; else `says` is in the line that refuses it
  const char* says;  // a part of what it says
};

class Inputs : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(Place())) GTEST_SKIP() << Place() << " is not here";
  }

  // RPE_1 of the orientations of a folder of frames, deg.
  double ErrorOfFrames(const std::string& frames, const std::string& camera) const {
    const fs::path sequence = Place() / "frames" / frames;
    const fs::path out = folder_.path() / "out";
    fs::remove_all(out);
    const CommandResult run = Rotslam({"rotations",
                                       sequence.string(),
                                       "--camera",
                                       camera,
                                       "--out",
                                       out.string(),
                                       "--no-report",
                                       "--quiet"});
    EXPECT_EQ(run.exit_code, 0) << run.error;
    return ErrorDeg(Rotslam({"eval",
                             (sequence / "truth_tum.txt").string(),
                             (out / "rotations_tum.txt").string(),
                             "--json"}));
  }

  const TemporaryFolder folder_;
};

TEST_F(Inputs, EveryOneIsReadRightOrRefusedInOneLine) {
  std::string table;
  std::set<std::string> seen;
  for (const CameraCase& input : kCameraCases) {
    SCOPED_TRACE(std::string(input.file) + ":" + input.camera);
    seen.insert(input.file);
    const std::string name =
        std::string(input.file) + (*input.camera == '\0' ? "" : std::string(":") + input.camera);
    const std::string reference = (Place() / "calib" / name).string();
    // A chain of cameras is read; only where one is to be chosen it matters which.
    const std::string frames = *input.frames == '\0' ? "pin" : input.frames;
    const CommandResult result =
        Rotslam({"inspect", (Place() / "frames" / frames).string(), "--camera", reference});
    const std::vector<std::string> lines = Lines(result.output);
    const auto camera = std::find_if(
        lines.begin(), lines.end(), [](const auto& line) { return line.starts_with("camera: "); });
    ASSERT_NE(camera, lines.end()) << result.output << result.error;
    std::string outcome = camera->substr(8);
    EXPECT_THAT(result.output, HasSubstr(input.says));
    const std::string folder = Place().string() + "/";
    for (std::size_t at = 0; (at = outcome.find(folder)) != std::string::npos;) {
      outcome.erase(at, folder.size());
    }
    if (*input.frames != '\0') {
      const double error_deg = ErrorOfFrames(input.frames, reference);
      EXPECT_GE(error_deg, 0.0);
      EXPECT_LT(error_deg, kMaxErrorDeg);
      outcome += "; RPE_1 " + Fixed(error_deg) + " deg";
    }
    table += Row("calib/" + name, outcome);
  }
  for (const auto& entry : fs::directory_iterator(Place() / "calib")) {
    EXPECT_TRUE(seen.contains(entry.path().filename().string())) << entry.path();
  }
  std::ofstream("/tmp/inputs_table.md") << table;
}

}  // namespace
}  // namespace rotslam
