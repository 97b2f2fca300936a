// `rotslam export` on what a run has left; the formats themselves are tested beside their writers.

#include <algorithm>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "output/export/colmap_model.h"
#include "output/graph/g2o.h"
#include "output/map/run_map.h"
#include "tests/apps/run_directory.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ExportTest : public SmallSequenceTest {
 protected:
  static void SetUpTestSuite() {
    SmallSequenceTest::SetUpTestSuite();
    result_ = new TemporaryFolder;
    const CommandResult run =
        Rotslam({"run", Good().string(), "--quiet", "--out=" + RunFolder().string()});
    ASSERT_EQ(run.exit_code, 0) << run.error;
  }
  static void TearDownTestSuite() {
    delete result_;
    result_ = nullptr;
    SmallSequenceTest::TearDownTestSuite();
  }

  static fs::path RunFolder() { return result_->path() / "run"; }

  // Exports and gives where to.
  fs::path Export(const std::string& format, const std::vector<std::string>& more = {}) const {
    const fs::path out = folder_.path() / "exported" / format;
    const CommandResult result =
        Rotslam({"export", RunFolder().string(), "--to", format, "--out", out.string()}, more);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return out;
  }

 private:
  static inline const TemporaryFolder* result_ = nullptr;
};

TEST_F(ExportTest, TrajectoriesAreTheRunsOwn) {
  EXPECT_EQ(ReadWholeFile(Export("tum")), ReadWholeFile(RunFolder() / "trajectory_tum.txt"));
  EXPECT_EQ(ReadWholeFile(Export("kitti")), ReadWholeFile(RunFolder() / "trajectory_kitti.txt"));
  EXPECT_EQ(ReadWholeFile(Export("tum", {"--keyframes"})),
            ReadWholeFile(RunFolder() / "keyframes_tum.txt"));
  EXPECT_EQ(Lines(ReadWholeFile(Export("euroc"))).size(), kNumFrames + 1u);
}

TEST_F(ExportTest, CloudIsTheRunsOwn) {
  EXPECT_EQ(CountPlyPoints(Export("ply")), CountPlyPoints(RunFolder() / "cloud.ply"));
  EXPECT_THAT(ReadWholeFile(Export("ply", {"--ascii"})), HasSubstr("format ascii 1.0"));
}

TEST_F(ExportTest, PoseGraphHasTheRunsEdgesAndItsFinalPoses) {
  const PoseGraph measured = ReadG2o(RunFolder() / "view_graph.g2o");
  const PoseGraph exported = ReadG2o(Export("g2o"));
  ASSERT_EQ(exported.graph.edges().size(), measured.graph.edges().size());
  for (std::size_t k = 0; k < measured.graph.edges().size(); ++k) {
    const RelativeRotation& edge = exported.graph.edges()[k];
    EXPECT_EQ(edge.i, measured.graph.edges()[k].i);
    EXPECT_LT((edge.covariance - measured.graph.edges()[k].covariance).norm(),
              1e-6 * edge.covariance.norm());
  }
  const Trajectory poses = ReadTrajectory(RunFolder() / "trajectory_tum.txt");
  ASSERT_EQ(exported.cam_from_world.size(), poses.size());
  for (const auto& [frame, cam_from_world] : exported.cam_from_world) {
    EXPECT_LT((cam_from_world * poses[frame.value].world_from_cam).Angle(), 1e-9);
    EXPECT_LT((exported.center_in_world.at(frame) - poses[frame.value].center_in_world).norm(),
              1e-9);
  }
}

TEST_F(ExportTest, ColmapModelIsSolvedAgainLikeAnyOther) {
  const fs::path model = Export("colmap");
  const ColmapModel read = ReadColmapModel(model);
  EXPECT_EQ(read.reconstruction.cam_from_world.size(),
            ReadTrajectory(RunFolder() / "keyframes_tum.txt").size());
  for (const auto& [frame, name] : read.image_name) {
    EXPECT_TRUE(fs::exists(Good() / "rgb" / name)) << name;
  }
  EXPECT_EQ(ReadColmapModel(Export("colmap", {"--all-frames", "--text"}))
                .reconstruction.cam_from_world.size(),
            static_cast<std::size_t>(kNumFrames));
  const CommandResult solved =
      Rotslam({"solve", Export("colmap").string(), "--out", Out().string()});
  EXPECT_EQ(solved.exit_code, 0) << solved.error;
}

TEST_F(ExportTest, ImagesAreNamedFromWhereTheFileLies) {
  const fs::path file = Export("nerf", {"--all-frames"});
  const nlohmann::json json = nlohmann::json::parse(ReadWholeFile(file));
  ASSERT_EQ(json["frames"].size(), static_cast<std::size_t>(kNumFrames));
  for (const nlohmann::json& frame : json["frames"]) {
    EXPECT_TRUE(fs::exists(file.parent_path() / frame["file_path"].get<std::string>()));
  }
  const nlohmann::json elsewhere = nlohmann::json::parse(
      ReadWholeFile(Export("openmvg", {"--images", "/data/left", "--all-frames"})));
  EXPECT_EQ(elsewhere["root_path"], "/data/left");
  EXPECT_GT(fs::file_size(Export("colmap-db")), 10000u);
}

int DifferingBits(const nlohmann::json& a, const nlohmann::json& b) {
  int count = 0;
  for (std::size_t k = 0; k < 8; ++k) {
    count += std::popcount(a[k].get<std::uint32_t>() ^ b[k].get<std::uint32_t>());
  }
  return count;
}

TEST_F(ExportTest, StellasDescriptorsTellItsLandmarksApart) {
  const std::string bytes = ReadWholeFile(Export("stella"));
  const nlohmann::json map = nlohmann::json::from_msgpack(bytes.begin(), bytes.end());
  std::map<int, std::vector<const nlohmann::json*>> of_landmark;
  std::vector<int> to_another;
  std::set<int> levels;
  const nlohmann::json* before = nullptr;
  for (std::size_t k = 0; k < map["keyframes"].size(); ++k) {
    const nlohmann::json& keyframe = map["keyframes"][std::to_string(k)];
    for (std::size_t p = 0; p < keyframe["descs"].size(); ++p) {
      levels.insert(keyframe["undist_keypts"][p]["oct"].get<int>());
      const int landmark = keyframe["lm_ids"][p];
      if (landmark < 0) continue;
      const nlohmann::json& descriptor = keyframe["descs"][p];
      of_landmark[landmark].push_back(&descriptor);
      if (before != nullptr) to_another.push_back(DifferingBits(*before, descriptor));
      before = &descriptor;
    }
  }
  const auto median = [](std::vector<int>& values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
  };
  // Against the one that stands for the landmark: the closest to all others.
  std::vector<int> to_itself;
  for (const auto& [landmark, descriptors] : of_landmark) {
    std::vector<int> closest;
    for (const nlohmann::json* one : descriptors) {
      std::vector<int> bits;
      for (const nlohmann::json* other : descriptors) {
        if (other != one) bits.push_back(DifferingBits(*one, *other));
      }
      if (bits.empty()) continue;
      if (std::vector<int> sorted = bits; closest.empty() || median(sorted) < median(closest)) {
        closest = bits;
      }
    }
    to_itself.insert(to_itself.end(), closest.begin(), closest.end());
  }
  ASSERT_GT(to_itself.size(), 500u);
  EXPECT_LT(median(to_itself), 40);  // of 256; ORB-SLAM takes up to 50 for the same
  EXPECT_GT(median(to_another), 90);
  EXPECT_GT(levels.size(), 3u);

  const fs::path elsewhere = folder_.path() / "elsewhere";
  fs::create_directories(elsewhere);
  EXPECT_THAT(Refusal(Rotslam({"export",
                               RunFolder().string(),
                               "--to=stella",
                               "--images=" + elsewhere.string(),
                               "--out=" + (Out() / "map.msg").string()})),
              HasSubstr("file cannot be opened; --images names the folder"));
}

TEST_F(ExportTest, SaysWhatItCannotDo) {
  const auto refusal = [&](const std::string& run,
                           const std::string& format,
                           const std::vector<std::string>& more = {}) {
    return Refusal(Rotslam({"export", run, "--to", format, "--out", (Out() / "x").string()}, more));
  };
  EXPECT_THAT(refusal("nowhere", "colmap"), HasSubstr("nowhere: holds no map.bin"));
  EXPECT_THAT(refusal(Good().string(), "tum"), HasSubstr("holds no map_all_frames.bin"));
  EXPECT_THAT(refusal(RunFolder().string(), "magic"), HasSubstr("magic"));
  EXPECT_THAT(refusal(RunFolder().string(), "tum", {"--all-frames", "--keyframes"}),
              HasSubstr("exclude each other"));
  fs::create_directories(folder_.path() / "broken");
  folder_.Write("broken/map.bin", "no map at all, but long enough");
  EXPECT_THAT(refusal((folder_.path() / "broken").string(), "colmap"), HasSubstr("is not a map"));
}

}  // namespace
}  // namespace rotslam
