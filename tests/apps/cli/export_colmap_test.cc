// COLMAP itself takes what `rotslam export` writes, where COLMAP is installed.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "output/map/map_keypoints.h"
#include "output/map/run_map.h"
#include "tests/apps/run_directory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

class ColmapTest : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v colmap >/dev/null 2>&1") != 0) {
      GTEST_SKIP() << "colmap is not installed";
    }
  }

  static fs::path Kitti() { return fs::path(ROTSLAM_SHARED_DIR) / "data/kitti00"; }

  fs::path Path(const std::string& name) const { return folder_.path() / name; }

  // Runs and exports; everything lies in the test's folder.
  void Prepare(const fs::path& sequence) const {
    ASSERT_EQ(
        Rotslam({"run", sequence.string(), "--quiet", "--out", Path("run").string()}).exit_code, 0);
    for (const auto& [format, name] :
         {std::pair("colmap", "model"), std::pair("colmap-db", "database.db")}) {
      const CommandResult result = Rotslam({"export",
                                            Path("run").string(),
                                            "--to",
                                            format,
                                            "--with-unplaced",
                                            "--out",
                                            Path(name).string()});
      ASSERT_EQ(result.exit_code, 0) << result.error;
    }
  }

  // What a COLMAP command prints; it must succeed.
  std::string Colmap(const std::vector<std::string>& arguments) const {
    std::string command = "QT_QPA_PLATFORM=offscreen colmap";
    for (const std::string& argument : arguments) command += " " + Quoted(argument);
    command += " >" + Quoted(Path("log").string()) + " 2>&1";
    const int status = std::system(command.c_str());
    std::string log = ReadWholeFile(Path("log"));
    EXPECT_EQ(status, 0) << command << "\n" << log;
    return log;
  }

  // The number behind "name: " or "name : "; NaN when there is none.
  static double NumberBehind(const std::string& log, const std::string& name) {
    std::smatch match;
    const std::regex pattern("(?:^|\n) *" + name + " *: *([-+0-9.e]+)");
    return std::regex_search(log, match, pattern) ? std::stod(match[1]) : std::nan("");
  }

  struct Analysis {
    double images = 0.0;
    double points = 0.0;
    double mean_error_px = 0.0;
  };
  Analysis Analyse(const fs::path& model) const {
    const std::string log = Colmap({"model_analyzer", "--path", model.string()});
    return {NumberBehind(log, "Registered images"),
            NumberBehind(log, "Points"),
            NumberBehind(log, "Mean reprojection error")};
  }

  // The whole exchange, on a sequence and its images.
  void ExpectColmapAgrees(const fs::path& sequence, const fs::path& images) const;

  const TemporaryFolder folder_;
};

void ColmapTest::ExpectColmapAgrees(const fs::path& sequence, const fs::path& images) const {
  ASSERT_NO_FATAL_FAILURE(Prepare(sequence));
  const RunMap whole = ReadRunMap(Path("run") / "map.bin");
  const RunMap map = PartOf(whole, KeyframesOf(whole));
  int num_points = 0;
  int num_sightings = 0;
  double error_sum_px = 0.0;
  double square_sum = 0.0;
  const Reconstruction reconstruction = ToReconstruction(map);
  for (const MapTrack& track : map.tracks) {
    if (!HasPoint(track)) continue;
    ++num_points;
    error_sum_px += MeanErrorPx(map, track);
  }
  for (const Track& track : reconstruction.tracks) {
    for (const Observation& seen : track.observations) {
      const Eigen::Vector3d ray = reconstruction.point_in_world.at(track.id) -
                                  reconstruction.center_in_world.at(seen.frame);
      const auto pixel = map.camera.Project(reconstruction.cam_from_world.at(seen.frame) * ray);
      ASSERT_TRUE(pixel.has_value());
      square_sum += (*pixel - seen.keypoint_px).squaredNorm();
      ++num_sightings;
    }
  }

  const Analysis ours = Analyse(Path("model"));
  EXPECT_EQ(ours.images, map.frames.size());
  EXPECT_EQ(ours.points, num_points);
  EXPECT_NEAR(ours.mean_error_px, error_sum_px / num_points, 0.01 * ours.mean_error_px);

  // COLMAP measures the errors itself: root of half the squares per coordinate. Started from ours,
  // it finds next to nothing to gain, though it has no robust loss and refines the lens as well.
  fs::create_directories(Path("adjusted"));
  const std::string adjustment = Colmap({"bundle_adjuster",
                                         "--input_path",
                                         Path("model").string(),
                                         "--output_path",
                                         Path("adjusted").string()});
  const double before_px = NumberBehind(adjustment, "Initial cost");
  const double after_px = NumberBehind(adjustment, "Final cost");
  EXPECT_NEAR(before_px, std::sqrt(0.5 * square_sum / (2.0 * num_sightings)), 1e-3 * before_px);
  EXPECT_GT(after_px * after_px, 0.98 * before_px * before_px);

  fs::create_directories(Path("triangulated"));
  Colmap({"point_triangulator",
          "--database_path",
          Path("database.db").string(),
          "--image_path",
          images.string(),
          "--input_path",
          Path("model").string(),
          "--output_path",
          Path("triangulated").string()});
  const Analysis triangulated = Analyse(Path("triangulated"));
  EXPECT_EQ(triangulated.images, map.frames.size());
  EXPECT_GT(triangulated.points, 0.95 * num_points);
  EXPECT_LT(triangulated.mean_error_px, 1.5 * ours.mean_error_px);

  fs::create_directories(Path("mapped"));
  Colmap({"mapper",
          "--database_path",
          Path("database.db").string(),
          "--image_path",
          images.string(),
          "--input_path",
          Path("model").string(),
          "--output_path",
          Path("mapped").string()});
  // The database has the frames of pure rotations, too.
  EXPECT_GE(Analyse(Path("mapped")).images, map.frames.size());
}

TEST_F(ColmapTest, TakesARunWithAPureRotationInIt) {
  const CommandResult simulated = Rotslam({"simulate",
                                           "gimbal",
                                           "--width=320",
                                           "--height=240",
                                           "--frames=60",
                                           "--quiet",
                                           "--out=" + Path("sequence").string()});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
  ExpectColmapAgrees(Path("sequence"), Path("sequence") / "rgb");
}

TEST_F(ColmapTest, TakesKitti00) {
  if (!fs::exists(Kitti())) GTEST_SKIP() << Kitti() << " is not here";
  ExpectColmapAgrees(Kitti(), Kitti() / "image_0");
}

}  // namespace
}  // namespace rotslam
