#include "output/export/known_rotation_file.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/types/text_file.h"
#include "tests/output/known_rotation_inputs.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Scene SmallScene() {
  SceneOptions options;
  options.num_views = 6;
  options.num_points = 40;
  options.noise_px = 0.5;
  return MakeScene(options);
}

// Ids of frames and tracks in `input` are higher than the scene's by these.
void ExpectIsScene(const KnownRotationInput& input,
                   const Scene& scene,
                   int frame_shift,
                   double tolerance) {
  ASSERT_EQ(input.cam_from_world.size(), scene.cam_from_world.size());
  for (const auto& [frame, rotation] : scene.cam_from_world) {
    const Rotation& read = input.cam_from_world.at(FrameId{frame.value + frame_shift});
    EXPECT_LT((read * rotation.Inverse()).Angle(), 1e-9);
  }
  ASSERT_EQ(input.tracks.size(), scene.tracks.size());
  for (std::size_t t = 0; t < scene.tracks.size(); ++t) {
    const Track& track = scene.tracks[t];
    ASSERT_EQ(input.tracks[t].observations.size(), track.observations.size());
    for (std::size_t k = 0; k < track.observations.size(); ++k) {
      const Observation& read = input.tracks[t].observations[k];
      EXPECT_EQ(read.frame.value, track.observations[k].frame.value + frame_shift);
      EXPECT_LT((read.bearing - track.observations[k].bearing).norm(), tolerance);
    }
  }
}

TEST(KnownRotationFile, ReadsBackWhatItHasWritten) {
  const TemporaryFolder folder;
  const Scene scene = SmallScene();
  KnownRotationInput input;
  input.camera = scene.camera;
  input.cam_from_world = scene.cam_from_world;
  input.tracks = scene.tracks;
  input.tracks.front().rgb = {1, 2, 255};
  input.sigma_rad[FrameId{3}] = 0.001;
  input.timestamp_s[FrameId{2}] = 12.25;
  WriteKnownRotation(folder.path() / "known_rotation.txt", input);
  for (const fs::path& path : {folder.path() / "known_rotation.txt", folder.path()}) {
    const KnownRotationInput read = ReadKnownRotation(path);
    EXPECT_EQ(read.format, "rotslam");
    EXPECT_EQ(read.camera, scene.camera);
    ExpectIsScene(read, scene, 0, 1e-6);  // of 4 digits behind the point, in pixels
    EXPECT_EQ(read.tracks.front().rgb, input.tracks.front().rgb);
    ASSERT_EQ(read.sigma_rad.size(), 1U);
    EXPECT_NEAR(read.sigma_rad.at(FrameId{3}), 0.001, 1e-8);
    EXPECT_EQ(read.timestamp_s.at(FrameId{2}), 12.25);
  }
}

TEST(KnownRotationFile, KeepsEveryModelOfACamera) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "known_rotation.txt";
  KnownRotationInput input;
  input.camera = SmallScene().camera;
  input.cam_from_world[FrameId{0}] = Rotation();
  for (const CameraModel model : AllCameraModels()) {
    input.camera.model = model;
    input.camera.distortion = {};
    for (std::size_t k = 0; k < DistortionNames(model).size(); ++k) {
      input.camera.distortion[k] = 0.01 / (1.0 + static_cast<double>(k));
    }
    WriteKnownRotation(file, input);
    EXPECT_EQ(ReadKnownRotation(file).camera, input.camera);
    const std::size_t num_words = ReadTextRows(file)[1].words.size();
    EXPECT_EQ(num_words, model == CameraModel::kRational ? 16u : 13u) << Name(model);
  }
  const auto camera_of = [&](const std::string& row) {
    folder.Write("other.txt", "rotslam_known_rotation 1\n" + row + "\nviews 0\ntracks 0\n");
    return ReadKnownRotation(folder.path() / "other.txt").camera;
  };
  // Five coefficients, as version 0.1.0 wrote them, or all eight.
  const std::string row = "camera radtan 640 480 500 500 320 240 0.1 0.2 0.3 0.4 0.5";
  EXPECT_EQ(camera_of(row), camera_of(row + " 0 0 0"));
  EXPECT_EQ(camera_of(row).distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4, 0.5}));
}

TEST(KnownRotationFile, ReadsColmapModelsTextAndBinary) {
  const TemporaryFolder folder;
  const Scene scene = SmallScene();
  WriteColmapText(folder.path() / "text", scene);
  WriteColmapBinary(folder.path() / "binary", scene);
  for (const char* name : {"text", "binary"}) {
    const KnownRotationInput read = ReadKnownRotation(folder.path() / name);
    EXPECT_EQ(read.format, "COLMAP");
    EXPECT_EQ(read.camera, scene.camera) << name;
    ExpectIsScene(read, scene, 1, 1e-12);
    EXPECT_EQ(read.tracks.front().rgb[2], 30);
  }
}

// Ids that no int holds are read, and stay as names.
TEST(KnownRotationFile, NumbersLargeIdsAnew) {
  const TemporaryFolder folder;
  const fs::path file = folder.Write(
      "large.txt",
      "rotslam_known_rotation 1\ncamera pinhole 640 480 500 500 320 240 0 0 0 0 0\nviews 2\n"
      "18446744073709551615 1 0 0 0 1 0\n3000000000 2 0 0 0 1 0.5\ntracks 2\n"
      "5000000000 0 0 0 2 3000000000 1 1 1 18446744073709551615 2 1 1\n"
      "7 0 0 0 1 3000000000 9 9 1\n");
  const KnownRotationInput read = ReadKnownRotation(file);
  EXPECT_EQ(NameOf(read, FrameId{0}), "3000000000");
  EXPECT_EQ(NameOf(read, FrameId{1}), "18446744073709551615");
  EXPECT_EQ(read.timestamp_s.at(FrameId{1}), 1.0);
  EXPECT_NEAR(read.sigma_rad.at(FrameId{0}), 0.5 * kRadFromDeg, 1e-15);
  ASSERT_EQ(read.tracks.size(), 2u);
  EXPECT_EQ(NameOf(read, read.tracks[0].id), "5000000000");
  EXPECT_EQ(NameOf(read, read.tracks[1].id), "7");
  EXPECT_EQ(read.tracks[0].observations[1].frame, FrameId{1});
}

TEST(KnownRotationFile, MergesDoublesAndSaysSo) {
  const TemporaryFolder folder;
  const std::string head =
      "rotslam_known_rotation 1\ncamera pinhole 640 480 500 500 320 240 0 0 0 0 0\nviews 2\n"
      "0 1 0 0 0 1 0\n1 2 0 0 0 1 0\ntracks 1\n4 0 0 0 3 ";
  const KnownRotationInput same =
      ReadKnownRotation(folder.Write("same.txt", head + "0 10 20 1 1 30 30 1 0 10.5 20 2\n"));
  ASSERT_EQ(same.tracks[0].observations.size(), 2u);
  EXPECT_EQ(same.tracks[0].observations[0].keypoint_px, Eigen::Vector2d(10.25, 20.0));
  EXPECT_EQ(same.tracks[0].observations[0].sigma_px, 1.0);
  ASSERT_EQ(same.notes.size(), 1u);
  EXPECT_THAT(same.notes[0], HasSubstr("first track 4 in view 0: 1 merged"));
  const KnownRotationInput apart =
      ReadKnownRotation(folder.Write("apart.txt", head + "0 10 20 1 1 30 30 1 0 15 20 1\n"));
  EXPECT_EQ(apart.tracks[0].observations.size(), 1u);
  EXPECT_THAT(apart.notes[0], HasSubstr("0 merged, 1 left out"));
}

TEST(KnownRotationFile, NumbersViewsInOrder) {
  const TemporaryFolder folder;
  const KnownRotationInput read = ReadKnownRotation(folder.Write(
      "gaps.txt",
      "rotslam_known_rotation 1\ncamera pinhole 640 480 500 500 320 240 0 0 0 0 0\nviews 2\n"
      "10 1 0 0 0 1 0.1\n30 2 0 0 0 1 0\ntracks 1\n4 0 0 0 2 10 1 1 1 30 2 2 1\n"));
  const KnownRotationInput ordered = WithViewsInOrder(read);
  EXPECT_EQ(NameOf(ordered, FrameId{1}), "30");
  EXPECT_EQ(ordered.timestamp_s.at(FrameId{1}), 2.0);
  EXPECT_EQ(ordered.sigma_rad.size(), 1u);
  EXPECT_TRUE(ordered.sigma_rad.contains(FrameId{0}));
  EXPECT_EQ(ordered.tracks[0].observations[1].frame, FrameId{1});
}

// Each image through its own lens, into one camera of all; what is written again is the same.
TEST(KnownRotationFile, ReadsAndWritesModelsOfSeveralCameras) {
  const TemporaryFolder folder;
  const std::string cameras =
      "1 PINHOLE 640 480 500 500 320.5 240.5\n9 SIMPLE_RADIAL 800 600 700 400.5 300.5 -0.05\n";
  const fs::path in = folder.path() / "in";
  fs::create_directories(in);
  std::ofstream(in / "cameras.txt") << cameras;
  std::ofstream(in / "images.txt") << "3 1 0 0 0 0 0 0 9 a.png\n10.5 20.5 -1 100.5 200.5 70\n"
                                      "8 1 0 0 0 -1 0 0 1 b.png\n300.5 100.5 70\n";
  std::ofstream(in / "points3D.txt") << "70 1 2 3 10 20 30 0.5 3 1 8 0\n";
  const KnownRotationInput read = ReadKnownRotation(in);
  EXPECT_THAT(read.notes, testing::ElementsAre(HasSubstr("2 cameras")));
  EXPECT_EQ(read.camera.fx, 700.0);
  ASSERT_EQ(read.tracks.size(), 1u);
  EXPECT_EQ(NameOf(read, read.tracks[0].id), "70");
  const Observation& first = read.tracks[0].observations[0];
  EXPECT_NEAR(first.sigma_px, 1.021, 1e-3);  // the lens shows less there than a pinhole
  EXPECT_NEAR(read.tracks[0].observations[1].sigma_px, 700.0 / 500.0, 1e-12);
  EXPECT_LT((first.bearing - *read.colmap->cameras.at(9).Unproject({100.0, 200.0})).norm(), 1e-12);
  EXPECT_LT((*read.camera.Project(first.bearing) - first.keypoint_px).norm(), 1e-9);
  for (const ColmapForm form : {ColmapForm::kText, ColmapForm::kBinary}) {
    const fs::path out = folder.path() / "out";
    WriteColmapModel(out, *read.colmap, read.colmap->reconstruction, form);
    const ColmapModel again = ReadColmapModel(out);
    EXPECT_EQ(again.cameras, read.colmap->cameras);
    EXPECT_EQ(again.image_name, read.colmap->image_name);
    EXPECT_EQ(again.point_id, read.colmap->point_id);
    EXPECT_EQ(again.keypoints, read.colmap->keypoints);
    EXPECT_EQ(again.images.at(FrameId{3}).camera, 9);
    EXPECT_EQ(again.images.at(FrameId{3}).keypoints_px,
              read.colmap->images.at(FrameId{3}).keypoints_px);
    EXPECT_EQ(again.reconstruction.point_in_world, read.colmap->reconstruction.point_in_world);
    EXPECT_EQ(again.reconstruction.tracks[0].rgb, read.colmap->reconstruction.tracks[0].rgb);
  }
  EXPECT_THAT(ReadWholeFile(folder.path() / "out" / "images.bin").substr(0, 1), testing::Eq("\2"));
}

// COLMAP's mean error counts each point once, however often it is seen.
TEST(KnownRotationFile, TheMeanErrorOfAModelIsOverItsPoints) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "cameras.txt") << "1 PINHOLE 640 480 500 500 320 240\n";
  std::ofstream(folder.path() / "images.txt") << "1 1 0 0 0 0 0 0 1 a.png\n320 243 5 420 240 6\n"
                                                 "2 1 0 0 0 0 0 0 1 b.png\n320 243 5\n"
                                                 "3 1 0 0 0 0 0 0 1 c.png\n320 240 5 420 241 6\n"
                                                 "4 1 0 0 0 0 0 0 1 d.png\n320 240 5\n";
  std::ofstream(folder.path() / "points3D.txt")
      << "5 0 0 5 1 1 1 1.5 1 0 2 0 3 0 4 0\n6 1 0 5 1 1 1 0.5 1 1 3 1\n";
  const ColmapModel model = ReadColmapModel(folder.path());
  const ColmapFigures figures = FiguresOf(model, model.reconstruction);
  EXPECT_EQ(figures.num_observations, 6);
  EXPECT_EQ(figures.num_seen, 2);
  EXPECT_NEAR(figures.mean_error_px, 0.5 * (1.5 + 0.5), 1e-12);  // over observations: 7 / 6
}

TEST(KnownRotationFile, ReadsBal) {
  const TemporaryFolder folder;
  const Scene scene = SmallScene();
  WriteBal(folder.path() / "problem.txt", scene);
  const KnownRotationInput read = ReadKnownRotation(folder.path() / "problem.txt");
  EXPECT_EQ(read.format, "BAL");
  EXPECT_EQ(read.camera.fx, scene.camera.fx);
  ExpectIsScene(read, scene, 0, 1e-9);
}

// The message of reading `path`; "read" when nothing was wrong.
std::string Complaint(const fs::path& path) {
  try {
    ReadKnownRotation(path);
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    EXPECT_THAT(error.what(), HasSubstr(path.filename().string()));
    return error.what();
  }
  return "read";
}

TEST(KnownRotationFile, SaysWhatIsWrongWithOurs) {
  const TemporaryFolder folder;
  const std::string camera = "camera pinhole 640 480 500 500 320 240 0 0 0 0 0\n";
  const std::string head = "rotslam_known_rotation 1\n" + camera;
  const std::string views = "views 2\n0 0 0 0 0 1 0\n1 1 0 0 0 1 0.1\n";
  struct Case {
    std::string text;
    std::string complaint;
  };
  for (const Case& broken : std::vector<Case>{
           {"", "is empty"},
           {"hello\n", "neither our text"},
           {"rotslam_known_rotation 2\n", ":1: the version is not 1"},
           {"rotslam_known_rotation 1\ncamera fisheye",
            "model is \"fisheye\", must be one of pinhole, radtan, equidistant, rational, fov"},
           {"rotslam_known_rotation 1\ncamera radtan 64 48 50 50 32 24 1 0 0 0 0 0 7 0\n",
            "number 7 is not zero"},
           {"rotslam_known_rotation 1\ncamera radtan 64 48 50 50 32 24 1 0 0 0 0 0 0 0 5\n",
            ":2: the line goes on behind the distortion"},
           {"rotslam_known_rotation 1\ncamera rational 64 48 50 50 32 24 1 0 0 0 0\n",
            ":2: the line ends too early"},
           {"rotslam_known_rotation 1\ncamera pinhole 640 480 0 500 320 240 0 0 0 0 0\n",
            "fx is 0"},
           {head + "views 4000000000\n", "must be a whole number"},
           {head + "views 2000000000\n", "says 2000000000 views, but the file has only 0 lines"},
           {head + "views 1\n0 0 0 0 0 2 0\n", "not of length 1"},
           {head + "views 1\n0 0 0 0 nan 1 0\n", "expected a finite number, found \"nan\""},
           {head + "views 2\n0 0 0 0 0 1 0\n0 1 0 0 0 1 0\n", ":5: view 0 is there twice"},
           {head + views, "the file ends too early"},
           {head + views + "tracks 2\n0 0 0 0 0\n", "says 2 tracks"},
           {head + views + "tracks 1\n0 0 0 0 3 0 1 1 1\n", "says 3 observations"},
           {head + views + "tracks 1\n0 0 0 0 1 7 1 1 1\n", "view 7 is not among the views"},
           {head + views + "tracks 1\n0 0 0 300 1 0 1 1 1\n", "colour is above 255"},
           {head + views + "tracks 1\n0 0 0 0 1 0 1 1 0\n", "sigma_px must be positive"},
           {head + views + "tracks 2\n0 0 0 0 0\n0 0 0 0 0\n", ":8: track 0 is there twice"},
           {head + views + "tracks 1\n0 0 0 0 1 0 1 1 1\n0 0 0 0 0\n", "more lines than"}}) {
    std::ofstream(folder.path() / "broken.txt") << broken.text;
    EXPECT_THAT(Complaint(folder.path() / "broken.txt"), HasSubstr(broken.complaint))
        << broken.text;
  }
  EXPECT_THAT(Complaint(folder.path() / "missing.txt"), HasSubstr("No such file"));
  fs::create_directories(folder.path() / "empty");
  EXPECT_THAT(Complaint(folder.path() / "empty"), HasSubstr("neither known_rotation.txt"));
}

TEST(KnownRotationFile, SaysWhatIsWrongWithBal) {
  const TemporaryFolder folder;
  for (const auto& [text, complaint] : std::vector<std::pair<std::string, std::string>>{
           {"2 1 1000000\n0 0 1 1\n", "says 1000000 observations"},
           {"1 1 1\n0 5 1 1\n", "beyond the number"},
           {"1 1 1\n0 0 1 1\n0 0 0\n0 0 0\n500 0\n", "the file ends too early"},
           {"1 1 1\n0 0 1 1\n0 0 0\n0 0 0\n-500 0 0\n", "fx is -500"},
           {"0 1 1\n0 0 1 1\n", "must be a whole number from 1 on"}}) {
    std::ofstream(folder.path() / "bal.txt") << text;
    EXPECT_THAT(Complaint(folder.path() / "bal.txt"), HasSubstr(complaint)) << text;
  }
}

TEST(KnownRotationFile, SaysWhatIsWrongWithColmapModels) {
  const TemporaryFolder folder;
  const Scene scene = SmallScene();
  const fs::path text = folder.path() / "text";
  const auto text_with = [&](const char* file, const std::string& content) {
    WriteColmapText(text, scene);
    std::ofstream(text / file) << content;
    try {
      ReadKnownRotation(text);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("read");
  };
  EXPECT_THAT(text_with("cameras.txt", ""), HasSubstr("has no camera"));
  EXPECT_THAT(text_with("cameras.txt", "1 MAGIC 10 10 1\n"), HasSubstr("model is 'MAGIC'"));
  EXPECT_THAT(text_with("cameras.txt", "1 PINHOLE 10 10 5 5 5 5\n1 PINHOLE 10 10 6 5 5 5\n"),
              HasSubstr("camera 1 is there twice"));
  EXPECT_THAT(text_with("cameras.txt", "2 PINHOLE 10 10 5 5 5 5\n"),
              HasSubstr("image 1 names camera 1, which there is not"));
  EXPECT_THAT(text_with("images.txt", "1 1 0 0 0 0 0 nan 1 a.png\n\n"), HasSubstr("\"nan\""));
  EXPECT_THAT(text_with("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n1 2\n"),
              HasSubstr("groups of x y"));
  EXPECT_THAT(text_with("images.txt", "1 1 0 0 0 0 0 0 1 a\n\n1 1 0 0 0 0 0 0 1 a\n\n"),
              HasSubstr("image 1 is there twice"));
  EXPECT_THAT(text_with("points3D.txt", "1 0 0 0 1 2 3 0 99 0\n"), HasSubstr("image 99"));
  EXPECT_THAT(text_with("points3D.txt", "1 0 0 0 1 2 3 0 1 9999\n"), HasSubstr("keypoint 9999"));
  EXPECT_THAT(text_with("points3D.txt", "1 0 0 0 1 2 3 0\n1 0 0 0 1 2 3 0\n"),
              HasSubstr("point 1 is there twice"));

  for (const char* name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    WriteColmapText(text, scene);
    fs::remove(text / name);
    EXPECT_THAT(
        RuntimeErrorOf([&] { ReadKnownRotation(text); }),
        HasSubstr(std::string(name) == "images.txt" ? "neither known_rotation.txt"
                                                    : std::string(name) + ": No such file"));
  }

  // A binary model cut anywhere is refused, and never believed about its counts.
  const fs::path binary = folder.path() / "binary";
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    WriteColmapBinary(binary, scene);
    const auto size = fs::file_size(binary / name);
    for (const std::uintmax_t kept : {std::uintmax_t{0}, std::uintmax_t{7}, size / 2, size - 1}) {
      WriteColmapBinary(binary, scene);
      fs::resize_file(binary / name, kept);
      EXPECT_THROW(ReadKnownRotation(binary), std::runtime_error) << name << " " << kept;
    }
    WriteColmapBinary(binary, scene);
    std::fstream file(binary / name, std::ios::binary | std::ios::in | std::ios::out);
    const std::uint64_t huge = ~std::uint64_t{0};
    file.write(reinterpret_cast<const char*>(&huge), sizeof(huge));
    file.close();
    EXPECT_THROW(ReadKnownRotation(binary), std::runtime_error) << name;
  }
  // Numbers in the middle of it likewise: the model of the camera, a pose, a point, a name twice.
  const auto binary_with = [&](const char* name, std::streamoff at, auto value) {
    WriteColmapBinary(binary, scene);
    std::fstream file(binary / name, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(at);
    file.write(reinterpret_cast<const char*>(&value), sizeof(value));
    file.close();
    return RuntimeErrorOf([&] { ReadKnownRotation(binary); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(binary_with("cameras.bin", 12, std::int32_t{99}), HasSubstr("its model, number 99"));
  EXPECT_THAT(binary_with("cameras.bin", 32, nan), HasSubstr("cameras.bin"));
  EXPECT_THAT(binary_with("images.bin", 12, nan), HasSubstr("image 1: its pose is not finite"));
  EXPECT_THAT(binary_with("images.bin", 12, 3.0), HasSubstr("quaternion is not of length 1"));
  EXPECT_THAT(binary_with("points3D.bin", 16, nan), HasSubstr("point 1 is not finite"));
  EXPECT_THAT(binary_with("points3D.bin", 59, std::uint32_t{77}), HasSubstr("names image 77"));
}

}  // namespace
}  // namespace rotslam
