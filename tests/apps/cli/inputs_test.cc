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
    // Its frames would need a rolling shutter, which those of kb have not.
    {"kalibr_linedelay.yaml", "", "", "rolling shutter 0.019944245 s"},
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
    {"transforms_blender.json", "", "", "pinhole, fx 400.380613, fy 400.380613"},
    {"vins_kb.yaml", "", "kb", "equidistant"},
    {"vins_mei.yaml", "", "", "MEI"},
    {"vins_pinhole.yaml", "", "", "radtan, fx 380, fy 382, cx 250, cy 172, k1 -0.28, k2 0.09"},
};

// ---- trajectories

struct TrajectoryCase {
  const char* truth;
  const char* estimate;
  const char* option;  // of `eval`; empty: none
  bool is_read;        // RPE_1 is 0.063 deg; else one line refuses it
  const char* says;    // a part of what is said
};

constexpr TrajectoryCase kTrajectoryCases[] = {
    {"gt.txt", "est.txt", "", true, ""},
    {"gt.txt", "est_bom.txt", "", true, ""},
    {"gt.txt", "est_bom_nohead.txt", "", true, ""},
    {"gt.txt", "est_comma.txt", "", true, ""},
    {"gt.txt", "est_decimalcomma.txt", "", true, "decimal points"},
    {"gt.txt", "est_dup.txt", "", true, ""},
    {"gt.txt", "est_euroc8.csv", "", true, ""},
    {"gt.txt", "est_frameidx9.txt", "", true, ""},
    {"gt.txt", "est_header.txt", "", true, ""},
    {"gt_kitti.txt", "est_kitti.txt", "", true, ""},
    {"gt_kitti.txt", "est_kitti13.txt", "", true, ""},
    {"gt_kitti.txt", "est_kitti16.txt", "", true, ""},
    {"gt.txt", "est_nan.txt", "", true, "nan"},
    {"gt.txt", "est_orb3_ns.txt", "", true, ""},
    {"gt.txt", "est_semicolon.txt", "", true, ""},
    {"gt.txt", "est_trailing.txt", "", true, ""},
    {"gt.txt", "est_zeroq.txt", "", true, ""},
    {"gt_body.txt", "est.txt", "--align-axes", true, "axes"},
    {"gt_dup.txt", "est.txt", "", true, ""},
    {"gt_euroc17.csv", "est.txt", "", true, ""},
    {"gt_idx.txt", "est_kitti.txt", "", true, ""},
    {"gt_off.txt", "est.txt", "", false, "3600"},
    {"gt_seconds_qw.csv", "est.txt", "", true, ""},
    {"gt_tartan.txt", "est_kitti.txt", "", true, ""},
    {"gt_tumvi8.csv", "est.txt", "", true, ""},
    {"gt_worldtocam.txt", "est.txt", "", true, "world"},
};

// ---- graphs

struct GraphCase {
  const char* file;
  const char* says;
};

constexpr GraphCase kGraphCases[] = {{"EGs.txt", "1DSfM"},
                                     {"decimalcomma.g2o", "decimal points"},
                                     {"ok.g2o", "g2o"},
                                     {"relpose.txt", "relpose"}};

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

// The part of the docs between two marks; with ROTSLAM_UPDATE_DOCS set it is replaced by `text`.
std::string DocsBetween(const std::string& mark, const std::string& text) {
  const fs::path file = fs::path(ROTSLAM_DOCS_DIR) / "inputs.md";
  std::string docs = ReadWholeFile(file);
  const std::string begin_mark = "<!-- " + mark + " -->\n";
  const std::size_t begin = docs.find(begin_mark) + begin_mark.size();
  const std::size_t end = docs.find("<!-- end of " + mark + " -->");
  if (std::getenv("ROTSLAM_UPDATE_DOCS") != nullptr) {
    docs.replace(begin, end - begin, text);
    std::ofstream(file) << docs;
    return text;
  }
  return docs.substr(begin, end - begin);
}

std::string WithoutFolders(std::string text) {
  const std::string folder = Place().string() + "/";
  for (std::size_t at = 0; (at = text.find(folder)) != std::string::npos;) {
    text.erase(at, folder.size());
  }
  return text;
}

// Joins the notes that a command has said.
std::string NotesIn(const std::string& output) {
  std::string notes;
  for (const std::string& line : Lines(output)) {
    if (line.starts_with("note: ")) notes += "; " + line.substr(line.find_first_not_of(' ', 5));
  }
  return notes;
}

TEST(InputForms, TableInTheDocsIsTrue) {
  const CommandResult result = Rotslam({"inspect", "--forms"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(DocsBetween("forms", result.output), result.output)
      << "run inputs_test with ROTSLAM_UPDATE_DOCS=1";
}

TEST_F(Inputs, EveryOneIsReadRightOrRefusedInOneLine) {
  std::string table = "| input | what comes out |\n|---|---|\n";
  std::set<std::string> seen;
  for (const CameraCase& input : kCameraCases) {
    SCOPED_TRACE(std::string(input.file) + ":" + input.camera);
    seen.insert(std::string("calib/") + input.file);
    const std::string name =
        std::string(input.file) + (*input.camera == '\0' ? "" : std::string(":") + input.camera);
    const std::string reference = (Place() / "calib" / name).string();
    const std::string frames = *input.frames == '\0' ? "pin" : input.frames;
    const CommandResult result =
        Rotslam({"inspect", (Place() / "frames" / frames).string(), "--camera", reference});
    const std::vector<std::string> lines = Lines(result.output);
    const auto camera = std::find_if(
        lines.begin(), lines.end(), [](const auto& line) { return line.starts_with("camera: "); });
    if (camera == lines.end()) {
      ADD_FAILURE() << result.output << result.error;
      continue;
    }
    std::string outcome = WithoutFolders(camera->substr(8));
    EXPECT_THAT(outcome, HasSubstr(input.says));
    if (*input.frames != '\0') {
      const double error_deg = ErrorOfFrames(input.frames, reference);
      EXPECT_GE(error_deg, 0.0);
      EXPECT_LT(error_deg, kMaxErrorDeg);
      outcome += "; RPE_1 below 0.01 deg";
    }
    table += Row("calib/" + name, outcome);
  }
  for (const TrajectoryCase& input : kTrajectoryCases) {
    SCOPED_TRACE(std::string(input.truth) + " " + input.estimate);
    seen.insert({std::string("eval/") + input.truth, std::string("eval/") + input.estimate});
    std::vector<std::string> arguments = {"eval",
                                          (Place() / "eval" / input.truth).string(),
                                          (Place() / "eval" / input.estimate).string()};
    if (*input.option != '\0') arguments.emplace_back(input.option);
    const CommandResult shown = Rotslam(arguments);
    arguments.emplace_back("--json");
    const CommandResult result = Rotslam(arguments);
    EXPECT_EQ(result.exit_code == 0, input.is_read) << result.error;
    EXPECT_THAT(shown.output + shown.error, HasSubstr(input.says));
    std::string outcome = WithoutFolders(FirstLine(shown.error));
    if (input.is_read && result.exit_code == 0) {
      const double error_deg = ErrorDeg(result);
      EXPECT_NEAR(error_deg, kTrajectoryErrorDeg, 1e-3);
      outcome = "RPE_1 " + Fixed(error_deg) + " deg" + NotesIn(WithoutFolders(shown.output));
    }
    table += Row(std::string("eval/") + input.truth + " " + input.estimate +
                     (*input.option == '\0' ? "" : std::string(" ") + input.option),
                 outcome);
  }
  for (const GraphCase& input : kGraphCases) {
    SCOPED_TRACE(input.file);
    seen.insert(std::string("graph/") + input.file);
    const CommandResult result = Rotslam({"inspect", (Place() / "graph" / input.file).string()});
    EXPECT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.output, HasSubstr(input.says));
    table += Row(std::string("graph/") + input.file,
                 WithoutFolders(FirstLine(result.output)).substr(8) + NotesIn(result.output));
  }
  seen.insert({"eval/times.txt", "graph/truth_cw.txt"});
  for (const char* folder : {"calib", "eval", "graph"}) {
    for (const auto& entry : fs::directory_iterator(Place() / folder)) {
      const std::string name = folder + ("/" + entry.path().filename().string());
      EXPECT_TRUE(seen.contains(name)) << name << " is in no case";
    }
  }
  EXPECT_EQ(DocsBetween("cases", table), table) << "run inputs_test with ROTSLAM_UPDATE_DOCS=1";
}

TEST_F(Inputs, VideosAreUprightAndHaveTheirTimes) {
  const fs::path place = Place() / "video";
  const fs::path out = folder_.path() / "out";
  const CommandResult run = Rotslam({"rotations",
                                     (place / "phone_upright.mp4").string(),
                                     "--camera",
                                     (place / "port.yaml").string(),
                                     "--out",
                                     out.string(),
                                     "--no-report"});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  EXPECT_THAT(run.error, HasSubstr("360x480"));
  const double error_deg = ErrorDeg(Rotslam({"eval",
                                             (place / "port_truth_tum.txt").string(),
                                             (out / "rotations_tum.txt").string(),
                                             "--json"}));
  EXPECT_GE(error_deg, 0.0);
  EXPECT_LT(error_deg, 0.05);  // compressed as a phone's
  const CommandResult film = Rotslam({"inspect", (place / "f10.mp4").string()});
  EXPECT_THAT(film.output, HasSubstr(" 10 a second"));
  EXPECT_THAT(film.output, testing::Not(HasSubstr("gap")));
}

}  // namespace
}  // namespace rotslam
