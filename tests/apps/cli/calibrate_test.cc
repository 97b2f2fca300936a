// `rotslam calibrate` on rendered checkerboards, and runs that have no calibration.

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "rotodom/camera/read_camera.h"
#include "tests/apps/run_directory.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::StartsWith;

constexpr double kSquare = 0.03;

Camera TrueCamera() {
  Camera camera;
  camera.model = CameraModel::kRadtan;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 560.0;
  camera.fy = 556.0;
  camera.cx = 325.5;
  camera.cy = 236.0;
  camera.distortion = {-0.21, 0.07, 0.0008, -0.0006, 0.0};
  return camera;
}

struct BoardPose {
  Eigen::Matrix3d cam_from_board;
  Eigen::Vector3d board_in_cam;  // its middle
};

// Boards in a grid over the image, tilted by up to 35 deg to all sides.
std::vector<BoardPose> Poses(double spread) {
  std::vector<BoardPose> poses;
  for (int k = 0; k < 12; ++k) {
    const double angle = 2.0 * M_PI * k / 12.0;
    const double tilt = 0.6 * (k % 3 == 0 ? 0.4 : 1.0);
    const Eigen::Vector3d axis(std::cos(2.4 * k), std::sin(2.4 * k), 0.0);
    poses.push_back({(Eigen::AngleAxisd(tilt, axis) *
                      Eigen::AngleAxisd(0.2 * std::sin(1.7 * k), Eigen::Vector3d::UnitZ()))
                         .toRotationMatrix(),
                     {spread * 0.145 * std::cos(angle),
                      spread * 0.10 * std::sin(angle),
                      0.52 + 0.04 * (k % 4)}});
  }
  return poses;
}

// Rendered through the camera's own model, several rays per pixel, with a grey background.
class BoardRenderer {
 public:
  explicit BoardRenderer(const Camera& camera) : camera_(camera) {
    rays_.reserve(static_cast<std::size_t>(camera.width) * camera.height * kRays * kRays);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        for (int k = 0; k < kRays * kRays; ++k) {
          const Eigen::Vector2d pixel(x + (k % kRays + 0.5) / kRays - 0.5,
                                      y + (k / kRays + 0.5) / kRays - 0.5);
          rays_.push_back(camera.Unproject(pixel).value_or(-Eigen::Vector3d::UnitZ()));
        }
      }
    }
  }

  // A board of 10 x 7 squares, 9 x 6 inner corners, on white paper.
  cv::Mat Render(const BoardPose& pose) const {
    cv::Mat image(camera_.height, camera_.width, CV_8UC1);
    const Eigen::Matrix3d board_from_cam = pose.cam_from_board.transpose();
    const Eigen::Vector3d cam_in_board = -(board_from_cam * pose.board_in_cam);
    std::size_t ray = 0;
    for (int y = 0; y < camera_.height; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        double sum = 0.0;
        for (int k = 0; k < kRays * kRays; ++k) {
          sum += Grey(cam_in_board, board_from_cam * rays_[ray++]);
        }
        image.at<std::uint8_t>(y, x) =
            static_cast<std::uint8_t>(std::lround(sum / (kRays * kRays)));
      }
    }
    return image;
  }

 private:
  static constexpr int kRays = 3;

  static double Grey(const Eigen::Vector3d& cam_in_board, const Eigen::Vector3d& ray) {
    constexpr double kBackground = 110.0;
    if (ray.z() == 0.0) return kBackground;
    const double depth = -cam_in_board.z() / ray.z();
    if (depth <= 0.0) return kBackground;
    const Eigen::Vector3d point = cam_in_board + depth * ray;
    const double column = point.x() / kSquare + 5.0;
    const double row = point.y() / kSquare + 3.5;
    if (column < -1.0 || column > 11.0 || row < -1.0 || row > 8.0) return kBackground;
    if (column < 0.0 || column > 10.0 || row < 0.0 || row > 7.0) return 235.0;
    const int parity = static_cast<int>(column) + static_cast<int>(row);
    return parity % 2 == 0 ? 25.0 : 235.0;
  }

  Camera camera_;
  std::vector<Eigen::Vector3d> rays_;
};

class Calibrate : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    images_ = new std::vector<cv::Mat>;
    const BoardRenderer renderer(TrueCamera());
    for (const BoardPose& pose : Poses(1.0)) images_->push_back(renderer.Render(pose));
    for (const BoardPose& pose : Poses(0.1)) images_->push_back(renderer.Render(pose));
  }
  static void TearDownTestSuite() {
    delete images_;
    images_ = nullptr;
  }

  // All over the image, and in its middle only.
  static std::vector<cv::Mat> Spread() { return {images_->begin(), images_->begin() + 12}; }
  static std::vector<cv::Mat> Central() { return {images_->begin() + 12, images_->end()}; }

  std::string Write(const std::vector<cv::Mat>& images) const {
    fs::create_directories(folder_.path() / "images");
    for (std::size_t k = 0; k < images.size(); ++k) {
      const std::string file = folder_.path() / "images" / (std::to_string(k) + ".png");
      EXPECT_TRUE(cv::imwrite(file, images[k]));
    }
    return folder_.path() / "images";
  }

  CommandResult Run(const std::string& images, const std::vector<std::string>& more = {}) const {
    return Rotslam({"calibrate",
                    images,
                    "--checkerboard=9x6",
                    "--square=" + std::to_string(kSquare),
                    "--out=" + Out().string()},
                   more);
  }
  fs::path Out() const { return folder_.path() / "camera.yaml"; }

  void ExpectTruth(double focal_share, double center_px) const {
    const Camera truth = TrueCamera();
    const Camera camera = ReadCamera(Out());
    EXPECT_EQ(camera.width, truth.width);
    EXPECT_EQ(camera.height, truth.height);
    EXPECT_NEAR(camera.fx, truth.fx, focal_share * truth.fx);
    EXPECT_NEAR(camera.fy, truth.fy, focal_share * truth.fy);
    EXPECT_NEAR(camera.cx, truth.cx, center_px);
    EXPECT_NEAR(camera.cy, truth.cy, center_px);
    // The lens as a whole, where boards have been.
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(120.0, 100.0), {520.0, 380.0}}) {
      const auto expected = truth.Unproject(pixel);
      const auto found = camera.Unproject(pixel);
      ASSERT_TRUE(expected && found);
      EXPECT_LT(std::acos(std::min(1.0, expected->dot(*found))) * truth.fx, 3.0 * center_px);
    }
  }

  const TemporaryFolder folder_;

 private:
  static inline std::vector<cv::Mat>* images_ = nullptr;
};

TEST_F(Calibrate, FindsTheCameraThatRendered) {
  const CommandResult result = Run(Write(Spread()));
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(result.output, "");
  ExpectTruth(0.005, 1.5);
  EXPECT_THAT(ReadWholeFile(Out()),
              ContainsRegex("^# 9x6 checkerboard: (9|1[0-2]) of 12 images used, reprojection error "
                            "0\\.[01][0-9]+ px"));
  EXPECT_THAT(Lines(result.error), Contains(HasSubstr("of 12 images used, reprojection error 0.")));
  EXPECT_THAT(Lines(result.error), testing::Each(testing::Not(HasSubstr("warning"))));
}

TEST_F(Calibrate, TakesAVideo) {
  const std::string video = folder_.path() / "board.avi";
  {
    cv::VideoWriter writer(
        video, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 5.0, cv::Size(640, 480), false);
    if (!writer.isOpened()) GTEST_SKIP() << "OpenCV here writes no MJPG video";
    for (const cv::Mat& image : Spread()) writer.write(image);
  }
  const CommandResult result = Run(video);
  EXPECT_EQ(result.exit_code, 0) << result.error;
  ExpectTruth(0.005, 3.0);  // the video is compressed
}

TEST_F(Calibrate, RefusesTooFewBoards) {
  std::vector<cv::Mat> images = Spread();
  images.resize(4);
  images.insert(images.end(), 3, cv::Mat(480, 640, CV_8UC1, cv::Scalar::all(120)));
  const CommandResult result = Run(Write(images), {"--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(Lines(result.error),
              testing::ElementsAre(AllOf(StartsWith("rotslam: "),
                                         ContainsRegex("in only [1-4] of 7 images, at least 5"))));
  EXPECT_FALSE(fs::exists(Out()));
  EXPECT_THAT(Rotslam({"calibrate", "x", "--checkerboard=9", "--out=y"}).error,
              HasSubstr("COLUMNSxROWS"));
}

TEST_F(Calibrate, WarnsWhereBoardsCoverLittle) {
  const CommandResult result = Run(Write(Central()), {"--quiet"});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(Lines(result.error), Contains(ContainsRegex("boards cover only [1-4][0-9] %")));
}

// ---- no calibration

class NoCalibration : public SmallSequenceTest {
 protected:
  // The images alone, as JPEG files with or without EXIF data.
  std::string Photos(std::optional<int> film_mm) const {
    fs::create_directories(folder_.path() / "photos");
    for (const fs::path& image : Images(Good())) {
      std::vector<unsigned char> bytes;
      EXPECT_TRUE(cv::imencode(".jpg",
                               cv::imread(image.string(), cv::IMREAD_UNCHANGED),
                               bytes,
                               {cv::IMWRITE_JPEG_QUALITY, 95}));
      std::string file(bytes.begin(), bytes.end());
      if (film_mm) file.insert(2, ExifSegment(*film_mm));
      const fs::path path = folder_.path() / "photos" / image.stem().concat(".jpg");
      std::ofstream(path, std::ios::binary) << file;
    }
    return folder_.path() / "photos";
  }

  // A JPEG APP1 segment: TIFF, whose first directory points to an EXIF one with the focal length
  // on 35 mm film.
  static std::string ExifSegment(int film_mm) {
    const auto entry = [](const std::string& tag, const std::string& type, char value) {
      return tag + type + std::string("\1\0\0\0", 4) + std::string(1, value) +
             std::string("\0\0\0", 3);
    };
    const std::string next("\0\0\0\0", 4);
    const std::string one("\1\0", 2);
    const std::string tiff =
        std::string("II*\0\10\0\0\0", 8) + one + entry("\x69\x87", std::string("\4\0", 2), 26) +
        next + one + entry("\x05\xa4", std::string("\3\0", 2), static_cast<char>(film_mm)) + next;
    const std::string content = std::string("Exif\0\0", 6) + tiff;
    const int length = static_cast<int>(content.size()) + 2;
    return std::string("\xff\xe1") + static_cast<char>(length / 256) +
           static_cast<char>(length % 256) + content;
  }

  CommandResult Do(const std::string& command, const std::string& images) const {
    return Rotslam({command, images, "--quiet", "--out=" + Out().string()});
  }
};

TEST_F(NoCalibration, StartsFromTheFocalLengthOfExif) {
  // 28 mm on film are 259 px here; the rendered camera has 251.
  const double truth_px = ReadCamera(Good() / "camera.yaml").fx;
  const CommandResult result = Do("run", Photos(28));
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(Lines(result.error), Contains(StartsWith("rotslam: warning: no calibration")));
  const nlohmann::ordered_json calibration = ReadSummary(Out())["calibration"];
  EXPECT_EQ(calibration["start"], "exif");
  EXPECT_NEAR(calibration["start_px"].get<double>(), 28.0 / std::hypot(36.0, 24.0) * 400.0, 1e-9);
  EXPECT_NEAR(calibration["refined_px"].get<double>(), truth_px, 0.05 * truth_px);
}

TEST_F(NoCalibration, ImagesCorrectAFocalLengthThatIsHalfAsLongAgain) {
  // 1.2 x 320 = 384 px instead of 251.
  const double truth_px = ReadCamera(Good() / "camera.yaml").fx;
  const CommandResult result = Do("run", Photos(std::nullopt));
  EXPECT_EQ(result.exit_code, 0) << result.error;
  const nlohmann::ordered_json calibration = ReadSummary(Out())["calibration"];
  EXPECT_EQ(calibration["source"], "images");
  EXPECT_EQ(calibration["start_px"], 384.0);
  EXPECT_NEAR(calibration["refined_px"].get<double>(), truth_px, 0.05 * truth_px);
  // What the estimate took is not counted with the stages.
  const nlohmann::ordered_json seconds = ReadSummary(Out())["seconds"];
  const double lens_s = seconds["lens"].get<double>();
  const double rest_s = seconds["orientations"].get<double>() + seconds["positions"].get<double>();
  EXPECT_GT(lens_s, 0.0);
  EXPECT_LE(lens_s + rest_s, seconds["total"].get<double>());
  const Camera written = ReadCamera(Out() / "camera.yaml");
  EXPECT_NEAR(written.fx, truth_px, 0.05 * truth_px);
}

TEST_F(NoCalibration, RotationsUseTheLensOfTheFirstFrames) {
  const double truth_px = ReadCamera(Good() / "camera.yaml").fx;
  const CommandResult result = Do("rotations", Photos(std::nullopt));
  EXPECT_EQ(result.exit_code, 0) << result.error;
  const nlohmann::ordered_json summary = ReadSummary(Out());
  EXPECT_NEAR(summary["camera"]["fx"].get<double>(), truth_px, 0.1 * truth_px);
}

TEST_F(NoCalibration, IsAskedForWhereOneLiesWithTheImages) {
  for (const char* flag : {"--camera=none", "--focal-guess"}) {
    const CommandResult result = Rotslam(
        {"rotations", Good().string(), flag, "--quiet", "--no-report", "--out=" + Out().string()});
    EXPECT_EQ(result.exit_code, 0) << result.error;
    EXPECT_EQ(ReadSummary(Out())["calibration"]["source"], "images") << flag;
    fs::remove_all(Out());
  }
}

}  // namespace
}  // namespace rotslam
