// What a report holds, from a run folder made by hand; and the figures for print.

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "apps/page/camera_angles.h"
#include "apps/report/figures/figures.h"
#include "apps/report/page.h"
#include "apps/report/page_data.h"
#include "apps/report/run_data.h"
#include "output/graph/g2o.h"
#include "output/tables/lens_curve.h"
#include "output/tables/summary.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/camera/read_camera.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int kNumFrames = 30;
constexpr int kNumPoints = 120;
const std::string kHostile = "/gone/</script><script>alert(1)</script><!--\xff";

std::string Decoded(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned word = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    word = (word << 6) | static_cast<unsigned>(digits.find(c));
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes += static_cast<char>((word >> bits) & 255U);
  }
  return bytes;
}

template <class T>
std::vector<T> Values(const Json& array) {
  const std::string bytes = Decoded(array.at("data"));
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

Camera SmallCamera() {
  Camera camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = camera.fy = 300.0;
  camera.cx = 160.0;
  camera.cy = 120.0;
  return camera;
}

// The camera walks along its x axis and turns to the right.
StampedPose PoseAt(int frame) {
  return {1e9 + 0.1 * frame, Rotation::Exp({0.0, 0.03 * frame, 0.0}), {0.5 * frame, 0.0, 0.1}};
}

class Report : public testing::Test {
 protected:
  void SetUp() override {
    std::vector<RotationRow> rows;
    Trajectory poses;
    for (int n = 0; n < kNumFrames; ++n) {
      const StampedPose pose = PoseAt(n);
      poses.push_back(pose);
      rows.push_back({n, pose.timestamp_s, pose.world_from_cam, std::nullopt, 3 + n, {}});
      if (n > 4) rows.back().sigma_deg = Eigen::Vector3d(0.1, 0.2, 0.3);
    }
    rows[7].flags = {"predicted", "loop"};
    WriteRotationsCsv(Run() / "rotations.csv", rows);
    WriteTumTrajectory(Run() / "rotations_tum.txt", poses);
    ViewGraph graph;
    RotationMap cam_from_world;
    for (int n = 0; n < kNumFrames; ++n) {
      cam_from_world[FrameId{n}] = PoseAt(n).world_from_cam.Inverse();
    }
    graph.AddEdge({FrameId{0}, FrameId{1}, Rotation()});
    graph.AddEdge({FrameId{3}, FrameId{20}, Rotation()});
    WriteG2o(Run() / "view_graph.g2o", {graph, cam_from_world, {}});
    WriteLoopsCsv(Run() / "loops.csv", {{20, 3, 0.5, 99, 1.5, true, 1, 0}, {21, 3, 0.1, 0, 0}});
    WriteSummaryWith(kHostile);
  }

  void WriteSummaryWith(const std::string& sequence, const std::string& command = "run") const {
    RunSummary summary;
    summary.command = command;
    summary.sequence = {{"path", sequence}};
    summary.camera = SmallCamera();
    summary.counts = {{"frames", std::int64_t{kNumFrames}}};
    summary.seconds = {{"tracking", 0.5}, {"total", 1.25}};
    summary.options = {{"sequence.first", 0},
                       {"sequence.last", -1},
                       {"sequence.stride", 1},
                       {"sequence.fps", 30.0}};
    WriteSummary(Run() / "summary.json", summary);
  }

  // What `run` leaves besides.
  void AddPositions() const {
    RunMap map;
    map.camera = SmallCamera();
    Trajectory poses;
    for (int n = 0; n < kNumFrames; ++n) {
      const StampedPose pose = PoseAt(n);
      poses.push_back(pose);
      map.frames.push_back({FrameId{n},
                            pose.timestamp_s,
                            "x.png",
                            n % 5 == 0,
                            pose.world_from_cam.Inverse(),
                            pose.center_in_world});
    }
    for (int k = 0; k < kNumPoints; ++k) {
      MapTrack& track = map.tracks.emplace_back();
      track.track.id = TrackId{k};
      for (int n = 0; n < 3; ++n) {
        track.track.observations.push_back(
            {FrameId{n}, {2.0 * k, 120.0}, Eigen::Vector3d::UnitZ(), 1.0});
      }
      track.point_in_world = Eigen::Vector3d(0.1 * k, 1.0, 5.0);
      track.fits.assign(3, true);
      track.levels.assign(3, 0);
    }
    WriteRunMap(Run() / "map.bin", map);
    WriteRunMap(Run() / "map_all_frames.bin", map);
    WriteTumTrajectory(Run() / "trajectory_tum.txt", poses);
    WriteSegments(Run() / "segments.csv",
                  {{0, 9, "translating", 0, "reference", 0.0},
                   {10, 12, "rotating", 0, "tracks", 0.9},
                   {13, kNumFrames - 1, "translating", 1, "continuity", 0.0}});
  }

  fs::path Run() const { return folder_.path(); }

  Json Data(const PageLimits& limits = {}) const {
    const RunData run = ReadRunData(Run());
    return PageData(run, MakeThumbnails(run, "", {}), limits);
  }

  const TemporaryFolder folder_;
};

TEST_F(Report, SaysWhatItsFilesSay) {
  AddPositions();
  const Json data = Data();
  const auto position = Values<float>(data["frames"]["position"]);
  const auto angle = Values<float>(data["frames"]["angle_deg"]);
  const auto time = Values<float>(data["frames"]["time_s"]);
  ASSERT_EQ(position.size(), 3u * kNumFrames);
  for (int n = 0; n < kNumFrames; ++n) {
    EXPECT_NEAR(position[3 * n], 0.5 * n, 1e-5);
    EXPECT_NEAR(angle[3 * n + 2], 0.03 * n * kDegFromRad, 1e-4);
    EXPECT_NEAR(angle[3 * n], 0.0, 1e-4);
    EXPECT_NEAR(time[n], 0.1 * n, 1e-4);
  }
  EXPECT_EQ(Values<std::int32_t>(data["frames"]["edges"])[5], 8);
  EXPECT_EQ(Values<std::uint8_t>(data["frames"]["flags"])[7], 1 | 32);
  EXPECT_EQ(Values<std::int32_t>(data["frames"]["tracks"])[2], kNumPoints);
  EXPECT_EQ(Values<std::int32_t>(data["frames"]["tracks"])[3], 0);
  EXPECT_THAT(Values<std::int32_t>(data["keyframes"]["frame"]), ElementsAre(0, 5, 10, 15, 20, 25));
  EXPECT_THAT(Values<std::int32_t>(data["graph"]["frames"]), ElementsAre(0, 1, 3, 20));
  EXPECT_EQ(data["cloud"]["count"], kNumPoints);
  EXPECT_EQ(Values<float>(data["cloud"]["position"]).size(), 3u * kNumPoints);
  EXPECT_EQ(data["segments"].size(), 3u);
  EXPECT_EQ(data["loops"]["candidates"], 2);
  ASSERT_EQ(data["loops"]["accepted"].size(), 1u);
  EXPECT_EQ(data["loops"]["accepted"][0]["match"], 3);
  EXPECT_EQ(data["summary"], Json::parse(ReadWholeFile(Run() / "summary.json")));
}

TEST_F(Report, WithoutPositionsHasTheRest) {
  AddPositions();  // of an older run into the same folder
  WriteSummaryWith(kHostile, "rotations");
  const Json data = Data();
  EXPECT_FALSE(data["frames"].contains("position"));
  EXPECT_FALSE(data.contains("cloud"));
  EXPECT_FALSE(data.contains("truth"));
  EXPECT_EQ(Values<float>(data["frames"]["quaternion"]).size(), 4u * kNumFrames);
  EXPECT_THAT(data["thumbnails"]["problem"], HasSubstr("no longer at /gone/"));
}

TEST_F(Report, HasFiniteNumbersOnly) {
  AddPositions();
  const Json data = Data();
  int num_arrays = 0;
  for (const char* part : {"frames", "graph", "cloud"}) {
    for (const auto& [name, array] : data[part].items()) {
      if (!array.is_object() || array.at("type") != "f32") continue;
      ++num_arrays;
      for (const float value : Values<float>(array)) EXPECT_TRUE(std::isfinite(value)) << name;
    }
  }
  EXPECT_GT(num_arrays, 6);
  const auto sigma = Values<float>(data["frames"]["sigma_deg"]);
  EXPECT_EQ(sigma[0], -1.0F);
  // Roll, pitch, yaw turn about z, x, y.
  EXPECT_THAT(std::vector<float>(sigma.begin() + 30, sigma.begin() + 33),
              ElementsAre(0.3F, 0.1F, 0.2F));
}

TEST_F(Report, KeepsItsLimits) {
  AddPositions();
  PageLimits limits;
  limits.max_points = 50;
  limits.max_frames = 10;
  const Json data = Data(limits);
  EXPECT_EQ(data["cloud"]["count"], kNumPoints);
  EXPECT_EQ(Values<float>(data["cloud"]["position"]).size(), 3u * 40);
  EXPECT_EQ(data["frame_step"], 3);
  EXPECT_THAT(Values<std::int32_t>(data["frames"]["frame"]),
              ElementsAre(0, 3, 6, 9, 12, 15, 18, 21, 24, 27));
  EXPECT_EQ(data.dump(-1, ' ', false, Json::error_handler_t::replace),
            Data(limits).dump(-1, ' ', false, Json::error_handler_t::replace));
}

TEST_F(Report, NoNameEndsTheElementItIsIn) {
  const auto count = [](const std::string& page) {
    const std::regex end("</script", std::regex::icase);
    return std::distance(std::sregex_iterator(page.begin(), page.end(), end),
                         std::sregex_iterator());
  };
  const std::string page = ReportPage(ReadRunData(Run()), {});
  EXPECT_EQ(count(page), 4);
  EXPECT_EQ(page.find("<!--\xff"), std::string::npos);
  const std::string begin = "<script type=\"application/json\" id=\"data\">";
  const std::size_t at = page.find(begin) + begin.size();
  const Json data = Json::parse(page.substr(at, page.find("</script>", at) - at));
  EXPECT_THAT(data["summary"]["sequence"]["path"].get<std::string>(),
              HasSubstr("</script><script>alert(1)"));
}

TEST_F(Report, LeavesPicturesOutUntilItIsSmallEnough) {
  const fs::path images = Run() / "images";
  fs::create_directories(images);
  for (int n = 0; n < kNumFrames; ++n) {
    cv::Mat noise(240, 320, CV_8UC3);
    cv::randu(noise, 0, 255);
    cv::imwrite((images / (std::to_string(100 + n) + ".png")).string(), noise);
  }
  WriteSummaryWith(images.string());
  const RunData run = ReadRunData(Run());
  ReportOptions options;
  options.thumbnails.max_count = 0;
  const std::size_t bare = ReportPage(run, options).size();
  options.thumbnails.max_count = 15;
  const Thumbnails thumbnails = MakeThumbnails(run, "", options.thumbnails);
  ASSERT_EQ(thumbnails.frames.size(), 15u);
  EXPECT_EQ(thumbnails.frames[3], 6);
  EXPECT_EQ(cv::imdecode(cv::Mat(1,
                                 static_cast<int>(thumbnails.jpegs[0].size()),
                                 CV_8U,
                                 const_cast<char*>(thumbnails.jpegs[0].data())),
                         cv::IMREAD_COLOR)
                .size(),
            cv::Size(240, 180));
  const std::size_t full = ReportPage(run, options).size();
  ASSERT_GT(full, bare + 100'000);
  options.max_bytes = bare + (full - bare) / 3;
  const std::string page = ReportPage(run, options);
  EXPECT_LE(page.size(), options.max_bytes);
  EXPECT_GT(page.size(), bare + (full - bare) / 10);
}

TEST_F(Report, ComparesWithTheTruthAsEvalDoes) {
  AddPositions();
  // Another world, another scale, no truth for some frames, and one frame a degree off.
  Trajectory truth;
  const Rotation other = Rotation::Exp({0.3, -0.4, 1.0});
  for (int n = 0; n < kNumFrames; ++n) {
    if (n == 11) continue;
    StampedPose pose = PoseAt(n);
    pose.center_in_world = other * (2.0 * pose.center_in_world) + Eigen::Vector3d(5.0, 0.0, 1.0);
    pose.world_from_cam = other * pose.world_from_cam;
    if (n == 20) {
      pose.world_from_cam = pose.world_from_cam * Rotation::Exp({0.0, 0.0, -kRadFromDeg});
    }
    truth.push_back(pose);
  }
  const fs::path file = Run() / "truth.txt";
  WriteTumTrajectory(file, truth);
  RunData run = ReadRunData(Run());
  const MetricsOptions options;
  AddTruth({file.string(), ""}, options, run);
  ASSERT_TRUE(run.truth && run.truth->trajectory);
  const TrajectoryMetrics expected = ComputeMetrics(
      AssociatePoses(ReadTrajectory(file), ReadTrajectory(Run() / "trajectory_tum.txt"), options),
      options);
  EXPECT_EQ(run.truth->trajectory->rpe1_deg, expected.rpe1_deg);
  EXPECT_EQ(run.truth->trajectory->ate_m, expected.ate_m);
  const Json data = PageData(run, {}, {});
  EXPECT_EQ(data["truth"]["trajectory"]["rpen"], expected.rpen_deg);
  const auto frames = Values<std::int32_t>(data["truth"]["frame"]);
  const auto error = Values<float>(data["truth"]["error_deg"]);
  const auto position = Values<float>(data["truth"]["position"]);
  // The one that is off turns the best fit by a 29th of that.
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_NEAR(error[3 * k], frames[k] == 20 ? 1.0 : 0.0, 0.04) << frames[k];
    EXPECT_NEAR(error[3 * k + 1], 0.0, 0.04);
    EXPECT_NEAR(position[3 * k], 0.5 * frames[k], 1e-4);
  }
  EXPECT_THROW(AddTruth({(Run() / "nowhere").string(), ""}, options, run), std::runtime_error);
}

TEST_F(Report, SaysWhatIsMissing) {
  fs::remove(Run() / "summary.json");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadRunData(Run()); }), HasSubstr("summary.json"));
  WriteSummaryWith("x");
  fs::remove(Run() / "rotations.csv");
  EXPECT_THAT(RuntimeErrorOf([&] { ReadRunData(Run()); }), HasSubstr("rotations.csv"));
}

TEST(RollPitchYaw, TurnsRightUpAndClockwiseAndNeverJumps) {
  const auto angles = [](const Eigen::Vector3d& axis_angle_deg) {
    return RollPitchYawDeg({Rotation::Exp(kRadFromDeg * axis_angle_deg)})[0];
  };
  EXPECT_LT((angles({0, 0, 20}) - Eigen::Vector3d(20, 0, 0)).norm(), 1e-9);
  EXPECT_LT((angles({20, 0, 0}) - Eigen::Vector3d(0, 20, 0)).norm(), 1e-9);
  EXPECT_LT((angles({0, 20, 0}) - Eigen::Vector3d(0, 0, 20)).norm(), 1e-9);
  std::vector<Rotation> turns;
  for (int k = 0; k <= 80; ++k) turns.push_back(Rotation::Exp({0.0, 0.1 * k, 0.0}));
  EXPECT_NEAR(RollPitchYawDeg(turns).back().z(), 8.0 * kDegFromRad, 1e-9);
}

// Whether tags open and close in turn; enough to tell a broken file from a whole one. It does
// without std::regex, which recurses once a character and ends the stack in long paths.
bool IsBalanced(const std::string& xml) {
  std::vector<std::string> open;
  for (std::size_t begin = 0; (begin = xml.find('<', begin)) != std::string::npos;) {
    const std::size_t end = xml.find_first_of("<>", begin + 1);
    if (end == std::string::npos || xml[end] == '<') return false;
    const std::string tag = xml.substr(begin + 1, end - begin - 1);
    begin = end;
    if (tag.starts_with("?") || tag.ends_with("/")) continue;
    if (!tag.starts_with("/")) {
      open.push_back(tag.substr(0, tag.find(' ')));
    } else if (open.empty() || "/" + open.back() != tag) {
      return false;
    } else {
      open.pop_back();
    }
  }
  return open.empty();
}

TEST(IsBalanced, TellsBrokenFiles) {
  EXPECT_TRUE(IsBalanced("<?xml?><svg a=\"1\"><g><path d=\"M 1\"/></g></svg>"));
  EXPECT_FALSE(IsBalanced("<svg><g></svg></g>"));
  EXPECT_FALSE(IsBalanced("<svg><g>"));
  EXPECT_FALSE(IsBalanced("<svg></svg"));
  EXPECT_FALSE(IsBalanced("</svg>"));
}

TEST_F(Report, FiguresAreDrawnTwice) {
  AddPositions();
  RunData run = ReadRunData(Run());
  AddTruth({(Run() / "trajectory_tum.txt").string(), ""}, {}, run);
  const std::vector<Figure> figures = MakeFigures(run);
  std::vector<std::string> names;
  for (const Figure& figure : figures) {
    SCOPED_TRACE(figure.name);
    names.push_back(figure.name);
    const std::string svg = figure.drawing.Svg();
    EXPECT_TRUE(svg.starts_with("<?xml"));
    EXPECT_TRUE(IsBalanced(svg));
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    const std::string png = figure.drawing.Png(100.0);
    const cv::Mat image = cv::imdecode(std::vector<char>(png.begin(), png.end()), cv::IMREAD_COLOR);
    EXPECT_EQ(image.cols, 700);
    cv::Mat ink;
    cv::inRange(image, cv::Scalar(0, 0, 0), cv::Scalar(160, 160, 160), ink);
    EXPECT_GT(cv::countNonZero(ink), 300);
  }
  EXPECT_THAT(names,
              ElementsAre("trajectory",
                          "orientation",
                          "errors",
                          "runtime",
                          "relative_rotations",
                          "averaging",
                          "view_graph",
                          "motion",
                          "tracks",
                          "keyframes",
                          "registration",
                          "residuals"));
  EXPECT_THAT(figures[0].drawing.Svg(),
              testing::AllOf(HasSubstr(">forward, from above</text>"),
                             HasSubstr(">scale assumed</text>"),
                             HasSubstr(">points</text>")));
  run.cloud.reset();
  for (Segment& segment : run.segments) segment.scale = "reference";
  EXPECT_THAT(MakeFigures(run)[0].drawing.Svg(),
              testing::AllOf(testing::Not(HasSubstr(">scale assumed</text>")),
                             testing::Not(HasSubstr(">points</text>"))));
  EXPECT_THAT(figures[1].drawing.Svg(),
              testing::AllOf(HasSubstr(">roll, deg</text>"), HasSubstr(">time, s</text>")));
  EXPECT_THAT(figures[2].drawing.Svg(), HasSubstr(">position, m</text>"));
  EXPECT_THAT(figures[3].drawing.Svg(), HasSubstr(">tracking</text>"));
}

std::string SvgOf(const std::vector<Figure>& figures, const std::string& name) {
  for (const Figure& figure : figures) {
    if (figure.name == name) return figure.drawing.Svg();
  }
  return "";
}

TEST_F(Report, FiguresOfStagesFollowTheSummary) {
  AddPositions();
  RunData run = ReadRunData(Run());
  EXPECT_EQ(SvgOf(MakeFigures(run), "known_rotation"), "");
  EXPECT_EQ(SvgOf(MakeFigures(run), "rolling_shutter"), "");
  EXPECT_EQ(SvgOf(MakeFigures(run), "motion_blur"), "");
  EXPECT_EQ(SvgOf(MakeFigures(run), "averaging"), "") << "no ground truth";
  run.summary["krot"] = {{"gamma_low_px", 3.0}, {"gamma_high_px", 3.5}};
  run.summary["camera"]["readout_s"] = 0.02;
  run.summary["rotodom"] = {{"exposure_s", 0.01}};
  const std::vector<Figure> figures = MakeFigures(run);
  EXPECT_THAT(SvgOf(figures, "known_rotation"), HasSubstr(">bracket of the largest residual<"));
  EXPECT_THAT(SvgOf(figures, "rolling_shutter"), HasSubstr(">length, px</text>"));
  EXPECT_THAT(SvgOf(figures, "motion_blur"), HasSubstr(">length of the blur vector</text>"));
  EXPECT_THAT(SvgOf(figures, "view_graph"),
              testing::AllOf(HasSubstr(">loop</text>"), HasSubstr("refused</text>")));
  // 0.03 rad a frame, 300 px, 0.1 s between frames, open for a tenth of that: 0.9 px.
  EXPECT_THAT(SvgOf(figures, "motion_blur"), testing::ContainsRegex(">0\\.(8999|9000)"));
}

// A run that has refined the small camera's lens.
void WriteLens(const fs::path& run) {
  Camera camera = SmallCamera();
  camera.model = CameraModel::kRadtan;
  camera.distortion[0] = 0.1;
  WriteCameraYaml(run / "camera.yaml", camera);
  std::ifstream in(run / "summary.json");
  Json summary = Json::parse(in);
  Json& sigmas = summary["ba"]["lens"]["sigma_radius_px"];
  for (int step = 1; step <= kLensCurveSteps; ++step) sigmas[std::to_string(step)] = 0.25 * step;
  std::ofstream(run / "summary.json") << summary.dump();
}

TEST_F(Report, DrawsTheLensBesideItsCalibration) {
  EXPECT_FALSE(ReadRunData(Run()).lens);
  WriteLens(Run());
  const RunData run = ReadRunData(Run());
  ASSERT_TRUE(run.lens);
  const LensData& lens = *run.lens;
  EXPECT_FALSE(lens.is_estimated);
  ASSERT_EQ(lens.radius_px.size(), lens.displacement_px.size());
  EXPECT_DOUBLE_EQ(lens.radius_px.back(), 200.0) << "half of the diagonal";
  // f k1 tan^3 for the ray that is shown there.
  const double tangent = (lens.radius_px.back() - lens.displacement_px.back()) / 300.0;
  EXPECT_NEAR(lens.displacement_px.back(), 300.0 * 0.1 * std::pow(tangent, 3), 1e-6);
  ASSERT_EQ(lens.sigma_px.size(), lens.radius_px.size());
  EXPECT_NEAR(lens.sigma_px.back(), 2.0, 1e-9);
  EXPECT_NEAR(lens.sigma_px[lens.sigma_px.size() / 2 - 1], 1.0, 1e-9);
  ASSERT_EQ(lens.given_px.size(), lens.radius_px.size());
  for (const double displacement : lens.given_px) EXPECT_NEAR(displacement, 0.0, 1e-9);
  EXPECT_THAT(SvgOf(MakeFigures(run), "lens"),
              testing::AllOf(HasSubstr(">calibration</text>"),
                             HasSubstr(">one standard deviation</text>"),
                             testing::Not(HasSubstr("nan"))));
  EXPECT_EQ(Data().at("lens").at("sigma_px").size(), lens.sigma_px.size());
}

TEST_F(Report, DrawsALensThatNothingIsKnownOfAlone) {
  WriteCameraYaml(Run() / "camera.yaml", SmallCamera());
  const RunData run = ReadRunData(Run());
  ASSERT_TRUE(run.lens);
  EXPECT_TRUE(run.lens->sigma_px.empty());
  EXPECT_TRUE(run.lens->given_px.empty()) << "it is the calibration";
  EXPECT_THAT(SvgOf(MakeFigures(run), "lens"),
              testing::Not(HasSubstr(">one standard deviation</text>")));
}

}  // namespace
}  // namespace rotslam
