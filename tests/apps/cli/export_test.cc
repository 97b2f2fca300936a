// `rotslam export` on what a run has left; the formats themselves are tested beside their writers.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "output/export/colmap_model.h"
#include "output/graph/g2o.h"
#include "output/map/run_map.h"
#include "output/tables/focal_lengths_csv.h"
#include "output/trajectory/trajectory.h"
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

TEST_F(ExportTest, RowsAreTheRunsOwn) {
  EXPECT_EQ(ReadWholeFile(Export("csv")), ReadWholeFile(RunFolder() / "poses.csv"));
}

// What `rotations` leaves serves all that needs no positions.
TEST_F(ExportTest, OrientationsAloneAreExportedWhereTheySuffice) {
  const fs::path run = folder_.path() / "orientations";
  const CommandResult made =
      Rotslam({"rotations", Good().string(), "--quiet", "--out=" + run.string()});
  ASSERT_EQ(made.exit_code, 0) << made.error;
  const auto exported = [&](const std::string& format) {
    const fs::path out = folder_.path() / "alone" / format;
    const CommandResult result =
        Rotslam({"export", run.string(), "--to", format, "--out", out.string()});
    EXPECT_EQ(result.exit_code, 0) << format << result.error;
    EXPECT_THAT(result.error, HasSubstr("orientations alone"));
    return out;
  };
  const Trajectory written = ReadTrajectory(run / "rotations_tum.txt");
  const Trajectory tum = ReadTrajectory(exported("tum"));
  ASSERT_EQ(tum.size(), written.size());
  for (std::size_t k = 0; k < tum.size(); ++k) {
    EXPECT_EQ(tum[k].timestamp_s, written[k].timestamp_s);
    EXPECT_LT((tum[k].world_from_cam * written[k].world_from_cam.Inverse()).Angle(), 1e-10);
  }
  EXPECT_EQ(Lines(ReadWholeFile(exported("csv"))).size(), kNumFrames + 1u);
  EXPECT_EQ(Lines(ReadWholeFile(exported("kitti"))).size(), static_cast<std::size_t>(kNumFrames));
  EXPECT_EQ(Lines(ReadWholeFile(exported("euroc"))).size(), kNumFrames + 1u);
  EXPECT_EQ(ReadG2o(exported("g2o")).graph.edges().size(),
            ReadG2o(run / "view_graph.g2o").graph.edges().size());
  for (const char* format : {"colmap", "ply", "nerf"}) {
    const CommandResult refused = Rotslam(
        {"export", run.string(), "--to", format, "--out", (folder_.path() / "no").string()});
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.error, HasSubstr("these do not: csv, euroc, g2o, kitti, tum"));
  }
}

// The run's keypoints are those of one camera; focal_lengths.csv leads to the images'.
TEST_F(ExportTest, AZoomHasACameraForEachStretch) {
  const fs::path run = folder_.path() / "zoomed";
  fs::copy(RunFolder(), run, fs::copy_options::recursive);
  const RunMap map = ReadRunMap(run / "map_all_frames.bin");
  const Camera& camera = map.camera;
  const auto scale_at = [&](FrameId frame) { return 2 * frame.value < kNumFrames ? 1.0 : 1.5; };
  std::vector<FocalLengthRow> rows;
  for (const MapFrame& frame : map.frames) {
    const double scale = scale_at(frame.id);
    rows.push_back({frame.id.value,
                    frame.timestamp_s,
                    scale * camera.fx,
                    scale * camera.fy,
                    camera.cx,
                    camera.cy});
  }
  WriteFocalLengthsCsv(run / "focal_lengths.csv", rows);

  const fs::path out = folder_.path() / "exported";
  const auto exported = [&](const std::string& format, const std::string& name) {
    return Rotslam(
        {"export", run.string(), "--all-frames", "--to", format, "--out", (out / name).string()});
  };
  ASSERT_EQ(exported("colmap", "sparse").exit_code, 0);
  const ColmapModel model = ReadColmapModel(out / "sparse");
  ASSERT_EQ(model.cameras.size(), 2U);
  for (const auto& [id, image] : model.images) {
    const FrameId frame{id.value - ColmapImageId(FrameId{0})};
    EXPECT_NEAR(model.cameras.at(image.camera).fx, scale_at(frame) * camera.fx, 1e-6);
  }
  EXPECT_LT(FiguresOf(model, model.reconstruction).mean_error_px, 1.5);
  ASSERT_EQ(exported("nerf", "transforms.json").exit_code, 0);
  EXPECT_THAT(ReadWholeFile(out / "transforms.json"), HasSubstr("fl_x"));
  const CommandResult refused = exported("stella", "map.msg");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.error, HasSubstr("one camera for all images"));
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
  const fs::path moved = folder_.path() / "moved";
  fs::copy(Good() / "rgb", moved);
  const nlohmann::json elsewhere = nlohmann::json::parse(
      ReadWholeFile(Export("openmvg", {"--images", moved.string(), "--all-frames"})));
  EXPECT_EQ(elsewhere["root_path"], moved.string());
  EXPECT_GT(fs::file_size(Export("colmap-db")), 10000u);
}

// Exports by --images, and gives the line that refuses them; "" where they are taken.
class ImagesTest : public ExportTest {
 protected:
  std::string Check(const fs::path& run, const fs::path& images) const {
    const CommandResult result = Rotslam({"export",
                                          run.string(),
                                          "--to=nerf",
                                          "--all-frames",
                                          "--quiet",
                                          "--images=" + images.string(),
                                          "--out=" + (Out() / "transforms.json").string()});
    if (result.exit_code != 0) return Refusal(result);
    fs::remove_all(Out());
    return result.error;
  }
};

TEST_F(ImagesTest, AreComparedWithWhatTheRunSaw) {
  const fs::path images = folder_.path() / "images";
  fs::copy(Good() / "rgb", images);
  EXPECT_EQ(Check(RunFolder(), images), "");
  const std::vector<fs::path> names = Images(Good());
  const auto image = [&](std::size_t k) { return images / names[k].filename(); };
  for (std::size_t k = 0; k < names.size(); ++k) {  // the files of a camera that compresses
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", cv::imread(names[k].string()), jpeg, {cv::IMWRITE_JPEG_QUALITY, 60});
    cv::imwrite(image(k).string(), cv::imdecode(jpeg, cv::IMREAD_COLOR));
  }
  EXPECT_EQ(Check(RunFolder(), images), "");
  for (std::size_t k = 12; k < names.size(); ++k) {  // one was dropped
    fs::copy_file(names[k - 1], image(k), fs::copy_options::overwrite_existing);
  }
  EXPECT_THAT(Check(RunFolder(), images), HasSubstr("is not the picture that the run read as"));
  cv::imwrite(image(3).string(), cv::Mat(240, 300, CV_8UC3, cv::Scalar(1, 2, 3)));
  EXPECT_THAT(Check(RunFolder(), images), HasSubstr("is 300x240, the run's images were 320x240"));
  fs::remove(image(2));
  EXPECT_THAT(Check(RunFolder(), images), HasSubstr("is not there, the image of frame 2"));
  EXPECT_THAT(Check(RunFolder(), folder_.path() / "nowhere"), HasSubstr("is no folder of images"));
}

TEST_F(ImagesTest, OfAnOlderRunAreNotCompared) {
  const fs::path run = folder_.path() / "old";
  fs::copy(RunFolder(), run, fs::copy_options::recursive);
  fs::remove(run / "thumbnails.bin");
  fs::remove(run / "matches.bin");
  const CommandResult result = Rotslam({"export",
                                        run.string(),
                                        "--to=colmap",
                                        "--images=" + (Good() / "rgb").string(),
                                        "--out=" + (Out() / "sparse").string()});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("has no thumbnails.bin, an older version has written it"));
  EXPECT_THAT(result.error, HasSubstr("has no matches.bin, an older version has written it"));
}

// Version 0.1.0 left fewer files and maps of format 2, which tests/output/map/run_map_test.cc
// reads.
TEST_F(ExportTest, RunsOfVersion010AreExported) {
  const fs::path run = folder_.path() / "run_of_0.1.0";
  fs::copy(RunFolder(), run, fs::copy_options::recursive);
  for (const char* newer : {"matches.bin", "thumbnails.bin", "poses.csv", "camera.yaml"}) {
    EXPECT_TRUE(fs::remove(run / newer)) << newer;
  }
  for (const char* map : {"map.bin", "map_all_frames.bin"}) {
    std::string bytes = ReadWholeFile(run / map);
    ASSERT_EQ(bytes.substr(0, 14), "rotslam_map 3\n");
    bytes.erase(14 + 3 * 4 + 9 * 8, 3 * 8);  // the last three of eight coefficients
    bytes[12] = '2';
    std::ofstream(run / map, std::ios::binary) << bytes;
  }
  for (const std::string format : {"colmap",
                                   "colmap-db",
                                   "csv",
                                   "euroc",
                                   "g2o",
                                   "kitti",
                                   "nerf",
                                   "nerfstudio",
                                   "openmvg",
                                   "ply",
                                   "stella",
                                   "tum"}) {
    const fs::path out = folder_.path() / "of_0.1.0" / format;
    const CommandResult result =
        Rotslam({"export", run.string(), "--to", format, "--out", out.string()});
    EXPECT_EQ(result.exit_code, 0) << format << ": " << result.error;
    EXPECT_TRUE(fs::exists(out)) << format;
    // Without the matches that became no tracks, and without notes on the poses.
    if (format.starts_with("colmap") || format == "csv" || !fs::is_regular_file(out)) continue;
    EXPECT_EQ(ReadWholeFile(out), ReadWholeFile(Export(format))) << format;
  }
}

TEST_F(ImagesTest, OfAVideoAreTheFramesThatWereRead) {
  const fs::path video = folder_.path() / "video.avi";
  {
    cv::VideoWriter writer(
        video.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 30.0, {320, 240});
    ASSERT_TRUE(writer.isOpened());
    for (const fs::path& image : Images(Good())) writer.write(cv::imread(image.string()));
  }
  const fs::path run = folder_.path() / "run";
  const CommandResult ran = Rotslam({"run",
                                     video.string(),
                                     "--camera=" + (Good() / "camera.yaml").string(),
                                     "--out=" + run.string(),
                                     "--no-report",
                                     "--quiet"});
  ASSERT_EQ(ran.exit_code, 0) << ran.error;
  const fs::path images = folder_.path() / "frames";
  const fs::path file = folder_.path() / "transforms.json";
  const CommandResult exported = Rotslam({"export",
                                          run.string(),
                                          "--to=nerf",
                                          "--quiet",
                                          "--extract=" + images.string(),
                                          "--out=" + file.string()});
  ASSERT_EQ(exported.exit_code, 0) << exported.error;
  EXPECT_EQ(exported.error, "");
  EXPECT_EQ(FileNames(images).size(), static_cast<std::size_t>(kNumFrames));
  const nlohmann::json transforms = nlohmann::json::parse(ReadWholeFile(file));
  for (const nlohmann::json& frame : transforms["frames"]) {
    EXPECT_TRUE(fs::exists(folder_.path() / frame["file_path"].get<std::string>()));
  }
  EXPECT_EQ(Check(run, images), "");
  const auto name = [](int number, const char* ending) {
    std::array<char, 24> text = {};
    std::snprintf(text.data(), text.size(), "%06d%s", number, ending);
    return std::string(text.data());
  };
  // JPEG files of the same numbers are as good; one more than there are frames is not.
  const fs::path jpegs = folder_.path() / "jpegs";
  fs::create_directories(jpegs);
  for (int k = 0; k < kNumFrames; ++k) {
    cv::imwrite((jpegs / name(k, ".jpg")).string(),
                cv::imread((images / name(k, ".png")).string()));
  }
  EXPECT_EQ(Check(run, jpegs), "");
  fs::copy(jpegs / name(0, ".jpg"), jpegs / name(kNumFrames, ".jpg"));
  EXPECT_THAT(Check(run, jpegs), HasSubstr("has 25 images, the run has read 24 frames"));
  fs::remove(video);
  const CommandResult gone = Rotslam({"export",
                                      run.string(),
                                      "--to=nerf",
                                      "--quiet",
                                      "--extract=" + (folder_.path() / "again").string(),
                                      "--out=" + (Out() / "transforms.json").string()});
  EXPECT_THAT(Refusal(gone), HasSubstr("video.avi"));
}

TEST_F(ExportTest, ExtractsImageFilesAsTheyAre) {
  const fs::path images = folder_.path() / "extracted";
  Export("colmap", {"--extract", images.string()});
  ASSERT_EQ(FileNames(images), FileNames(Good() / "rgb"));
  for (const std::string& name : FileNames(images)) {
    EXPECT_EQ(ReadWholeFile(images / name), ReadWholeFile(Good() / "rgb" / name));
  }
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
              HasSubstr("is not there, the image of frame 0; --extract DIR writes all images"));
}

// A copy of the run whose frames 10 to 13 nothing places, and 14 to 23 have a scale of their own.
fs::path InTwoParts(const fs::path& run, const fs::path& copy) {
  fs::copy(run, copy, fs::copy_options::recursive);
  std::ofstream(copy / "segments.csv") << "first_frame,last_frame,kind,component,scale,evidence\n"
                                          "0,9,translating,0,reference,0\n"
                                          "10,13,unplaced,0,none,0\n"
                                          "14,23,translating,1,continuity,0\n";
  return copy;
}

TEST_F(ExportTest, WritesComponentsApartAndLeavesOutWhatNothingPlaces) {
  const fs::path run = InTwoParts(RunFolder(), folder_.path() / "parts");
  const fs::path out = folder_.path() / "apart";
  const auto write = [&](const std::string& format, const std::string& name, bool all = false) {
    CommandResult result =
        Rotslam({"export",
                 run.string(),
                 "--all-frames",
                 "--to=" + format,
                 "--out=" + (out / name).string()},
                all ? std::vector<std::string>{"--with-unplaced"} : std::vector<std::string>());
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return result.error;
  };
  const auto num_images = [&](const fs::path& model) {
    return ReadColmapModel(out / model).reconstruction.cam_from_world.size();
  };
  write("colmap", "sparse", true);
  EXPECT_EQ(num_images("sparse"), static_cast<std::size_t>(kNumFrames));
  const std::string said = write("colmap", "sparse");
  EXPECT_EQ(num_images("sparse/0"), 10u);
  EXPECT_EQ(num_images("sparse/1"), 10u);
  EXPECT_FALSE(fs::exists(out / "sparse" / "images.bin"));
  EXPECT_THAT(said, HasSubstr("left out: frames 10-13, which nothing places; frames 14-23, whose"));
  EXPECT_EQ(Lines(said).size(), 2u);

  write("tum", "poses.txt");
  EXPECT_EQ(ReadTrajectory(out / "poses.txt").size(), 10u);
  EXPECT_EQ(ReadTrajectory(out / "poses_1.txt").size(), 10u);
  write("tum", "all.txt", true);
  EXPECT_EQ(ReadTrajectory(out / "all.txt").size(), static_cast<std::size_t>(kNumFrames));
  EXPECT_FALSE(fs::exists(out / "all_1.txt"));
  write("kitti", "kitti.txt");
  EXPECT_EQ(ReadTrajectory(out / "kitti.txt").size(), static_cast<std::size_t>(kNumFrames));

  write("nerf", "transforms.json");
  for (const char* name : {"transforms.json", "transforms_1.json"}) {
    EXPECT_EQ(nlohmann::json::parse(ReadWholeFile(out / name))["frames"].size(), 10u) << name;
  }
  write("g2o", "graph.g2o");
  EXPECT_EQ(ReadG2o(out / "graph_1.g2o").cam_from_world.begin()->first, FrameId{14});
}

TEST_F(ExportTest, RefusesARunThatPlacesNothing) {
  const fs::path run = InTwoParts(RunFolder(), folder_.path() / "nothing");
  std::ofstream(run / "segments.csv") << "first_frame,last_frame,kind,component,scale,evidence\n"
                                         "0,23,translating,-1,none,0\n";
  EXPECT_THAT(
      Refusal(Rotslam({"export", run.string(), "--to=tum", "--out=" + (Out() / "x").string()})),
      HasSubstr("no frame of this run has a place; --with-unplaced"));
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
