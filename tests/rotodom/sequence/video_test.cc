#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "rotodom/sequence/sequence.h"
#include "rotodom/sequence/video/video_file.h"
#include "tests/rotodom/sequence/scratch_folder.h"
#include "tests/rotodom/sequence/test_video.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::DoubleEq;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pointwise;

constexpr std::int32_t kOne = 65536;

// What a video file gives: times, mean greys (-1 for no picture) and notes.
struct Seen {
  std::vector<double> times_s;
  std::vector<double> greys;
  std::vector<std::string> problems;
  std::vector<std::string> notes;
  std::vector<cv::Mat> images;
};

Seen ReadVideo(const fs::path& file, int num_threads = 1, double fps = 30.0) {
  VideoFile video(file, fps, num_threads);
  Seen seen;
  while (video.Grab()) {
    const DecodedImage decoded = video.Retrieve();
    seen.times_s.push_back(video.time_s());
    seen.greys.push_back(decoded.image.empty() ? -1.0 : cv::mean(decoded.image)[1]);
    seen.problems.push_back(decoded.problem);
    seen.images.push_back(decoded.image);
  }
  seen.notes = video.notes();
  return seen;
}

std::vector<double> Greys(int count) {
  std::vector<double> greys;
  for (int k = 0; k < count; ++k) greys.push_back(20.0 * k + 10.0);
  return greys;
}

std::string BytesOf(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class VideoTest : public ScratchFolderTest {
 protected:
  fs::path Write(const std::string& name, const std::vector<TestStream>& streams) const {
    WriteTestVideo(folder_ / name, streams);
    return folder_ / name;
  }

  static std::string ComplaintOf(const fs::path& file) {
    try {
      VideoFile video(file, 30.0);
      return "no complaint";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
      EXPECT_THAT(error.what(), testing::StartsWith(file.string()));
      return error.what();
    }
  }
};

struct OrientationCase {
  std::vector<std::int32_t> abcd;  // times 65536
  std::string corners;             // as ffmpeg 5.1 shows them: "rgbw" as stored
  std::string described;
  ReadoutStart readout_from;
};

// All eight, each as ffmpeg's own matrices and as phones write them, with a translation.
TEST_F(VideoTest, ShowsPicturesAsTheDisplayMatrixAsks) {
  const std::vector<OrientationCase> cases = {
      {{1, 0, 0, 1}, "rgbw", "as stored", ReadoutStart::kTop},
      {{0, 1, -1, 0}, "brwg", "turned by 90 degrees clockwise", ReadoutStart::kRight},
      {{-1, 0, 0, -1}, "wbgr", "turned by 180 degrees", ReadoutStart::kBottom},
      {{0, -1, 1, 0}, "gwrb", "turned by 90 degrees counterclockwise", ReadoutStart::kLeft},
      {{-1, 0, 0, 1}, "grwb", "mirrored left to right", ReadoutStart::kTop},
      {{1, 0, 0, -1}, "bwrg", "mirrored top to bottom", ReadoutStart::kBottom},
      {{0, 1, 1, 0}, "rbgw", "transposed", ReadoutStart::kLeft},
      {{0, -1, -1, 0}, "wgbr", "transposed and turned by 180 degrees", ReadoutStart::kRight}};
  TestStream stream;
  stream.pictures = std::vector<cv::Mat>(3, FourColours());
  const fs::path file = Write("film.mp4", {stream});
  for (const OrientationCase& expected : cases) {
    const auto& abcd = expected.abcd;
    for (const std::int32_t shift : {0, 48 * kOne}) {
      PatchDisplayMatrix(file,
                         {abcd[0] * kOne,
                          abcd[1] * kOne,
                          0,
                          abcd[2] * kOne,
                          abcd[3] * kOne,
                          0,
                          shift,
                          shift,
                          1 << 30});
      const auto sequence = OpenSequence(file, {});
      const bool is_upright_film = abcd[0] == 0;
      EXPECT_EQ(sequence->image_size(), is_upright_film ? cv::Size(48, 64) : cv::Size(64, 48));
      EXPECT_EQ(sequence->readout_from(), expected.readout_from) << expected.described;
      EXPECT_EQ(sequence->form(), "video (MPEG-4 in MP4)");
      if (expected.described == "as stored") {
        EXPECT_THAT(sequence->notes(), IsEmpty());
      } else {
        EXPECT_THAT(sequence->notes(),
                    ElementsAre(AllOf(HasSubstr("pictures are " + expected.described + ","),
                                      HasSubstr("64x48 stored"))));
      }
      int count = 0;
      while (const auto frame = sequence->Next()) {
        ASSERT_EQ(frame->problem, "");
        EXPECT_EQ(frame->image.size(), sequence->image_size());
        EXPECT_EQ(CornersOf(frame->image), expected.corners) << expected.described;
        ++count;
      }
      EXPECT_EQ(count, 3);
    }
  }
}

TEST_F(VideoTest, TakesNoMatrixOfOtherAngles) {
  TestStream stream;
  stream.pictures = std::vector<cv::Mat>(2, FourColours());
  const fs::path file = Write("film.mp4", {stream});
  PatchDisplayMatrix(file, {56756, 32768, 0, -32768, 56756, 0, 0, 0, 1 << 30});  // 30 degrees
  VideoFile video(file, 30.0);
  EXPECT_EQ(video.image_size(), cv::Size(64, 48));
  EXPECT_THAT(video.notes(), ElementsAre(HasSubstr("by 30 degrees, which is no right angle")));
  ASSERT_TRUE(video.Grab());
  EXPECT_EQ(CornersOf(video.Retrieve().image), "rgbw");
}

// The sensor's first row, wherever it is shown.
TEST(PictureOrientation, SideOfFirstRowIsWhereUprightShowsIt) {
  cv::Mat stored = cv::Mat::zeros(6, 8, CV_8UC1);
  stored.row(0) = cv::Scalar(255);
  for (const std::int32_t sign_a : {-kOne, kOne}) {
    for (const std::int32_t sign_b : {-kOne, kOne}) {
      for (const bool is_transposed : {false, true}) {
        const DisplayMatrix matrix = is_transposed
                                         ? DisplayMatrix{0, sign_a, 0, sign_b, 0, 0, 0, 0, 1 << 30}
                                         : DisplayMatrix{sign_a, 0, 0, 0, sign_b, 0, 0, 0, 1 << 30};
        const auto orientation = OrientationOf(matrix);
        ASSERT_TRUE(orientation.has_value());
        const cv::Mat shown = Upright(stored, *orientation);
        const cv::Mat side = [&]() -> cv::Mat {
          switch (SideOfFirstRow(*orientation)) {
            case ReadoutStart::kTop:
              return shown.row(0);
            case ReadoutStart::kBottom:
              return shown.row(shown.rows - 1);
            case ReadoutStart::kLeft:
              return shown.col(0);
            default:
              return shown.col(shown.cols - 1);
          }
        }();
        EXPECT_EQ(cv::countNonZero(side), 8) << Describe(*orientation);
      }
    }
  }
  EXPECT_FALSE(OrientationOf({}).has_value());
}

TEST_F(VideoTest, TellsAllTimesOfBFrames) {
  for (const char* name : {"film.mp4", "film.mov", "film.mkv", "film.avi", "film.ts"}) {
    for (const int count : {2, 3, 11}) {
      // FFmpeg takes fewer packets for no transport stream.
      if (count < 11 && name == std::string("film.ts")) continue;
      TestStream stream;
      stream.pictures = GreyPictures(count);
      stream.num_b_frames = 2;
      const fs::path file = Write(name, {stream});
      const auto sequence = OpenSequence(file, {});
      EXPECT_EQ(sequence->NumFrames(), count) << name;
      EXPECT_EQ(sequence->times_source(), "timestamps of the video");
      EXPECT_FALSE(sequence->times_are_made_up());
      std::vector<double> expected_s;
      for (int k = 0; k < count; ++k) expected_s.push_back(k / 10.0);
      const Seen seen = ReadVideo(file);
      EXPECT_THAT(seen.times_s, Pointwise(DoubleNear(1e-9), expected_s)) << name << " " << count;
      EXPECT_THAT(seen.greys, Pointwise(DoubleNear(4.0), Greys(count))) << name << " " << count;
      EXPECT_THAT(seen.notes, IsEmpty()) << name << " " << count;
    }
  }
}

TEST_F(VideoTest, TellsVariableTimes) {
  TestStream stream;
  stream.pictures = GreyPictures(6);
  stream.fps = 1000.0;
  stream.times = {0, 33, 100, 133, 500, 534};
  const Seen seen = ReadVideo(Write("film.mp4", {stream}));
  EXPECT_THAT(seen.times_s,
              Pointwise(DoubleNear(1e-9), std::vector<double>{0.0, 0.033, 0.1, 0.133, 0.5, 0.534}));
}

TEST_F(VideoTest, StartsAtZero) {
  TestStream stream;
  stream.pictures = GreyPictures(4);
  stream.times = {50, 51, 52, 53};
  EXPECT_THAT(ReadVideo(Write("film.ts", {stream})).times_s,
              Pointwise(DoubleNear(1e-9), std::vector<double>{0.0, 0.1, 0.2, 0.3}));
}

TEST_F(VideoTest, MakesTimesUpForBareStreams) {
  TestStream stream;
  stream.pictures = GreyPictures(5);
  const fs::path own = Write("film.m4v", {stream});
  VideoFile says(own, 30.0);
  EXPECT_TRUE(says.times_are_made_up());
  EXPECT_EQ(says.times_source(), "made up at 10 frames a second, the rate that the stream says");
  EXPECT_THAT(ReadVideo(own).times_s,
              Pointwise(DoubleEq(), std::vector<double>{0.0, 0.1, 0.2, 0.3, 0.4}));
  stream.codec = "mjpeg";
  const fs::path file = Write("film.mjpeg", {stream});
  SequenceOptions options;
  options.fps = 20.0;
  const auto sequence = OpenSequence(file, options);
  EXPECT_TRUE(sequence->times_are_made_up());
  EXPECT_EQ(sequence->times_source(), "made up at 20 frames a second");
  EXPECT_EQ(sequence->form(), "video (Motion JPEG)");
  EXPECT_EQ(sequence->NumFrames(), 5);
  EXPECT_THAT(ReadVideo(file, 1, 20.0).times_s,
              Pointwise(DoubleEq(), std::vector<double>{0.0, 0.05, 0.1, 0.15, 0.2}));
}

TEST_F(VideoTest, KeepsThePlaceOfDamagedFrames) {
  TestStream stream;
  stream.codec = "mjpeg";
  stream.pictures = GreyPictures(6);
  for (const char* name : {"film.avi", "film.mov", "film.mkv"}) {
    const fs::path file = Write(name, {stream});
    std::string bytes = BytesOf(file);
    // The fourth picture loses all that tells of it.
    std::size_t at = 0;
    for (int k = 0; k < 4; ++k) at = bytes.find("\xff\xd8\xff", at + 1);
    const std::size_t end = bytes.find("\xff\xd9", at);
    ASSERT_NE(end, std::string::npos);
    std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(at),
              bytes.begin() + static_cast<std::ptrdiff_t>(end) + 2,
              '\0');
    std::ofstream(file, std::ios::binary) << bytes;
    const Seen one = ReadVideo(file, 1);
    EXPECT_THAT(one.times_s,
                Pointwise(DoubleNear(1e-3), std::vector<double>{0.0, 0.1, 0.2, 0.3, 0.4, 0.5}))
        << name;
    EXPECT_THAT(one.problems,
                ElementsAre("", "", "", "frame of the video cannot be decoded", "", ""))
        << name;
    const Seen four = ReadVideo(file, 4);
    EXPECT_EQ(one.times_s, four.times_s);
    EXPECT_EQ(one.greys, four.greys);
  }
}

TEST_F(VideoTest, ThreadsChangeNoByte) {
  TestStream stream;
  cv::theRNG().state = 7;
  for (int k = 0; k < 12; ++k) {
    cv::Mat noise(48, 70, CV_8UC3);
    cv::randu(noise, 0, 255);
    stream.pictures.push_back(noise);
  }
  stream.num_b_frames = 2;
  const fs::path file = Write("film.mp4", {stream});
  const Seen one = ReadVideo(file, 1);
  const Seen five = ReadVideo(file, 5);
  ASSERT_EQ(one.images.size(), 12u);
  ASSERT_EQ(five.images.size(), 12u);
  for (std::size_t k = 0; k < 12; ++k) {
    EXPECT_EQ(cv::norm(one.images[k], five.images[k], cv::NORM_INF), 0.0);
  }
}

TEST_F(VideoTest, HasThePixelsOfOpenCv) {
  for (const cv::Size size : {cv::Size(64, 48), cv::Size(70, 50), cv::Size(336, 252)}) {
    TestStream stream;
    cv::theRNG().state = 7;
    for (int k = 0; k < 3; ++k) {
      cv::Mat noise(size, CV_8UC3);
      cv::randu(noise, 0, 255);
      stream.pictures.push_back(noise);
    }
    const fs::path file = Write("film.mp4", {stream});
    cv::VideoCapture capture(file.string(), cv::CAP_FFMPEG);
    if (!capture.isOpened()) GTEST_SKIP() << "OpenCV here opens no MP4";
    for (const cv::Mat& image : ReadVideo(file).images) {
      cv::Mat theirs;
      ASSERT_TRUE(capture.read(theirs));
      ASSERT_EQ(image.size(), size);
      EXPECT_TRUE(image.isContinuous());
      EXPECT_LE(cv::norm(image, theirs, cv::NORM_INF), 1.0);
    }
  }
}

TEST_F(VideoTest, LeavesOutALastFrameThatIsCutOff) {
  TestStream stream;
  stream.codec = "mjpeg";
  cv::theRNG().state = 7;
  for (int k = 0; k < 6; ++k) {
    cv::Mat noise(48, 64, CV_8UC3);
    cv::randu(noise, 0, 255);
    stream.pictures.push_back(noise);
  }
  const fs::path file = Write("film.avi", {stream});
  const std::string bytes = BytesOf(file);
  std::size_t at = 0;
  for (int k = 0; k < 4; ++k) at = bytes.find("\xff\xd8\xff", at + 1);
  std::ofstream(file, std::ios::binary) << bytes.substr(0, at + 200);
  const Seen seen = ReadVideo(file);
  EXPECT_THAT(seen.problems, ElementsAre("", "", ""));
  EXPECT_THAT(seen.notes, ElementsAre(HasSubstr("the last frame of the file is cut off")));
}

TEST_F(VideoTest, BeginsWithTheFirstKeyFrame) {
  TestStream stream;
  stream.codec = "libx264";  // FFmpeg's own codecs make something of frames without a key frame
  if (!HasEncoder(stream.codec)) GTEST_SKIP() << "FFmpeg here has no " << stream.codec;
  stream.pictures = GreyPictures(12);
  stream.fps = 25.0;
  stream.key_frame_distance = 4;
  const fs::path file = Write("film.ts", {stream});
  ASSERT_EQ(ReadVideo(file).times_s.size(), 12u);
  // Cut where the second picture begins: a packet of 188 bytes that starts a unit of the stream.
  const std::string bytes = BytesOf(file);
  std::vector<std::size_t> starts;
  for (std::size_t at = 0; at + 188 <= bytes.size(); at += 188) {
    const bool is_video = (bytes[at + 1] & 0x1f) == 1 && bytes[at + 2] == 0;
    if (is_video && (bytes[at + 1] & 0x40) != 0) starts.push_back(at);
  }
  ASSERT_EQ(starts.size(), 12u);
  std::ofstream(file, std::ios::binary) << bytes.substr(0, starts[0]) + bytes.substr(starts[1]);
  VideoFile video(file, 30.0);
  const Seen seen = ReadVideo(file);
  EXPECT_EQ(video.num_announced(), static_cast<std::int64_t>(seen.times_s.size()));
  ASSERT_THAT(
      seen.greys,
      Pointwise(DoubleNear(4.0), std::vector<double>{90, 110, 130, 150, 170, 190, 210, 230}));
  for (std::size_t k = 1; k < seen.times_s.size(); ++k) {
    EXPECT_NEAR(seen.times_s[k] - seen.times_s[k - 1], 0.04, 1e-9);
  }
  EXPECT_THAT(seen.notes, ElementsAre(HasSubstr("the first 3 frames cannot be decoded")));
}

TEST_F(VideoTest, NamesAMovieWithoutItsIndex) {
  TestStream stream;
  stream.pictures = GreyPictures(4);
  const fs::path file = Write("film.mp4", {stream});
  const std::string bytes = BytesOf(file);
  std::ofstream(file, std::ios::binary) << bytes.substr(0, bytes.find("moov") - 4);
  EXPECT_THAT(ComplaintOf(file), HasSubstr("without its index (moov)"));
}

TEST_F(VideoTest, TakesTheLargestStream) {
  TestStream small;
  small.pictures = GreyPictures(3, {32, 24});
  TestStream large;
  large.pictures = GreyPictures(4);
  const fs::path file = Write("film.mp4", {small, large});
  VideoFile video(file, 30.0);
  EXPECT_EQ(video.image_size(), cv::Size(64, 48));
  EXPECT_EQ(video.num_announced(), 4);
  EXPECT_THAT(video.notes(),
              ElementsAre(AllOf(HasSubstr("the largest is read, 1 (MPEG-4, 64x48)"),
                                HasSubstr("left out: 0 (MPEG-4, 32x24)"))));
  EXPECT_EQ(ReadVideo(file).times_s.size(), 4u);
}

TEST_F(VideoTest, RefusesWhatIsNoVideo) {
  TestStream sound;
  sound.codec = "";
  EXPECT_THAT(ComplaintOf(Write("sound.mov", {sound})),
              HasSubstr("holds no video stream, only sound: pcm_s16le"));
  EXPECT_THAT(ComplaintOf(WriteText("film.mp4", "no film")), HasSubstr("not a video"));
  EXPECT_THAT(ComplaintOf(WriteText("empty.mp4", "")), HasSubstr("not a video"));
  EXPECT_THAT(
      ComplaintOf(WriteText("list.m3u8", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\na.ts\n")),
      HasSubstr("not a video but, for FFmpeg, 'hls'"));
  std::vector<unsigned char> png;
  cv::imencode(".png", cv::Mat::zeros(12, 16, CV_8UC1), png);
  EXPECT_THAT(ComplaintOf(WriteText("film.mov", {png.begin(), png.end()})),
              HasSubstr("not a video but, for FFmpeg, 'png_pipe'"));
}

TEST_F(VideoTest, NotesPixelsThatAreNotSquare) {
  TestStream stream;
  stream.pictures = GreyPictures(2);
  stream.pixel_width = 4;
  stream.pixel_height = 3;
  const fs::path file = Write("film.mp4", {stream});
  EXPECT_THAT(ReadVideo(file).notes,
              ElementsAre(AllOf(HasSubstr("4:3 as stored"), HasSubstr("fy is about 1.33333 fx"))));
}

TEST_F(VideoTest, NamesThatArePatternsGetTheirFolder) {
  for (const char* name : {"%06d.png", "*.png"}) {
    try {
      OpenSequence(folder_ / name, {});
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("is a pattern of names; give the folder, "));
    }
  }
}

// A colon in the name is no protocol, and a film may be called like one.
TEST_F(VideoTest, OpensFilesOfAnyName) {
  TestStream stream;
  stream.pictures = GreyPictures(3);
  fs::rename(Write("film.mp4", {stream}), folder_ / "concat:a|b.mp4");
  EXPECT_EQ(ReadVideo(folder_ / "concat:a|b.mp4").times_s.size(), 3u);
}

TEST(SharedVideos, AreReadRight) {
  const fs::path folder = fs::path(ROTSLAM_SHARED_DIR) / "cases" / "inputs" / "video";
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const Seen b_frames = ReadVideo(folder / "f10.mp4");
  ASSERT_EQ(b_frames.times_s.size(), 14u);
  for (int k = 0; k < 14; ++k) EXPECT_NEAR(b_frames.times_s[k], 0.1 * k, 1e-12);
  VideoFile upright(folder / "phone_upright.mp4", 30.0);
  EXPECT_EQ(upright.image_size(), cv::Size(360, 480));
  EXPECT_EQ(upright.readout_from(), ReadoutStart::kRight);
  EXPECT_EQ(upright.num_announced(), 14);
}

}  // namespace
}  // namespace rotslam
