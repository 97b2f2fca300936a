// What people really hand to `rotslam run` when there is nothing to be done: one clear line.

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ContainsRegex;
using testing::Each;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

using BadInput = SmallSequenceTest;

// ---- the command line

TEST_F(BadInput, CommandLine) {
  const std::string good = Good().string();
  const std::string out = Out().string();
  const auto refusal = [&](const std::vector<std::string>& arguments) {
    SCOPED_TRACE(testing::PrintToString(arguments));
    const CommandResult result = Rotslam(arguments);
    EXPECT_EQ(result.exit_code, 2);
    return Refusal(result);
  };
  EXPECT_THAT(refusal({}), HasSubstr("see rotslam --help"));
  EXPECT_THAT(refusal({"walk"}), AllOf(HasSubstr("walk"), HasSubstr("run, rotations")));
  EXPECT_THAT(refusal({"--walk"}), HasSubstr("see rotslam --help"));
  EXPECT_THAT(refusal({"run"}), AllOf(HasSubstr("sequence"), HasSubstr("see rotslam run --help")));
  EXPECT_THAT(refusal({"run", good}), HasSubstr("--out"));
  EXPECT_THAT(refusal({"run", good, "--out", out, "--walk"}), HasSubstr("--walk"));
  EXPECT_THAT(refusal({"run", good, "--out", out, "--threads", "-1"}),
              AllOf(HasSubstr("--threads"), HasSubstr("zero or more, not -1")));
  EXPECT_THAT(refusal({"run", good, "--out", out, "--threads", "two"}),
              AllOf(HasSubstr("--threads"), HasSubstr("two")));
  EXPECT_THAT(refusal({"run", good, "--out", out, "--stride", "x"}), HasSubstr("--stride"));
  EXPECT_THAT(refusal({"rotations", good, "--out"}), HasSubstr("see rotslam rotations --help"));
  EXPECT_THAT(refusal({"simulate", "flight", "--out", out}), HasSubstr("flight"));
}

TEST_F(BadInput, HelpIsNoError) {
  const CommandResult result = Rotslam({"run", "--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.error, "");
  EXPECT_THAT(result.output, AllOf(HasSubstr("--camera"), HasSubstr("Example")));
}

TEST_F(BadInput, FramesThatAreNotThere) {
  EXPECT_THAT(Refusal(Run(Good(), {"--stride", "0"})),
              HasSubstr("stride is 0, must be at least 1"));
  EXPECT_THAT(Refusal(Run(Good(), {"--first", "-1"})), HasSubstr("first is -1"));
  EXPECT_THAT(Refusal(Run(Good(), {"--first", "24"})), HasSubstr("there are only 24"));
  EXPECT_THAT(Refusal(Run(Good(), {"--first", "9", "--last", "3"})), HasSubstr("last is 3"));
  EXPECT_THAT(Refusal(Run(Good(), {"--fps", "0"})), HasSubstr("fps"));
  for (const std::vector<std::string>& flags :
       {std::vector<std::string>{"--last", "1"}, {"--first", "22"}, {"--stride", "20"}}) {
    EXPECT_THAT(Refusal(Run(Good(), flags)),
                AllOf(HasSubstr("2 frames"), HasSubstr("at least 3 are needed")));
  }
}

// ---- what is no sequence

TEST_F(BadInput, NoSequence) {
  const fs::path empty = folder_.path() / "empty";
  const fs::path texts = folder_.path() / "texts";
  fs::create_directories(empty);
  fs::create_directories(texts);
  folder_.Write("texts/notes.txt", "no pictures here\n");
  EXPECT_THAT(Refusal(Run(folder_.path() / "nowhere")), HasSubstr("no such file or folder"));
  EXPECT_THAT(Refusal(Run(empty)), AllOf(HasSubstr("empty: "), HasSubstr("holds no images")));
  EXPECT_THAT(Refusal(Run(texts)), HasSubstr("holds no images"));
  EXPECT_THAT(Refusal(Run(texts / "notes.txt")), HasSubstr("notes.txt: is no video"));
  EXPECT_THAT(Refusal(Run(Images(Good()).front())), HasSubstr("give the folder"));
  folder_.Write("film.mp4", "no film");
  EXPECT_THAT(Refusal(Run(folder_.path() / "film.mp4")), HasSubstr("film.mp4: not a video"));
}

TEST_F(BadInput, AVideoThatWasCutOff) {
  const std::string whole = (folder_.path() / "whole.avi").string();
  {
    cv::VideoWriter writer(
        whole, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 30.0, cv::Size(320, 240));
    if (!writer.isOpened()) GTEST_SKIP() << "OpenCV here writes no MJPG video";
    for (const fs::path& image : Images(Good())) writer.write(cv::imread(image.string()));
  }
  const auto rotations = [&](const std::string& video) {
    return Rotslam({"rotations",
                    video,
                    "--camera=" + (Good() / "camera.yaml").string(),
                    "--out=" + Out().string(),
                    "--no-report",
                    "--quiet"});
  };
  EXPECT_EQ(rotations(whole).error, "");
  const std::string bytes = ReadWholeFile(whole);
  const std::string part = folder_.Write("part.avi", bytes.substr(0, bytes.size() / 2)).string();
  EXPECT_THAT(rotations(part).error,
              ContainsRegex("^rotslam: warning: the video ends after 1[0-9] of the 24 frames it "
                            "announces: the file is cut off or damaged\\. [^\n]+\n$"));
}

TEST_F(BadInput, ListsWithFaults) {
  const fs::path sequence = Copy();
  const std::string list = ReadWholeFile(sequence / "rgb.txt");
  folder_.Write("copy/rgb.txt", list + "no time\n");
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("rgb.txt:28: is 'no time', expected"));
  const std::string second = Images(sequence)[1].filename().string();
  folder_.Write("copy/rgb.txt", list + "1000.000000 rgb/" + second + "\n");
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("is not later than"));
  folder_.Write("copy/rgb.txt", "# timestamp filename\n");
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("lists no images"));
  const std::string first = Images(sequence)[0].filename().string();
  folder_.Write("copy/rgb.txt", list + "999.0 rgb/" + first + "\n");
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("is not later than"));
  folder_.Write("copy/rgb.txt", list + "nan rgb/" + first + "\n");
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("rgb.txt:28: is 'nan"));
}

TEST_F(BadInput, NothingInAFileSteersTheTerminal) {
  const fs::path sequence = Copy("copy\033[2J\r\x9b");
  folder_.Write(sequence.filename() / "rgb.txt", "\033]0;title\007 \xc2\x9b 1.png\n");
  const std::string line = Refusal(Run(sequence));
  EXPECT_THAT(line, AllOf(HasSubstr("copy?[2J?"), HasSubstr("'?]0;title? ?")));
  EXPECT_EQ(line.find_first_of("\033\r\007"), std::string::npos);
}

TEST_F(BadInput, NoReadableImageAtAll) {
  const fs::path sequence = Copy();
  for (const fs::path& image : Images(sequence)) std::ofstream(image) << "no picture";
  EXPECT_THAT(Refusal(Run(sequence)), HasSubstr("none of the 24 images can be read"));
}

// ---- cameras

TEST_F(BadInput, Cameras) {
  const std::string good = ReadWholeFile(Good() / "camera.yaml");
  const auto refusal = [&](const std::string& text) {
    SCOPED_TRACE(text);
    const std::string file = folder_.Write("camera.yaml", text).string();
    const std::string line = Refusal(Run(Good(), {"--camera", file}));
    EXPECT_THAT(line, StartsWith(file));
    return line;
  };
  const auto replaced = [&](const std::string& from, const std::string& to) {
    const std::size_t at = good.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    const std::size_t end = good.find('\n', at) + 1;
    return good.substr(0, at) + to + good.substr(end);
  };
  EXPECT_THAT(refusal(replaced("fx:", "")), HasSubstr("fx is missing"));
  EXPECT_THAT(refusal(replaced("fx:", "fx: .nan\n")), HasSubstr("fx is '.nan'"));
  EXPECT_THAT(refusal(replaced("cx:", "cx: .inf\n")), HasSubstr("cx"));
  EXPECT_THAT(refusal(replaced("fx:", "fx: -200\n")), HasSubstr("must be positive"));
  EXPECT_THAT(refusal(replaced("model:", "model: omni\n")),
              AllOf(HasSubstr("'omni'"), HasSubstr("must be one of pinhole, radtan")));
  EXPECT_THAT(refusal(replaced("width:", "width: 640\n")),
              AllOf(HasSubstr("camera says 640x240"), HasSubstr("images are 320x240")));
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal("model: [\n"), HasSubstr("not YAML"));
  EXPECT_THAT(Refusal(Run(Good(), {"--camera", "/nowhere.yaml"})), HasSubstr("/nowhere.yaml: "));
}

// ---- configurations

TEST_F(BadInput, Configurations) {
  const auto refusal = [&](const std::string& text) {
    return Refusal(Run(Good(), {"--config", folder_.Write("options.yaml", text).string()}));
  };
  EXPECT_THAT(refusal("sequence:\n  strid: 2\n"),
              AllOf(HasSubstr("options.yaml:2: "), HasSubstr("\"sequence.stride\"")));
  EXPECT_THAT(refusal("rotodom:\n  features:\n    max_features: many\n"),
              AllOf(HasSubstr("options.yaml:3: "), HasSubstr("whole number")));
  EXPECT_THAT(refusal("sequence: {stride: 0}\n"), HasSubstr("stride is 0"));
  for (const std::string number : {".nan", ".inf"}) {
    EXPECT_THAT(refusal("sequence: {fps: " + number + "}\n"), HasSubstr("fps"));
  }
  EXPECT_THAT(refusal("sequence: {stride: 99999999999}\n"), HasSubstr("whole number"));
  EXPECT_THAT(refusal("rotodom: {features: {max_features: 1}}\n"), HasSubstr("max_features is 1"));
  EXPECT_THAT(refusal("a: [\n"), HasSubstr("not YAML"));
  EXPECT_THAT(Refusal(Run(Good(), {"--config", "/nowhere.yaml"})), HasSubstr("/nowhere.yaml: "));
  EXPECT_THAT(Refusal(Run(Good(), {"--config", Good().string()})), HasSubstr("is a folder"));
}

// ---- where the results go

TEST_F(BadInput, OutThatCannotBeWritten) {
  const std::string file = folder_.Write("file", "in the way").string();
  for (const std::string& out : {file, file + "/below", std::string("/proc/rotslam")}) {
    const CommandResult result = Rotslam({"run", Good().string(), "--out", out, "--quiet"});
    EXPECT_THAT(Refusal(result), AllOf(StartsWith(out), HasSubstr("cannot make this folder")));
  }
  const CommandResult result = Rotslam({"run", Good().string(), "--out", "", "--quiet"});
  EXPECT_THAT(Refusal(result), HasSubstr("--out"));
  EXPECT_EQ(ReadWholeFile(file), "in the way");
}

TEST_F(BadInput, AFolderInPlaceOfAResult) {
  fs::create_directories(Out() / "summary.json");
  const CommandResult result = Run(Good());
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(Lines(result.error),
              ElementsAre(AllOf(StartsWith("rotslam: "), HasSubstr("summary.json"))));
  EXPECT_THAT(FileNames(Out()), Each(Not(EndsWith(".tmp"))));
}

// Root may do all things: what permissions refuse shows to somebody else only.
TEST_F(BadInput, Permissions) {
  const std::string nobody = "setpriv --reuid=65534 --regid=65534 --clear-groups";
  const auto run = [&](const fs::path& sequence, const fs::path& out, const fs::path& camera) {
    return Rotslam({"run",
                    sequence.string(),
                    "--out=" + out.string(),
                    "--camera=" + camera.string(),
                    "--quiet"},
                   "",
                   geteuid() == 0 ? nobody : "");
  };
  if (geteuid() == 0 && Rotslam({"--version"}, "", nobody).exit_code != 0) {
    GTEST_SKIP() << "needs setpriv, and the program where others may run it";
  }
  const fs::path sequence = Copy();
  const fs::path camera = folder_.Write("camera.yaml", ReadWholeFile(Good() / "camera.yaml"));
  fs::permissions(folder_.path(), fs::perms::others_all, fs::perm_options::add);
  const auto forbid = [](const fs::path& path) { fs::permissions(path, fs::perms::none); };

  const fs::path read_only = folder_.path() / "read_only";
  fs::create_directory(read_only);
  fs::permissions(read_only, fs::perms(0555));
  EXPECT_THAT(Refusal(run(sequence, read_only, camera)),
              AllOf(StartsWith(read_only.string() + ": "), HasSubstr("Permission denied")));
  EXPECT_THAT(Refusal(run(sequence, read_only / "below", camera)),
              AllOf(StartsWith(read_only.string()), HasSubstr("Permission denied")));

  forbid(camera);
  EXPECT_THAT(Refusal(run(sequence, Out(), camera)), StartsWith(camera.string() + ": "));
  fs::permissions(camera, fs::perms(0644));
  forbid(sequence / "rgb.txt");
  EXPECT_THAT(Refusal(run(sequence, Out(), camera)),
              HasSubstr((sequence / "rgb.txt").string() + ": Permission denied"));
  fs::permissions(sequence / "rgb.txt", fs::perms(0644));
  for (const fs::path& image : Images(sequence)) forbid(image);
  EXPECT_THAT(Refusal(run(sequence, Out(), camera)), HasSubstr("file cannot be opened"));
  forbid(sequence);
  EXPECT_THAT(Refusal(run(sequence, Out(), camera)), StartsWith(sequence.string() + ": "));
  fs::permissions(sequence, fs::perms::owner_all);
}

TEST_F(BadInput, ADiskThatTakesNoMore) {
  // 10 kB a file: the pose graph is longer. The shell's signal would end the program.
  const CommandResult result = Rotslam({"run",
                                        Good().string(),
                                        "--out=" + Out().string(),
                                        "--no-report",
                                        "--quiet",
                                        "--checkpoint-every=0"},
                                       "trap '' XFSZ; ulimit -f 20;",
                                       "");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(Lines(result.error),
              ElementsAre(AllOf(StartsWith("rotslam: " + Out().string()),
                                HasSubstr("cannot write the file: File too large"))));
  // What was complete is where the message says.
  const fs::path outputs = Out() / "unfinished" / "outputs";
  EXPECT_THAT(FileNames(outputs), Each(Not(EndsWith(".tmp"))));
  EXPECT_EQ(ReadTrajectory(outputs / "rotations_tum.txt").size(), std::size_t{kNumFrames});
}

TEST_F(BadInput, AFullDisk) {
  const std::string place = folder_.path().string() + "/disk";
  fs::create_directory(place);
  const std::string mount =
      "unshare --mount sh -c 'mount -t tmpfs -o size=16k none " + place + " && exec \"$0\" \"$@\"'";
  if (Rotslam({"--version"}, "", mount).exit_code != 0) GTEST_SKIP() << "needs to mount a tmpfs";
  const CommandResult result = Rotslam(
      {"run", Good().string(), "--out=" + place + "/out", "--no-report", "--quiet"}, "", mount);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(Lines(result.error),
              ElementsAre(StartsWith("rotslam: warning: no checkpoints from here on: " + place),
                          AllOf(StartsWith("rotslam: " + place + "/out"),
                                HasSubstr("cannot write the file: No space left on device"))));
}

// ---- pictures that show nothing

TEST_F(BadInput, PicturesWithoutCorners) {
  for (const double grey : {0.0, 255.0}) {
    const TemporaryFolder images;
    for (int k = 0; k < 5; ++k) {
      const std::string file = (images.path() / (std::to_string(k) + ".png")).string();
      ASSERT_TRUE(cv::imwrite(file, cv::Mat(240, 320, CV_8UC1, cv::Scalar::all(grey))));
    }
    const std::string camera = (Good() / "camera.yaml").string();
    EXPECT_THAT(Refusal(Run(images.path(), {"--camera", camera})),
                AllOf(HasSubstr("no two of the 5 frames could be matched"), HasSubstr("exposed")));
  }
}

TEST_F(BadInput, TooFewFramesOfACameraThatHardlyMoves) {
  const std::string config =
      folder_.Write("far.yaml", "keyframes: {min_parallax_deg: 30, min_keyframes: 2}\n").string();
  const CommandResult result = Run(Good(), {"--last=9", "--config=" + config});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr("moves too little in these 10 frames, give more of them"));
}

TEST_F(BadInput, ATinyPicture) {
  for (int k = 0; k < 4; ++k) {
    const std::string file = (folder_.path() / (std::to_string(k) + ".png")).string();
    ASSERT_TRUE(cv::imwrite(file, cv::Mat(12, 16, CV_8UC1, cv::Scalar::all(100 + k))));
  }
  folder_.Write("camera.yaml", "model: pinhole\nfx: 16\nfy: 16\ncx: 8\ncy: 6\n");
  EXPECT_THAT(Refusal(Run(folder_.path())), HasSubstr("could be matched"));
}

// ---- what is printed

TEST_F(BadInput, ProgressIsPlainLinesOnStandardError) {
  const CommandResult result = Rotslam({"run", Good().string(), "--out", Out().string()});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.output, "");
  EXPECT_THAT(result.error, AllOf(Not(HasSubstr("\r")), Not(HasSubstr("\033"))));
  const std::vector<std::string> lines = Lines(result.error);
  EXPECT_THAT(lines, Contains(AllOf(StartsWith("input: "), HasSubstr("24 frames"))));
  EXPECT_THAT(lines, Contains(AllOf(StartsWith("camera: pinhole, fx "), HasSubstr("320x240"))));
  EXPECT_THAT(lines, Contains(StartsWith("orientations: 24 frames")));
  ASSERT_FALSE(lines.empty());
  EXPECT_THAT(lines.back(), StartsWith("wrote "));
  fs::remove_all(Out());
  const CommandResult quiet = Run(Good());
  EXPECT_EQ(quiet.exit_code, 0);
  EXPECT_EQ(quiet.output + quiet.error, "");
}

TEST_F(BadInput, TheLineOnATerminalIsRenewedAndTakenAway) {
  if (!HasTerminals()) GTEST_SKIP() << "needs a terminal (/dev/pts)";
  // Wide enough for the ETA behind any rate, too narrow for all counters.
  constexpr unsigned kWidth = 44;
  const CommandResult result =
      RotslamOnTerminal({"run", Good().string(), "--out=" + Out().string()}, kWidth);
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.output, HasSubstr("\r\033[Korientations  "));
  EXPECT_THAT(result.output, HasSubstr("/24  "));
  EXPECT_THAT(result.output, HasSubstr("ETA 0:0"));
  for (std::size_t at = 0; (at = result.output.find("\033[K", at)) != std::string::npos;) {
    at += 3;
    // No renewed line is as wide as the terminal: what has wrapped cannot be taken away.
    const std::size_t end = result.output.find_first_of("\r\n", at);
    if (end == std::string::npos) break;
    const bool is_renewed = result.output.compare(end, 4, "\r\033[K") == 0;
    if (is_renewed) {
      EXPECT_LT(end - at, kWidth);
    }
  }
  const std::vector<std::string> shown = ShownLines(result.output);
  EXPECT_THAT(shown, Each(Not(HasSubstr("ETA"))));
  EXPECT_THAT(shown, Contains(StartsWith("orientations: 24 frames")));
  ASSERT_FALSE(shown.empty());
  EXPECT_THAT(shown.back(), StartsWith("wrote "));
  const CommandResult quiet =
      RotslamOnTerminal({"run", Good().string(), "--out=" + Out().string(), "--quiet"}, 80);
  EXPECT_EQ(quiet.output, "");
}

TEST_F(BadInput, AnErrorOnATerminalHasALineOfItsOwn) {
  if (!HasTerminals()) GTEST_SKIP() << "needs a terminal (/dev/pts)";
  for (int k = 0; k < 20; ++k) {
    const std::string file = (folder_.path() / (std::to_string(k) + ".png")).string();
    ASSERT_TRUE(cv::imwrite(file, cv::Mat(960, 1280, CV_8UC1, cv::Scalar::all(0))));
  }
  folder_.Write("camera.yaml", "model: pinhole\nfx: 900\nfy: 900\ncx: 640\ncy: 480\n");
  const CommandResult result =
      RotslamOnTerminal({"run", folder_.path().string(), "--out=" + Out().string()}, 80);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("\r\033[Korientations  "));
  EXPECT_THAT(ShownLines(result.output),
              ElementsAre(StartsWith("input: "),
                          StartsWith("times: "),
                          StartsWith("camera: "),
                          StartsWith("rotslam: no two of the 20 frames")));
}

}  // namespace
}  // namespace rotslam
